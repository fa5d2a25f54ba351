"""The points of a triangulated surface that are nearest to other points."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.arrays import FloatArray, IntArray

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
    triangle, weights = _nearest(points, triangles, queries, near.reshape(len(queries), count))
    found = np.einsum("qk,qkd->qd", weights, points[triangles[triangle]])
    return Nearest(triangle, weights, found, np.linalg.norm(found - queries, axis=1))


@njit(cache=True, nogil=True)
def _nearest(points, triangles, queries, near):  # type: ignore[no-untyped-def]
    """Ericson, Real-Time Collision Detection (2005), section 5.1.5."""
    triangle = np.empty(len(queries), np.int64)
    weights = np.empty((len(queries), 3))
    w = np.empty(3)
    for q in range(len(queries)):
        best = np.inf
        p = queries[q]
        for t in near[q]:
            a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
            ab, ac, ap = b - a, c - a, p - a
            d1, d2 = (ab * ap).sum(), (ac * ap).sum()
            bp, cp = p - b, p - c
            d3, d4 = (ab * bp).sum(), (ac * bp).sum()
            d5, d6 = (ab * cp).sum(), (ac * cp).sum()
            va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
            if d1 <= 0.0 and d2 <= 0.0:
                w[0], w[1], w[2] = 1.0, 0.0, 0.0
            elif d3 >= 0.0 and d4 <= d3:
                w[0], w[1], w[2] = 0.0, 1.0, 0.0
            elif d6 >= 0.0 and d5 <= d6:
                w[0], w[1], w[2] = 0.0, 0.0, 1.0
            elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
                s = d1 / (d1 - d3)
                w[0], w[1], w[2] = 1.0 - s, s, 0.0
            elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
                s = d2 / (d2 - d6)
                w[0], w[1], w[2] = 1.0 - s, 0.0, s
            elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                w[0], w[1], w[2] = 0.0, 1.0 - s, s
            else:
                total = va + vb + vc
                if total <= 0.0:
                    continue
                w[1], w[2] = vb / total, vc / total
                w[0] = 1.0 - w[1] - w[2]
            away = a * w[0] + b * w[1] + c * w[2] - p
            square = (away * away).sum()
            if square < best:
                best = square
                triangle[q] = t
                weights[q] = w
        if best == np.inf:
            triangle[q] = near[q, 0]
            weights[q] = 1.0 / 3.0
    return triangle, weights
