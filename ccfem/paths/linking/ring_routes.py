"""Links that lead round a part, along a ring outside it."""

from typing import NamedTuple

import numpy as np
import shapely
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.dubins import WORDS, curve_points, word_sizes
from ccfem.geometry.polylines import between, resample
from ccfem.geometry.section_grid import SectionGrid
from ccfem.geometry.shapes import Region, Shapes
from ccfem.paths.linking.link_curves import curve_cost

_DISTANCE = 5.0
"""Distance, mm, from the ring to the part; at least the radius."""
_LEADS = (5.0, 10.0, 16.0)
"""How far ahead on the ring, mm, a lead may end; more if turns are wide."""

_NEAR = 0.01
"""Half the length, mm, of the chord taken as a tangent of the ring."""


class RingRoutes(NamedTuple):
    """A ring round a part, and leads from ends to it.

    Attributes
    ----------
    ring : (n, 2) array, mm
        Closed; anticlockwise.
    length : float, mm
    starts : (t, 3) array
        Poses at which leads begin.
    goal : (t, 2, v, 3) array
        Poses on the ring at which they end: anticlockwise, then clockwise.
    position : (t, 2, v) array, mm
        Arc length on the ring of these poses.
    cost : (t, 2, v) array, mm
        Of the leads.
    word : (t, 2, v) int array
    radius : float, mm
    """

    ring: FloatArray
    length: float
    starts: FloatArray
    goal: FloatArray
    position: FloatArray
    cost: FloatArray
    word: IntArray
    radius: float


def ring_routes(
    starts: FloatArray, section: Region, radius: float, grid: SectionGrid, weights: FloatArray
) -> RingRoutes:
    """Ring round a part, and the cheapest leads to it.

    Parameters
    ----------
    starts : (t, 3) array
        Poses heading out of strands.
    section : shapely (Multi)Polygon, mm
    radius : float, mm
    grid : SectionGrid
    weights : (3,) array
        Extra cost of each mm inside the part, over its voids, and outside.
    """
    ring = _ring(section, max(_DISTANCE, radius))
    line = shapely.LineString(ring)
    length = float(line.length)
    ahead = np.array(_LEADS) * max(1.0, 0.5 * radius)
    foot = shapely.line_locate_point(line, shapely.points(starts[:, :2]))
    sense = np.array([1.0, -1.0])
    position = (foot[:, None, None] + sense[:, None] * ahead) % length
    flat = position.ravel()
    here, before, after = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, (flat + d) % length))
        for d in (0.0, -_NEAR, _NEAR)
    )
    way = (after - before).reshape(*position.shape, 2) * sense[:, None, None]
    goal = np.concatenate(
        [here.reshape(*position.shape, 2), np.arctan2(way[..., 1:], way[..., :1])], axis=-1
    )
    cost, word = _leads(starts, goal, radius, grid, weights)
    return RingRoutes(ring, length, starts, goal, position, cost, word, radius)


def _ring(section: Region, distance: float) -> FloatArray:
    """Lay a closed curve (n, 2) round a section at a distance; round the hull of several parts."""
    for filled in (shapely.union_all(_filled(section)), shapely.convex_hull(section)):
        grown = shapely.union_all(_filled(shapely.buffer(filled, 2.0 * distance)))
        outline = shapely.buffer(grown, -distance, quad_segs=32)
        if outline.geom_type == "Polygon":
            break
    ring = shapely.get_coordinates(shapely.get_exterior_ring(shapely.normalize(outline)))
    return ring if shapely.is_ccw(shapely.linearrings(ring)) else ring[::-1]


def _filled(section: Region) -> Shapes:
    return shapely.polygons(shapely.get_exterior_ring(shapely.get_parts(section)))


@njit(cache=True, nogil=True)
def _leads(starts, goal, radius, grid, weights):  # type: ignore[no-untyped-def]
    count, _, variants, _ = goal.shape
    cost = np.full(goal.shape[:3], np.inf)
    word = np.zeros(goal.shape[:3], np.int64)
    sizes = np.empty((6, 3))
    for a in range(count):
        for side in range(2):
            for v in range(variants):
                word_sizes(starts[a], goal[a, side, v], radius, sizes)
                for k in range(6):
                    found = curve_cost(
                        starts[a], WORDS[k], sizes[k], radius, grid, weights, cost[a, side, v]
                    )
                    if found < cost[a, side, v]:
                        cost[a, side, v] = found
                        word[a, side, v] = k
    return cost, word


@njit(cache=True, nogil=True)
def ring_cost(routes: RingRoutes) -> tuple[FloatArray, IntArray]:
    """Cost of the way along the ring between each two ends, and an index of that way.

    Returns
    -------
    cost : (t, t) array, mm
        Symmetric.
    way : (t, t) int array
        Sense and leads, encoded as a number that `ring_curve` reads.
    """
    position, lead, length = routes.position, routes.cost, routes.length
    count, _, variants = position.shape
    cost = np.full((count, count), np.inf)
    way = np.zeros((count, count), np.int64)
    for a in range(count):
        for b in range(count):
            for side in range(2):
                sense = 1.0 - 2.0 * side
                for v in range(variants):
                    for w in range(variants):
                        along = sense * (position[b, 1 - side, w] - position[a, side, v])
                        along -= length * np.floor(along / length)
                        found = lead[a, side, v] + along + lead[b, 1 - side, w]
                        if found < cost[a, b] - 1e-9:
                            cost[a, b] = found
                            way[a, b] = (side * variants + v) * variants + w
    return cost, way


def ring_curve(routes: RingRoutes, a: int, b: int, way: int, step: float) -> FloatArray:
    """Points (n, 2), mm, of the way from start a along the ring to start b."""
    variants = routes.position.shape[2]
    side, v, w = way // variants**2, way // variants % variants, way % variants
    out = _lead(routes, a, side, v, step)
    back = _lead(routes, b, 1 - side, w, step)[::-1]
    s, t = routes.position[a, side, v], routes.position[b, 1 - side, w]
    if side:
        s, t = t, s
    if t < s:
        t += routes.length
    twice = np.concatenate([routes.ring, routes.ring[1:]])
    arc = between(twice, float(s), float(t))
    arc, _ = resample(arc, np.array([0, len(arc)]), step)
    return np.concatenate([out, (arc[::-1] if side else arc)[1:-1], back])


def _lead(routes: RingRoutes, a: int, side: int, v: int, step: float) -> FloatArray:
    start, goal = routes.starts[a], routes.goal[a, side, v]
    sizes = np.empty((6, 3))
    word_sizes(start, goal, routes.radius, sizes)
    word = int(routes.word[a, side, v])
    turns = WORDS[word] * np.where(sizes[word] < 0.0, -1, 1)
    return curve_points(start, goal, turns, np.abs(sizes[word]), routes.radius, step)
