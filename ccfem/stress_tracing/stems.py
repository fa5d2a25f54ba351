"""Stems: members that end freely, at a clamp or a load, and that two main paths run into together.

Where a main path ends in a joint beside such a member, and would run on along it, both share its
width, each on its own side: so strands of both reach the clamp, and none lies over another.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.stress_tracing.frame import FREE, Frame, Member
from ccfem.stress_tracing.main_paths import MainPath, outward

__all__ = ["with_shared_stems"]

_ALONG = np.cos(np.radians(35.0))
"""A path runs along a stem that it would enter with a turn of up to 35 degrees."""
_ALIKE = 3.0
"""Paths share a stem where neither is more than three times as wide as the other."""


def with_shared_stems(paths: Sequence[MainPath], frame: Frame) -> list[MainPath]:
    """Let main paths share members that end freely.

    Parameters
    ----------
    paths : sequence of MainPath
    frame : Frame

    Returns
    -------
    list of MainPath
        In the same order. A shared member is divided along its length, by the widths of both.
    """
    found = list(paths)
    for k in range(len(found)):
        for backward in (False, True):
            own = _turned(found[k], backward)
            joint = own.members[-1].ends[1]
            if own.closed or joint == FREE:
                continue
            arrival = -outward(own.members[-1].reversed, frame, joint)
            best, of, turned = _ALONG, -1, False
            for n, other in enumerate(found):
                for way in (False, True):
                    stem = _stem(_turned(other, way), joint)
                    if n != k and stem is not None and _alike(own, _turned(other, way)):
                        along = float(arrival @ outward(stem, frame, joint))
                        if along > best:
                            best, of, turned = along, n, way
            if of >= 0:
                whole = _turned(found[of], turned)
                mine, others = _divided(
                    own, whole, outward(whole.members[-1], frame, joint), arrival
                )
                found[k] = _turned(replace(own, members=(*own.members, mine)), backward)
                rest = replace(whole, members=(*whole.members[:-1], others))
                found[of] = _turned(rest, turned)
    return found


def _turned(path: MainPath, backward: bool) -> MainPath:
    """Path, walked the other way if `backward`."""
    if not backward:
        return path
    return replace(path, members=tuple(member.reversed for member in path.members[::-1]))


def _stem(path: MainPath, joint: int) -> Member | None:
    """Last member of a path, if it leads from a joint that the path runs through to a free end."""
    last = path.members[-1]
    through = not path.closed and len(path.members) > 1 and last.ends == (joint, FREE)
    return last if through else None


def _widths(own: MainPath, whole: MainPath) -> tuple[float, float]:
    """Median widths, mm, of the members of both paths before a stem of the second one."""
    wide, beside = (np.median(each.width) for each in (own.members[-1], whole.members[-2]))
    return float(wide), float(beside)


def _alike(own: MainPath, whole: MainPath) -> bool:
    """Whether neither path is much wider than the other."""
    least, most = sorted(_widths(own, whole))
    return most <= _ALIKE * least


def _divided(
    own: MainPath, whole: MainPath, along: FloatArray, arrival: FloatArray
) -> tuple[Member, Member]:
    """Parts of the stem of `whole` for `own`, which arrives on one side of it, and for itself."""
    stem = whole.members[-1]
    wide, beside = _widths(own, whole)
    share = wide / (wide + beside)
    # Coming from the left one walks to the right.
    on_left = along[0] * arrival[1] - along[1] * arrival[0] < 0.0
    cut = stem.left + (share if on_left else 1.0 - share) * (stem.right - stem.left)
    left = Member(0.5 * (stem.left + cut), stem.left, cut, stem.ends)
    right = Member(0.5 * (cut + stem.right), cut, stem.right, stem.ends)
    return (left, right) if on_left else (right, left)
