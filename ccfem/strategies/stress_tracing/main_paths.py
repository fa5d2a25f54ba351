"""Main load paths: members joined through the joints that they meet in, by the paper's criterion.

The paper walks greedily over the points of the medial axis (`walk.py` does exactly that), which
skips joints and leaves stray points. Here its criterion is evaluated instead for every pair of
members at every joint.
"""

from dataclasses import dataclass
from itertools import combinations, groupby
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.slicing.layers.layer import LayerStress
from ccfem.strategies.stress_tracing.frame import Frame, Member, ends_at
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
    """A chain of members that one family of tracks runs through.

    Attributes
    ----------
    members : tuple of Member
        In walking order and direction.
    closed : bool
        Whether the last one leads into the first.
    """

    members: tuple[Member, ...]
    closed: bool = False


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
