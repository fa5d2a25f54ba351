"""Links between the ends of strands: curves of a least radius, cheapest outside the part.

Every strand is extended straight beyond its ends; the link is a Dubins curve from one extended end
to the other. The cheapest of several extensions and all words is taken. The cost is the length,
plus extra for lengths inside the part or over its voids.
"""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.dubins import WORDS, advance, curve_points, word_sizes
from ccfem.geometry.section_grid import SectionGrid, place, place_and_room

_SAMPLE = 0.25
"""Step, mm, at which a curve is sampled close to the border."""
_STRAIGHT = np.zeros(3, dtype=np.int64)
"""Word of a straight line, constant like `WORDS` so that numba compiles one signature."""
_NEAR = 15.0
"""Distance, in radii and longest extensions, beyond which only the first extension is tried: others
change little on a long way."""


class LinkCurves(NamedTuple):
    """The cheapest curve between each two ends.

    Attributes
    ----------
    cost : (t, t) array, mm
        Symmetric; inf between the two ends of one strand, and where no curve is below the bound.
    reach : (t, t) array, mm
        Straight extension at the first end; that at the second is ``reach[b, a]``.
    word : (t, t) int array
        Word from the end with the smaller number to the other.
    """

    cost: FloatArray
    reach: FloatArray
    word: IntArray


def link_curves(
    ends: FloatArray,
    reach: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    bound: FloatArray,
) -> LinkCurves:
    """Cheapest curves between all ends.

    Parameters
    ----------
    ends : (t, 3) array
        Poses at the ends of strands, heading out of the strand; 2k and 2k + 1 belong to strand k.
    reach : (t, v) array, mm
        Extensions to choose from; the first is the usual one.
    radius : float, mm
    weights : (3,) array
        Extra cost of each mm inside the part, over its voids, and outside.
    bound : (t, t) array, mm
        Cost of the link by other means: more expensive curves are not searched for.
    """
    return LinkCurves(*_link_curves(ends, reach, radius, grid, weights, bound))


def link_curve(
    ends: FloatArray, a: int, b: int, curves: LinkCurves, radius: float, step: float
) -> FloatArray:
    """Points (n, 2), mm, of the link from end a to end b, including both ends."""
    if a > b:
        return link_curve(ends, b, a, curves, radius, step)[::-1]
    first, second = curves.reach[a, b], curves.reach[b, a]
    start, end = _extended(ends[a], first), _reversed(_extended(ends[b], second))
    sizes = np.empty((6, 3))
    word_sizes(start, end, radius, sizes)
    word = int(curves.word[a, b])
    turns = WORDS[word] * np.where(sizes[word] < 0.0, -1, 1)
    curve = curve_points(start, end, turns, np.abs(sizes[word]), radius, step)
    before, after = stub_points(ends[a], first, step), stub_points(ends[b], second, step)[::-1]
    return np.concatenate([before, curve, after])


def stub_points(end: FloatArray, reach: float, step: float) -> FloatArray:
    """Points (n, 2), mm, from an end along its straight extension, without the last one."""
    parts = max(1, int(np.ceil(reach / step))) if reach > 0.0 else 0
    at = reach * np.arange(parts)[:, None] / max(parts, 1)
    return end[:2] + at * [np.cos(end[2]), np.sin(end[2])]


@compiled
def _extended(end: FloatArray, reach: float) -> FloatArray:
    pose = end.copy()
    pose[0] += reach * np.cos(end[2])
    pose[1] += reach * np.sin(end[2])
    return pose


@compiled
def _reversed(pose: FloatArray) -> FloatArray:
    back = pose.copy()
    back[2] += np.pi
    return back


@compiled
def curve_cost(
    start: FloatArray,
    turns: IntArray,
    sizes: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    limit: float,
) -> float:
    """Length of a curve plus `weights` times its length in each place; inf above the limit."""
    cost = abs(sizes[0]) + abs(sizes[1]) + abs(sizes[2])
    x, y, heading = start[0], start[1], start[2]
    for piece in range(3):
        turn, size = turns[piece], sizes[piece]
        total, done = abs(size), 0.0
        sense = 1.0 if size >= 0.0 else -1.0
        while done < total:
            if cost >= limit:
                return np.inf
            px, py, _ = advance(x, y, heading, turn, sense * done, radius)
            # A circle free of border: the place is the same for as long as the curve stays in it.
            where, room = place_and_room(grid, px, py)
            move = min(max(room, _SAMPLE), total - done)
            if room < move:
                middle = sense * (done + 0.5 * move)
                px, py, _ = advance(x, y, heading, turn, middle, radius)
                where = place(grid, px, py)
            cost += weights[where] * move
            done += move
        x, y, heading = advance(x, y, heading, turn, size, radius)
    return cost if cost < limit else np.inf


@compiled
def _link_curves(
    ends: FloatArray,
    reach: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    bound: FloatArray,
) -> tuple[FloatArray, FloatArray, IntArray]:
    count, variants = reach.shape
    cost = np.full((count, count), np.inf)
    chosen = np.zeros((count, count))
    word = np.zeros((count, count), np.int64)
    sizes, straight = np.empty((6, 3)), np.zeros(3)
    stub = np.empty(reach.shape)
    # Straight extensions of the ends, which curves begin after.
    for a in range(count):
        for v in range(variants):
            straight[1] = reach[a, v]
            stub[a, v] = curve_cost(ends[a], _STRAIGHT, straight, radius, grid, weights, np.inf)
    for a in range(count):
        for b in range(a + 1, count):
            if a // 2 == b // 2:
                continue
            apart = np.hypot(ends[a, 0] - ends[b, 0], ends[a, 1] - ends[b, 1])
            best = limit = min(bound[a, b], bound[b, a])
            for variant in range(variants * variants):
                v, w = variant // variants, variant % variants
                # Far apart, longer extensions change little.
                if variant and apart > _NEAR * radius + reach[a, v] + reach[b, w]:
                    continue
                start = _extended(ends[a], reach[a, v])
                end = _reversed(_extended(ends[b], reach[b, w]))
                word_sizes(start, end, radius, sizes)
                stubs = stub[a, v] + stub[b, w]
                for k in range(6):
                    length = abs(sizes[k, 0]) + abs(sizes[k, 1]) + abs(sizes[k, 2])
                    if stubs + length >= best:
                        continue
                    total = stubs + curve_cost(
                        start, WORDS[k], sizes[k], radius, grid, weights, best - stubs
                    )
                    if total < best - 1e-9:
                        best = total
                        chosen[a, b], chosen[b, a] = reach[a, v], reach[b, w]
                        word[a, b] = k
            if best < limit:
                cost[a, b] = cost[b, a] = best
    return cost, chosen, word
