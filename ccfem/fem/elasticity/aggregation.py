"""Aggregates of nodes, and the rigid motions of each: the coarse space of smoothed aggregation.

Vanek, Mandel and Brezina, Computing 56 (1996) 179-196, section 5.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray

_DEPENDENT = 1e-10
"""Relative length below which an orthogonalised motion counts as dependent on those before it."""


class Aggregates(NamedTuple):
    """Groups of nodes that move as rigid bodies.

    Attributes
    ----------
    of_node : (n,) int array
        Group of each node; -1 for a node with no strong connection.
    motions : (n, d, 6) array
        Motions of each node as part of its group, orthonormal over the group; zero where a group is
        too small, or too straight, for all six.
    near_kernel : (c, 6, 6) array
        The given motions, expressed by those of each group.
    """

    of_node: IntArray
    motions: FloatArray
    near_kernel: FloatArray


def aggregates(matrix: sp.bsr_array, near_kernel: FloatArray, strength: float) -> Aggregates:
    """Group the nodes of a matrix.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks
    near_kernel : (n, d, 6) array
        Motions of little energy.
    strength : float
        Size of a block, over the geometric mean of the sizes of its diagonal blocks, above which it
        is a strong connection.
    """
    start, column = _strong(matrix.indptr, matrix.indices, matrix.data, strength)
    of_node, count = _grouped(start, column)
    motions = np.zeros(near_kernel.shape)
    coarse = np.zeros((count, 6, 6))
    _orthonormal(of_node, near_kernel, motions, coarse)
    return Aggregates(of_node, motions, coarse)


@njit(cache=True)
def _strong(indptr, indices, data, strength):  # type: ignore[no-untyped-def]
    """Strong connections of each node with others."""
    n, d = indptr.size - 1, data.shape[1]
    size, own = np.empty(indices.size), np.zeros(n)
    for i in range(n):
        for s in range(indptr[i], indptr[i + 1]):
            total = 0.0
            for p in range(d):
                for q in range(d):
                    total += data[s, p, q] * data[s, p, q]
            size[s] = total
            if indices[s] == i:
                own[i] = total
    start, column = np.zeros(n + 1, np.int32), np.empty(indices.size, np.int32)
    place = 0
    for i in range(n):
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            if j != i and size[s] * size[s] >= strength**4 * own[i] * own[j] and size[s] > 0.0:
                column[place] = j
                place += 1
        start[i + 1] = place
    return start, column[:place].copy()


@njit(cache=True)
def _grouped(start, column):  # type: ignore[no-untyped-def]
    """Group of each node, and their number."""
    n, count = start.size - 1, 0
    result = np.full(n, -1, np.int32)
    # First, nodes with all their neighbours, if none of them belongs to a group yet.
    for i in range(n):
        alone = result[i] < 0 and start[i + 1] > start[i]
        for s in range(start[i], start[i + 1]):
            alone = alone and result[column[s]] < 0
        if alone:
            result[i] = count
            for s in range(start[i], start[i + 1]):
                result[column[s]] = count
            count += 1
    # The others join a group beside them,
    joined = result.copy()
    for i in range(n):
        if result[i] < 0:
            for s in range(start[i], start[i + 1]):
                if result[column[s]] >= 0:
                    joined[i] = result[column[s]]
                    break
    # and the remaining nodes form groups of their own.
    for i in range(n):
        if joined[i] < 0 and start[i + 1] > start[i]:
            joined[i] = count
            for s in range(start[i], start[i + 1]):
                if joined[column[s]] < 0:
                    joined[column[s]] = count
            count += 1
    return joined, count


@njit(cache=True)
def _orthonormal(of_node, near_kernel, motions, coarse):  # type: ignore[no-untyped-def]
    """Factorise the near kernel of each group into orthonormal columns and a 6x6 triangle.

    By the modified method of Gram and Schmidt, twice.
    """
    n, d, count = near_kernel.shape[0], near_kernel.shape[1], len(coarse)
    start = np.zeros(count + 1, np.int32)
    for i in range(n):
        if of_node[i] >= 0:
            start[of_node[i] + 1] += 1
    for k in range(1, start.size):
        start[k] += start[k - 1]
    member, place = np.empty(start[count], np.int32), start.copy()
    for i in range(n):
        k = of_node[i]
        if k >= 0:
            member[place[k]] = i
            place[k] += 1
            for p in range(d):
                for c in range(6):
                    motions[i, p, c] = near_kernel[i, p, c]
    for k in range(count):
        first, last = start[k], start[k + 1]
        for c in range(6):
            before = _product(motions, member, first, last, c, c)
            for _ in range(2):
                for b in range(c):
                    along = _product(motions, member, first, last, b, c)
                    coarse[k, b, c] += along
                    for e in range(first, last):
                        for p in range(d):
                            motions[member[e], p, c] -= along * motions[member[e], p, b]
            after = _product(motions, member, first, last, c, c)
            length = np.sqrt(after) if after > _DEPENDENT**2 * before else 0.0
            coarse[k, c, c] = length
            for e in range(first, last):
                for p in range(d):
                    motions[member[e], p, c] *= 1.0 / length if length > 0.0 else 0.0


@njit(cache=True)
def _product(motions, member, first, last, b, c):  # type: ignore[no-untyped-def]
    """Inner product of two columns over a group."""
    total = 0.0
    for e in range(first, last):
        for p in range(motions.shape[1]):
            total += motions[member[e], p, b] * motions[member[e], p, c]
    return total
