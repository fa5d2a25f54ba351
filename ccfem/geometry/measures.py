"""Areas and volumes of simplices, and which of them hang together."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ccfem.base.arrays import FloatArray, IntArray


def signed_areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Area of triangles (t, 3) of points (n, 2), (t,), mm^2; negative where clockwise."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    u, v = b - a, c - a
    return np.asarray(0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def counter_clockwise(points: FloatArray, triangles: IntArray) -> IntArray:
    """Triangles (t, 3) of points (n, 2), the clockwise ones turned over."""
    turned = triangles[:, [0, 2, 1]]
    return np.where((signed_areas(points, triangles) < 0.0)[:, None], turned, triangles)


def signed_volumes(points: FloatArray, corners: IntArray) -> FloatArray:
    """Volume of straight-sided tetrahedra (m, 4), (m,), mm^3; negative where turned inside out."""
    a, b, c, d = np.moveaxis(points[corners], 1, 0)
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def connected(pairs: IntArray, count: int) -> IntArray:
    """Label the pieces of things that are joined in pairs (k, 2): the piece of each, (count,)."""
    links = coo_array((np.ones(len(pairs), dtype=bool), pairs.T), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
