"""Main load paths: members joined through the joints that they meet in, by the paper's criterion.

The paper walks greedily over the points of the medial axis (`walk.py` does that to the letter),
which skips joints and leaves stray points. Here its criterion is evaluated for every pair of
members at every joint instead.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.layers.layer_stress import LayerStress
from ccfem.stress_tracing.criterion import Criterion
from ccfem.stress_tracing.frame import Frame, Member
from ccfem.stress_tracing.stress_lines import misalignment, plane_stress_at, stress_lines

__all__ = ["MainPath", "main_paths"]

_REACH = 5.0
"""Length, mm, beyond the disc of a joint over which the direction of a member is taken."""
_OTHER_SIGN = 1.5
"""Factor on the smoothness of a pair of which one is pulled and the other pushed."""


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


@dataclass(frozen=True)
class _End:
    """End of a member at a joint: its direction away from there, its stress and misalignment."""

    member: int
    side: int
    outward: FloatArray
    value: float
    beta: float


def main_paths(
    frame: Frame,
    stress: LayerStress,
    criterion: Criterion | None = None,
    width_ratio: float = 2.0,
) -> list[MainPath]:
    """Join members to main load paths.

    Of all pairs of ends that meet in a joint the smoothest is joined first, as long as it turns by
    less than the limit. The misalignment is that of both members beside the joint, cut off at its
    limit; the distance is that across the joint, the same for all. Ends that stay without a
    partner are ends of main paths.

    Parameters
    ----------
    frame : Frame
    stress : LayerStress
    criterion : Criterion, optional
    width_ratio : float, default 2
        Most that the widest member of a main path has over its narrowest, by their medians: all
        its tracks share out either.

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
    return _chained(frame, partner)


def _ends(frame: Frame, stress: LayerStress, limit: float) -> list[list[_End]]:
    """Find direction and stress of the members from the disc of each joint outwards."""
    places, outward, stretches = [], [], []
    for joint, (middle, radius) in enumerate(zip(frame.joints, frame.radius, strict=True)):
        for number, side in frame.ends_at(joint):
            stretch, direction = _stretch(frame.members[number].points, side, middle, radius)
            places.append((joint, number, side))
            outward.append(direction)
            stretches.append(stretch)
    found: list[list[_End]] = [[] for _ in frame.joints]
    if not places:
        return found
    plane = plane_stress_at(stress, np.concatenate(stretches), float(frame.radius.max()))
    first = np.concatenate([[0], np.cumsum([len(stretch) for stretch in stretches])[:-1]])
    mean = np.add.reduceat(plane, first) / np.array([[len(x)] for x in stretches])
    lines = stress_lines(mean)
    beta = np.minimum(misalignment(np.array(outward), lines, 0.5 * limit), limit)
    for k, (joint, number, side) in enumerate(places):
        end = _End(number, side, outward[k], float(lines.value[k]), float(beta[k]))
        found[joint].append(end)
    return found


def _stretch(
    points: FloatArray, side: int, middle: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Points of a member beside a joint, and the direction there, away from the joint."""
    points = points if side == 0 else points[::-1]
    away = np.linalg.norm(points - middle, axis=1)
    first = int(np.argmax(away >= radius)) if (away >= radius).any() else int(np.argmax(away))
    beyond = np.flatnonzero(away[first:] >= radius + _REACH)
    last = first + int(beyond[0]) if len(beyond) else len(points) - 1
    start = points[first] if last > first else middle
    step = points[last] - start
    return points[min(first, last) : last + 1], step / np.linalg.norm(step)


def _candidates(
    joints: list[list[_End]], rule: Criterion
) -> list[tuple[float, tuple[int, int], tuple[int, int]]]:
    """Smoothness of every pair of ends in a joint that turns by less than the limit."""
    found = []
    for one, other in (pair for ends in joints for pair in combinations(ends, 2)):
        cosine = np.clip(-one.outward @ other.outward, -1.0, 1.0)
        turn = float(np.degrees(np.arccos(cosine)))
        if turn <= rule.turn:
            delta = float(rule(turn, 0.5 * (one.beta + other.beta), 0.0))
            if one.value * other.value < 0.0:
                delta *= _OTHER_SIGN
            found.append((delta, (one.member, one.side), (other.member, other.side)))
    return found


def _chained(frame: Frame, partner: dict[tuple[int, int], tuple[int, int]]) -> list[MainPath]:
    """Walk from every end without a partner, then round what is closed."""
    members = frame.members
    used: set[int] = set()
    paths = []
    starts = [(n, side) for n in range(len(members)) for side in (0, 1) if (n, side) not in partner]
    for number, side in [*starts, *((n, 0) for n in range(len(members)))]:
        chain: list[Member] = []
        while number not in used:
            used.add(number)
            chain.append(members[number] if side == 0 else members[number].reversed)
            if (number, 1 - side) not in partner:
                break
            number, side = partner[number, 1 - side]
        else:
            if chain:
                paths.append(MainPath(tuple(chain), closed=True))
            continue
        closed = len(chain) == 1 and chain[0].closed
        paths.append(MainPath(tuple(chain), closed))
    return paths
