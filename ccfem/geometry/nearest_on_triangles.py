"""The points of a triangulated surface that are nearest to other points."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.arrays import FloatArray, IntArray, seen_only

__all__ = ["Nearest", "nearest_on_triangles"]

_CANDIDATES = 40
"""Triangles whose middles are nearest are looked at."""


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

    Of the 40 triangles whose middles are nearest the nearest one counts, which is exact as long as
    no triangle is many times larger than those round it.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    queries : (q, 3) array, mm
    """
    tree = cKDTree(points[triangles].mean(axis=1))
    count = min(_CANDIDATES, len(triangles))
    _, near = tree.query(queries, k=count)
    corners = np.asarray(triangles, dtype=np.int64)
    given = (seen_only(each) for each in (points, corners, queries))
    triangle, weights = _nearest(*given, near.reshape(len(queries), count))
    found = np.einsum("qk,qkd->qd", weights, points[triangles[triangle]])
    return Nearest(triangle, weights, found, np.linalg.norm(found - queries, axis=1))


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
