"""Stems: members that end at a clamp or a load and are shared by two main paths.

If a main path ends in a joint beside such a member, and would continue along it, both paths share
its width, each on its own side. So strands of both reach the clamp, and none overlap.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.strategies.stress_tracing.frame import FREE, Frame, Member
from ccfem.strategies.stress_tracing.main_paths import MainPath, outward

_ALONG = np.cos(np.radians(35.0))
"""A path runs along a stem that it would enter with a turn of up to 35 degrees."""
_FORK = np.cos(np.radians(70.0))
"""A stem forks into paths that leave it at up to 70 degrees."""
_ALIKE = 3.0
"""Paths share a stem where neither is more than three times as wide as the other."""


def with_shared_stems(paths: Sequence[MainPath], frame: Frame) -> list[MainPath]:
    """Let main paths share members with a free end.

    Returns
    -------
    list of MainPath
        In the same order. A shared member is divided along its length in proportion to both widths.
        A member that is a path of its own and forks into two others is given to these.
    """
    forked = _forked(paths, frame)
    for k in range(len(forked)):
        for backward in (False, True):
            path = _turned(forked[k], backward)
            joint = path.members[-1].ends[1]
            if path.closed or joint == FREE:
                continue
            arrival = -outward(path.members[-1].reversed, frame, joint)
            # The stem ahead that turns least from the way that the path arrives.
            best, of, turned = _ALONG, -1, False
            for n, other in enumerate(forked):
                for way in (False, True):
                    stem = _stem(_turned(other, way), joint)
                    if n != k and stem is not None and _alike(path, _turned(other, way)):
                        along = float(arrival @ outward(stem, frame, joint))
                        if along > best:
                            best, of, turned = along, n, way
            if of >= 0:
                whole = _turned(forked[of], turned)
                mine, others = _divided(
                    path, whole, outward(whole.members[-1], frame, joint), arrival
                )
                forked[k] = _turned(replace(path, members=(*path.members, mine)), backward)
                rest = replace(whole, members=(*whole.members[:-1], others))
                forked[of] = _turned(rest, turned)
    return forked


def _forked(paths: Sequence[MainPath], frame: Frame) -> list[MainPath]:
    """Divide stems that no path runs through between the paths that end there on both sides."""
    forked: list[MainPath | None] = list(paths)
    for k, whole in enumerate(paths):
        stem = whole.members[0] if whole.members[0].ends[1] == FREE else whole.members[0].reversed
        joint = stem.ends[0]
        if len(whole.members) > 1 or whole.closed or stem.ends[1] != FREE or joint == FREE:
            continue
        along = outward(stem, frame, joint)
        # On both sides of the stem the path that arrives most nearly along it.
        sides: dict[bool, tuple[float, int, bool]] = {}
        for n, path in enumerate(forked):
            for way in (False, True):
                if n == k or path is None or path.closed:
                    continue
                turned = _turned(path, way)
                if turned.members[-1].ends[1] != joint:
                    continue
                arrival = -outward(turned.members[-1].reversed, frame, joint)
                side = _on_left(along, arrival)
                near = float(arrival @ along)
                if near > max(_FORK, sides.get(side, (0.0,))[0]):
                    sides[side] = (near, n, way)
        if len(sides) < 2 or sides[True][1] == sides[False][1]:
            continue
        left, right = (forked[sides[side][1]] for side in (True, False))
        assert left is not None
        assert right is not None
        ends = [_turned(left, sides[True][2]), _turned(right, sides[False][2])]
        wide = [float(np.median(turned.members[-1].width)) for turned in ends]
        parts = _split_by_share(stem, wide[0] / sum(wide))
        for side, turned, part in zip((True, False), ends, parts, strict=True):
            longer = replace(turned, members=(*turned.members, part))
            forked[sides[side][1]] = _turned(longer, sides[side][2])
        forked[k] = None
    return [path for path in forked if path is not None]


def _turned(path: MainPath, backward: bool) -> MainPath:
    """Path, reversed if `backward`."""
    if not backward:
        return path
    return replace(path, members=tuple(member.reversed for member in path.members[::-1]))


def _stem(path: MainPath, joint: int) -> Member | None:
    """Last member of a path, if it leads from a joint that the path runs through to a free end."""
    last = path.members[-1]
    through = not path.closed and len(path.members) > 1 and last.ends == (joint, FREE)
    return last if through else None


def _widths(branch: MainPath, whole: MainPath) -> tuple[float, float]:
    """Median widths, mm, of the members of both paths before a stem of the second one."""
    wide, beside = (np.median(member.width) for member in (branch.members[-1], whole.members[-2]))
    return float(wide), float(beside)


def _alike(branch: MainPath, whole: MainPath) -> bool:
    """Whether neither path is much wider than the other."""
    least, most = sorted(_widths(branch, whole))
    return most <= _ALIKE * least


def _divided(
    branch: MainPath, whole: MainPath, along: FloatArray, arrival: FloatArray
) -> tuple[Member, Member]:
    """Parts of the stem of `whole` for `branch`, arriving on one side of it, and for itself."""
    stem = whole.members[-1]
    wide, beside = _widths(branch, whole)
    share = wide / (wide + beside)
    if _on_left(along, arrival):
        return _split_by_share(stem, share)
    others, mine = _split_by_share(stem, 1.0 - share)
    return mine, others


def _on_left(along: FloatArray, arrival: FloatArray) -> bool:
    """Whether a path arrives from the left of a direction."""
    return bool(along[0] * arrival[1] - along[1] * arrival[0] < 0.0)


def _split_by_share(stem: Member, share: float) -> tuple[Member, Member]:
    """Left and right part of a stem, of which the left one has a share of the width."""
    cut = stem.left + share * (stem.right - stem.left)
    left = Member(0.5 * (stem.left + cut), stem.left, cut, stem.ends)
    right = Member(0.5 * (cut + stem.right), cut, stem.right, stem.ends)
    return left, right
