"""Main load paths: members joined through the joints that they meet in, by the paper's criterion.

The paper walks greedily over the points of the medial axis (`walk.py` does exactly that), which
skips joints and leaves stray points. Here its criterion is evaluated instead for every pair of
members at every joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.slicing.layers.layer import LayerStress
from ccfem.strategies.stress_tracing.frame import FREE, Frame, Member, ends_at
from ccfem.strategies.stress_tracing.stress_lines import (
    Criterion,
    misalignment,
    plane_stress_at,
    stress_lines,
)

_REACH = 5.0
"""Length, mm, beyond the disc of a joint over which the direction of a member is measured."""
_OTHER_SIGN = 1.5
"""Factor on the smoothness of a pair of which one is in tension and the other in compression."""


@dataclass(frozen=True)
class MainPath:
    """A chain of members that one family of tracks runs through."""

    members: tuple[Member, ...]  # in walking order and direction
    closed: bool = False  # whether the last one leads into the first


class _End(NamedTuple):
    """End of a member at a joint: its direction away from there, its stress and misalignment."""

    joint: int
    member: int
    side: int
    outward: FloatArray
    value: float
    beta: float


def main_paths(
    frame: Frame, stress: LayerStress, criterion: Criterion | None = None, width_ratio: float = 2.0
) -> list[MainPath]:
    """Join members to main load paths.

    The pairs of ends that meet in a joint are joined in the order of their smoothness, if they turn
    by less than the limit. The misalignment is that of both members beside the joint, capped at its
    limit. The distance is that across the joint, the same for all pairs. Ends without a partner are
    ends of main paths.

    Parameters
    ----------
    width_ratio : float, default 2
        Largest ratio of the widest member of a main path to its narrowest, by their median widths:
        the same tracks fill both.

    Returns
    -------
    list of MainPath
        Every member is in one.
    """
    rule = criterion or Criterion()
    widths = np.array([np.median(member.width) for member in frame.members])
    chain = np.arange(len(frame.members))
    partner: dict[tuple[int, int], tuple[int, int]] = {}
    for _, a, b in sorted(_candidates(_ends(frame, stress, rule.misalignment), rule)):
        both = (chain == chain[a[0]]) | (chain == chain[b[0]])
        least, most = widths[both].min(), widths[both].max()
        if a in partner or b in partner or most > width_ratio * least:
            continue
        partner[a], partner[b] = b, a
        chain[both] = chain[a[0]]
    return _chained(frame.members, partner)


def _ends(frame: Frame, stress: LayerStress, limit: float) -> list[_End]:
    """Find direction and stress of the members from the disc of each joint outwards."""
    joints = range(len(frame.joints))
    places = [(joint, *end) for joint in joints for end in ends_at(frame.members, joint)]
    if not places:
        return []
    stretches, outward = [], []
    for joint, number, side in places:
        points = frame.members[number].points[:: 1 - 2 * side]
        stretch, direction = _stretch(points, frame.joints[joint], frame.radius[joint])
        stretches.append(stretch)
        outward.append(direction)
    plane = plane_stress_at(stress, np.concatenate(stretches), float(frame.radius.max()))
    sizes = np.array([len(stretch) for stretch in stretches])
    lines = stress_lines(np.add.reduceat(plane, np.cumsum(sizes) - sizes) / sizes[:, None])
    beta = np.minimum(misalignment(np.array(outward), lines, 0.5 * limit), limit)
    ends = zip(places, outward, lines.value.tolist(), beta.tolist(), strict=True)
    return [_End(*place, *rest) for place, *rest in ends]


def outward(member: Member, frame: Frame, joint: int) -> FloatArray:
    """Direction (2,) of a member away from a joint that it starts in: a unit vector."""
    return _stretch(member.points, frame.joints[joint], frame.radius[joint])[1]


def _stretch(
    points: FloatArray, middle: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Points of a member beside the joint that it starts in, and their direction away from it."""
    away = np.linalg.norm(points - middle, axis=1)
    first = int(np.argmax(away >= radius)) if (away >= radius).any() else int(np.argmax(away))
    beyond = np.flatnonzero(away[first:] >= radius + _REACH)
    last = first + int(beyond[0]) if len(beyond) else len(points) - 1
    start = points[first] if last > first else middle
    step = points[last] - start
    return points[min(first, last) : last + 1], step / np.linalg.norm(step)


def _candidates(
    ends: list[_End], rule: Criterion
) -> list[tuple[float, tuple[int, int], tuple[int, int]]]:
    """Smoothness of every pair of ends in a joint that turns by less than the limit."""
    candidates = []
    joints = (list(group) for _, group in groupby(ends, key=lambda end: end.joint))
    for one, other in (pair for joint in joints for pair in combinations(joint, 2)):
        cosine = np.clip(-one.outward @ other.outward, -1.0, 1.0)
        turn = float(np.degrees(np.arccos(cosine)))
        if turn <= rule.turn:
            delta = float(rule(turn, 0.5 * (one.beta + other.beta), 0.0))
            if one.value * other.value < 0.0:
                delta *= _OTHER_SIGN
            candidates.append((delta, (one.member, one.side), (other.member, other.side)))
    return candidates


def _chained(
    members: tuple[Member, ...], partner: dict[tuple[int, int], tuple[int, int]]
) -> list[MainPath]:
    """Walk from every end without a partner, then along closed paths."""
    used: set[int] = set()
    paths = []
    every = [(number, side) for number in range(len(members)) for side in (0, 1)]
    for start in sorted(every, key=lambda end: end in partner):
        chain: list[Member] = []
        end: tuple[int, int] | None = start
        while end is not None and end[0] not in used:
            number, side = end
            used.add(number)
            chain.append(members[number] if side == 0 else members[number].reversed)
            end = partner.get((number, 1 - side))
        if chain:
            closed = end is not None or (len(chain) == 1 and chain[0].closed)
            paths.append(MainPath(tuple(chain), closed))
    return paths


# Stems: members that end at a clamp or a load and are shared by two main paths.
#
# If a main path ends in a joint beside such a member, and would continue along it, both paths share
# its width, each on its own side. So strands of both reach the clamp, and none overlap.


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
