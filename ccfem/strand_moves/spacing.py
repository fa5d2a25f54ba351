"""Strands pushed apart until they keep their distance, their place in the part and their radius.

Every sweep looks at all pairs of a point and a piece of strand that may come too near, at the walls
beside the points, and at the turns, and moves the points by what each of them asks for on average.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numba import njit
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import arc_lengths
from ccfem.geometry.shapes import Region

__all__ = ["Room", "Walls", "apart", "pairs_of", "walls_of"]

_EASED = 1.2
"""Over-relaxation."""

_OWN = 5.0
"""Arc, in widths, from which on a strand has to keep off itself."""

_REACH = 1.3
"""Distance, in widths, up to which a point and a piece may come too near in a few sweeps."""

_OFF = 0.2
"""How far outside, mm, the border is looked at from."""

_SPREAD = 2
"""Passes of the mean over neighbours that corrections go through."""


class Walls(NamedTuple):
    """What points near the border keep on one side of.

    Attributes
    ----------
    point : (w,) int array
    base, inward : (w, 2) arrays, mm and 1
        A point of the wall, and the unit vector away from it.
    """

    point: IntArray
    base: FloatArray
    inward: FloatArray


@dataclass(frozen=True)
class Room:
    """Strands that need room: their order, and what they keep.

    Attributes
    ----------
    offsets : (K + 1,) int array
    layer : (K,) int array
    closed : (K,) bool array
    held : (P,) bool array
        Points that stay.
    width : float, mm
        Distance that strands keep.
    radius : float, mm
        Of the tightest turn.
    """

    offsets: IntArray
    layer: IntArray
    closed: BoolArray
    held: BoolArray
    width: float
    radius: float


def pairs_of(points: FloatArray, room: Room) -> IntArray:
    """Points and starts of pieces (n, 2) on one layer that may come too near.

    A piece of the same strand counts from five widths of arc on, round a closed one the shorter
    way.
    """
    offsets, width = room.offsets, room.width
    path = np.repeat(np.arange(len(room.layer)), np.diff(offsets))
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    starts = np.ones(len(points), dtype=bool)
    starts[offsets[1:] - 1] = False
    reach = _REACH * width + 0.5 * float(step[starts[:-1]].max(initial=0.0))
    middle = points.copy()
    middle[:-1] = 0.5 * (points[:-1] + points[1:])
    apart = 4.0 * reach * room.layer[path][:, None]
    tree = cKDTree(np.hstack([points, apart]))
    pieces = np.flatnonzero(starts)
    found = cKDTree(np.hstack([middle, apart])[pieces]).sparse_distance_matrix(
        tree, reach, output_type="coo_matrix"
    )
    piece, point = pieces[found.row], found.col
    along = arc_lengths(points, offsets)
    gap = np.abs(along[point] - along[piece])
    whole = np.where(room.closed, along[offsets[1:] - 1], np.inf)[path[point]]
    gap = np.minimum(gap, whole - gap)
    other = (path[point] != path[piece]) | (gap > _OWN * width)
    return np.column_stack([point[other], piece[other]])


def walls_of(
    points: FloatArray, layer: IntArray, rooms: Mapping[int, Region], reach: float
) -> Walls:
    """Walls of the points (P, 2), each on a layer (P,), that lie within a reach of the border.

    Parameters
    ----------
    points, layer
        The points and the number of the layer of each.
    rooms : mapping of int to Polygon or MultiPolygon
        Where the points of each layer may be.
    reach : float, mm
    """
    number, base, inward = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2))], [np.zeros((0, 2))]
    for k, room in rooms.items():
        mine = np.flatnonzero(layer == k)
        place = shapely.points(points[mine])
        # From a little way off, also a point on the border has a way in.
        outer = shapely.buffer(room, _OFF)
        border = shapely.boundary(outer)
        shapely.prepare(outer)
        shapely.prepare(border)
        near = shapely.dwithin(border, place, reach + _OFF)
        mine, place = mine[near], place[near]
        ends = shapely.get_coordinates(shapely.shortest_line(border, place))
        start, end = ends.reshape(-1, 2, 2).transpose(1, 0, 2)
        inside = shapely.intersects(outer, place)
        way = np.where(inside[:, None], end - start, start - end)
        size = np.linalg.norm(way, axis=1)
        sure = size > 1e-9
        way = way[sure] / size[sure, None]
        number.append(mine[sure])
        base.append(start[sure] + _OFF * way)
        inward.append(way)
    return Walls(np.concatenate(number), np.concatenate(base), np.concatenate(inward))


def apart(points: FloatArray, room: Room, pairs: IntArray, walls: Walls, sweeps: int) -> FloatArray:
    """Points (P, 2) pushed apart in a number of sweeps."""
    points = points.copy()
    free = np.where(room.held, 0.0, 1.0)
    for sweep in range(sweeps):
        move, count = np.zeros_like(points), np.zeros(len(points))
        _push(points, free, pairs, room.width, move, count)
        _straighten(points, free, room.offsets, 1.0 / room.radius, move, count)
        move *= (_EASED / np.maximum(count, 1.0))[:, None]
        _drop_along(points, room.offsets, move)
        if sweep < sweeps - 2:
            _spread(move, free, room.offsets, _SPREAD)
        points += move
        gap = ((points[walls.point] - walls.base) * walls.inward).sum(axis=1)
        back = np.minimum(gap, 0.0) * free[walls.point]
        points[walls.point] -= back[:, None] * walls.inward
    return points


@njit(cache=True, nogil=True)
def _push(points, free, pairs, width, move, count):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Add what keeps each point a width from each piece, half to either."""
    for p in range(len(pairs)):
        i, j = pairs[p, 0], pairs[p, 1]
        ax, ay = points[j, 0], points[j, 1]
        dx, dy = points[j + 1, 0] - ax, points[j + 1, 1] - ay
        x, y = points[i, 0] - ax, points[i, 1] - ay
        share = (x * dx + y * dy) / max(dx * dx + dy * dy, 1e-24)
        share = min(max(share, 0.0), 1.0)
        x, y = x - share * dx, y - share * dy
        size = np.sqrt(x * x + y * y)
        if size >= width or size < 1e-9:
            continue
        one, two, three = free[i], free[j] * (1.0 - share), free[j + 1] * share
        whole = one + two * (1.0 - share) + three * share
        if whole < 1e-9:
            continue
        factor = (width - size) / (size * whole)
        move[i, 0] += one * factor * x
        move[i, 1] += one * factor * y
        count[i] += one
        move[j, 0] -= two * factor * x
        move[j, 1] -= two * factor * y
        count[j] += free[j] * (1.0 - share)
        move[j + 1, 0] -= three * factor * x
        move[j + 1, 1] -= three * factor * y
        count[j + 1] += free[j + 1] * share


@njit(cache=True, nogil=True)
def _straighten(points, free, offsets, most, move, count):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Add what keeps three points in a row from turning by more than the most, 1/mm."""
    for k in range(len(offsets) - 1):
        for i in range(offsets[k] + 1, offsets[k + 1] - 1):
            x = points[i - 1, 0] - 2.0 * points[i, 0] + points[i + 1, 0]
            y = points[i - 1, 1] - 2.0 * points[i, 1] + points[i + 1, 1]
            dx, dy = points[i + 1, 0] - points[i - 1, 0], points[i + 1, 1] - points[i - 1, 1]
            size = np.sqrt(x * x + y * y)
            limit = 0.25 * most * (dx * dx + dy * dy)
            if size <= limit:
                continue
            factor = (1.0 - limit / size) / 6.0
            for a in range(3):
                j = i - 1 + a
                weight = 2.0 * factor * free[j] if a == 1 else -factor * free[j]
                move[j, 0] += weight * x
                move[j, 1] += weight * y
                count[j] += 0.5 * free[j]


@njit(cache=True, nogil=True)
def _drop_along(points, offsets, move):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Leave of each move what lies across the strand: the points stay evenly far apart."""
    for k in range(len(offsets) - 1):
        for i in range(offsets[k], offsets[k + 1]):
            a, b = max(i - 1, offsets[k]), min(i + 1, offsets[k + 1] - 1)
            x, y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
            share = (move[i, 0] * x + move[i, 1] * y) / max(x * x + y * y, 1e-24)
            move[i, 0] -= share * x
            move[i, 1] -= share * y


@njit(cache=True, nogil=True)
def _spread(move, free, offsets, passes):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Take the mean with the neighbours, in place, some times over."""
    for _ in range(passes):
        for k in range(len(offsets) - 1):
            lastx, lasty = move[offsets[k], 0], move[offsets[k], 1]
            for i in range(offsets[k] + 1, offsets[k + 1] - 1):
                x, y = move[i, 0], move[i, 1]
                move[i, 0] = free[i] * (0.25 * (lastx + move[i + 1, 0]) + 0.5 * x)
                move[i, 1] = free[i] * (0.25 * (lasty + move[i + 1, 1]) + 0.5 * y)
                lastx, lasty = x, y
