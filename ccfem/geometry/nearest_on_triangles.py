"""Nearest points on a triangulated surface."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray, seen_only

_FIRST = (40,)
_ROUNDS = (1, *(8 * 4**k for k in range(14)))
"""Numbers of triangles that are checked: of all sizes first, then of one size after another."""
_EXACT = 0.01
"""Share of the distance by which another triangle may be nearer."""
_AT_ONCE = 4_000_000
"""Number of pairs of a query and a triangle that are processed at a time."""


@dataclass(frozen=True)
class Nearest:
    """Points of a surface that are nearest to others.

    Attributes
    ----------
    triangle : (q,) int array
    weights : (q, 3) array
        Barycentric coordinates in it, in [0, 1].
    points : (q, 3) array, mm
    distance : (q,) array, mm
    """

    triangle: IntArray
    weights: FloatArray
    points: FloatArray
    distance: FloatArray


def nearest_on_triangles(points: FloatArray, triangles: IntArray, queries: FloatArray) -> Nearest:
    """Find the points of a surface that are nearest to given ones.

    Triangles may be of any size. Points of the surface are found exactly. If the distances of two
    triangles from a query differ by less than 1 %, either may be returned.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    queries : (q, 3) array, mm
    """
    middles = points[triangles].mean(axis=1)
    reach = np.linalg.norm(points[triangles] - middles[:, None], axis=2).max(axis=1)
    nearest = Nearest(
        np.zeros(len(queries), dtype=np.int64),
        np.zeros((len(queries), 3)),
        np.zeros((len(queries), 3)),
        np.full(len(queries), np.inf),
    )
    surface = _Surface(np.asarray(points), np.asarray(triangles, dtype=np.int64), middles, reach)
    left = _look(
        surface, np.arange(len(triangles)), queries, np.arange(len(queries)), _FIRST, nearest
    )
    if len(left):
        size = np.frexp(reach)[1]
        for each in np.unique(size)[::-1]:  # the largest first: they are few and reach far
            _look(surface, np.flatnonzero(size == each), queries, left, _ROUNDS, nearest)
    return nearest


@dataclass(frozen=True)
class _Surface:
    """A triangulated surface, and the extent of its triangles from their middles, mm."""

    points: FloatArray
    triangles: IntArray
    middles: FloatArray
    reach: FloatArray


def _look(
    surface: _Surface,
    members: IntArray,
    queries: FloatArray,
    rows: IntArray,
    rounds: tuple[int, ...],
    nearest: Nearest,
) -> IntArray:
    """Check some triangles for some queries; return those whose nearest one is not yet certain.

    `nearest` is updated where a triangle is nearer. Each round checks a number of triangles whose
    middles are nearest.
    """
    tree = cKDTree(surface.middles[members])
    reach = float(surface.reach[members].max())
    for most in rounds:
        count = min(most, len(members))
        unsure = []
        for part in np.array_split(rows, 1 + len(rows) * count // _AT_ONCE):
            away, near = tree.query(queries[part], k=count)
            away, near = away.reshape(len(part), count), near.reshape(len(part), count)
            _take_nearer(surface, members[near], queries, part, nearest)
            sure = away[:, -1] - reach >= (1.0 - _EXACT) * nearest.distance[part]
            unsure.append(part[~sure])
        rows = np.concatenate(unsure)
        if count == len(members) or not len(rows):
            return rows[:0]
    return rows


def _take_nearer(
    surface: _Surface, near: IntArray, queries: FloatArray, rows: IntArray, nearest: Nearest
) -> None:
    """Put the nearest of the triangles (r, k) into `nearest` where it is nearer."""
    given = (seen_only(each) for each in (surface.points, surface.triangles, queries[rows]))
    triangle, weights = _nearest(*given, near)
    feet = np.einsum("qk,qkd->qd", weights, surface.points[surface.triangles[triangle]])
    distance = np.linalg.norm(feet - queries[rows], axis=1)
    better = distance < nearest.distance[rows]
    to = rows[better]
    nearest.triangle[to], nearest.weights[to] = triangle[better], weights[better]
    nearest.points[to], nearest.distance[to] = feet[better], distance[better]


@njit(cache=True, nogil=True)
def _nearest(points, triangles, queries, near):  # type: ignore[no-untyped-def]
    """Ericson, Real-Time Collision Detection (2005), section 5.1.5."""
    triangle = np.empty(len(queries), np.int64)
    weights = np.empty((len(queries), 3))
    for q in range(len(queries)):
        best = np.inf
        for k in range(near.shape[1]):
            t = near[q, k]
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(3):
                ab, ac = points[b, i] - points[a, i], points[c, i] - points[a, i]
                d1 += ab * (queries[q, i] - points[a, i])
                d2 += ac * (queries[q, i] - points[a, i])
                d3 += ab * (queries[q, i] - points[b, i])
                d4 += ac * (queries[q, i] - points[b, i])
                d5 += ab * (queries[q, i] - points[c, i])
                d6 += ac * (queries[q, i] - points[c, i])
            va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
            w1, w2 = 0.0, 0.0
            if d1 <= 0.0 and d2 <= 0.0:
                pass
            elif d3 >= 0.0 and d4 <= d3:
                w1 = 1.0
            elif d6 >= 0.0 and d5 <= d6:
                w2 = 1.0
            elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
                w1 = d1 / (d1 - d3)
            elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
                w2 = d2 / (d2 - d6)
            elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                w2 = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                w1 = 1.0 - w2
            else:
                total = va + vb + vc
                if total <= 0.0:
                    continue
                w1, w2 = vb / total, vc / total
            w0 = 1.0 - w1 - w2
            square = 0.0
            for i in range(3):
                away = w0 * points[a, i] + w1 * points[b, i] + w2 * points[c, i] - queries[q, i]
                square += away * away
            if square < best:
                best = square
                triangle[q] = t
                weights[q, 0], weights[q, 1], weights[q, 2] = w0, w1, w2
        if best == np.inf:
            triangle[q] = near[q, 0]
            for i in range(3):
                weights[q, i] = 1.0 / 3.0
    return triangle, weights
