"""Find the triangle or tetrahedron that holds a point, with a uniform grid of buckets."""

from functools import reduce

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.buckets import Buckets, bucket


def locate(
    points: FloatArray, simplices: IntArray, queries: FloatArray, reach: float = 0.0
) -> tuple[IntArray, FloatArray]:
    """Triangle of the plane, or tetrahedron in space, that holds each query point.

    Parameters
    ----------
    points : (n, d) array, mm
        In d = 2 or 3 dimensions.
    simplices : (m, d + 1) int array
        Of either orientation; flat ones are never found.
    queries : (q, d) array, mm
    reach : float, mm, default 0
        A query outside every simplex takes the one whose sides it exceeds least, by at most this.

    Returns
    -------
    simplex : (q,) int array
        Index into `simplices`, or -1.
    barycentric : (q, d + 1) array in [0, 1]
        Weights of the corners, summing to 1; for a query outside, those of a point of the simplex
        close to it; 0 where `simplex` is -1.
    """
    queries = np.ascontiguousarray(queries, dtype=np.float64)
    triangle = np.full(len(queries), -1, dtype=np.int64)
    weights = np.zeros((len(queries), simplices.shape[1]))
    if not len(queries) or not len(simplices):
        return triangle, weights
    corners = points[simplices]
    origins, gradients, heights = _barycentric_maps(corners)
    by_corner = np.moveaxis(corners, 1, 0)
    low, high = reduce(np.minimum, by_corner), reduce(np.maximum, by_corner)
    # First without reach, which needs the fewest candidates; then only what was not found.
    for margin in (0.0, reach) if reach > 0.0 else (0.0,):
        left = np.flatnonzero(triangle < 0)
        if not len(left):
            break
        slack = margin + 1e-9 * float(np.abs(corners).max())
        grid = bucket(low - slack, high + slack)
        index, weight = _search(grid, origins, gradients, heights, queries[left], slack)
        weight = np.maximum(weight, 0.0)
        total = weight.sum(axis=1, keepdims=True)
        triangle[left], weights[left] = index, weight / np.where(total > 0.0, total, 1.0)
    return triangle, weights


def _barycentric_maps(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First corner, gradients of the barycentric coordinates and heights of each simplex.

    Flat simplices get zero gradients and heights, so that no point is ever inside them.
    """
    edges = corners[:, 1:] - corners[:, :1]
    size = np.abs(np.linalg.det(edges))
    scale = np.einsum("tij,tij->t", edges, edges) ** (0.5 * edges.shape[1])
    flat = size <= 1e-14 * scale
    edges = np.where(flat[:, None, None], np.eye(edges.shape[1]), edges)
    inverse = np.swapaxes(np.linalg.inv(edges), 1, 2)
    gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    gradients[flat] = 0.0
    norm = np.sqrt(np.einsum("tij,tij->ti", gradients, gradients))
    heights = np.divide(1.0, norm, out=np.zeros_like(norm), where=norm > 0.0)
    return np.ascontiguousarray(corners[:, 0]), gradients, heights


@njit(cache=True, nogil=True)
def _search(
    grid: Buckets,
    origins: FloatArray,
    gradients: FloatArray,
    heights: FloatArray,
    queries: FloatArray,
    slack: float,
) -> tuple[IntArray, FloatArray]:
    """Simplex of each query: the first that holds it, else the least overstepped within slack."""
    count, dimension = queries.shape
    triangle = np.full(count, -1, np.int64)
    weights = np.zeros((count, dimension + 1))
    weight = np.empty(dimension + 1)
    for q in range(count):
        # Bucket that the query lies in.
        c = 0
        outside = False
        for d in range(3):
            i = 0
            if d < dimension:
                i = int(np.floor((queries[q, d] - grid.origin[d]) / grid.cell))
            outside = outside or i < 0 or i >= grid.shape[d]
            c = c * grid.shape[d] + i
        if outside:
            continue
        best = -slack
        for item in range(grid.starts[c], grid.starts[c + 1]):
            k = grid.items[item]
            if heights[k, 0] == 0.0:
                continue
            # Depth inside: the least barycentric coordinate times the height over that side, in mm.
            depth = np.inf
            rest = 1.0
            for corner in range(1, dimension + 1):
                value = 0.0
                for d in range(dimension):
                    value += gradients[k, corner, d] * (queries[q, d] - origins[k, d])
                weight[corner] = value
                rest -= value
                depth = min(depth, value * heights[k, corner])
            weight[0] = rest
            depth = min(depth, rest * heights[k, 0])
            if depth >= best:
                best = depth
                triangle[q] = k
                for corner in range(dimension + 1):
                    weights[q, corner] = weight[corner]
                if depth >= 0.0:
                    break
    return triangle, weights
