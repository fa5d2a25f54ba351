"""The coarse space of smoothed aggregation, and the stiffness within it."""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity.aggregation import Aggregates

_CONTRACT = {"contract"}


class Prolongation(NamedTuple):
    """Interpolation from the motions of groups to those of their nodes.

    Attributes
    ----------
    indptr : (n + 1,) int array
    indices : (b,) int array
        Groups that move a node.
    blocks : (b, d, 6) array, single precision
        Used for both the prolongation and its transpose, so that they match exactly.
    groups : int
    """

    indptr: IntArray
    indices: IntArray
    blocks: FloatArray
    groups: int

    def restrict(self, forces: FloatArray) -> FloatArray:
        """Restrict forces (d n,) to the motions (6 c,) of the groups."""
        result = np.zeros((self.groups, 6))
        _restrict(self.indptr, self.indices, self.blocks, self._nodes(forces), result)
        return result.reshape(-1)

    def add(self, motions: FloatArray, x: FloatArray) -> None:
        """Add the nodal motions due to the groups' motions (6 c,) to x (d n,), in place."""
        nodes = self._nodes(x)
        _prolong(self.indptr, self.indices, self.blocks, motions.reshape(-1, 6), nodes)

    def _nodes(self, values: FloatArray) -> FloatArray:
        return values.reshape(-1, self.blocks.shape[1])


def smoothed(
    matrix: sp.bsr_array, inverse: FloatArray, groups: Aggregates, damping: float
) -> Prolongation:
    """Motions of groups after one damped Jacobi step: ``(I - damping D^-1 A) T``.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks, A
    inverse : (n, d, d) array
        Of the diagonal blocks, D^-1.
    groups : Aggregates
        Whose motions are T.
    damping : float
    """
    of_node, motions = groups.of_node, groups.motions
    count = len(groups.near_kernel)
    indptr, indices = _touched(matrix.indptr, matrix.indices, of_node, count)
    blocks: FloatArray = np.empty((len(indices), motions.shape[1], 6), dtype=np.float32)
    _smooth(matrix.indptr, matrix.indices, matrix.data, inverse, of_node, motions, damping,
            indptr, indices, np.zeros(count, dtype=np.int32), blocks)  # fmt: skip
    return Prolongation(indptr, indices, blocks, count)


def galerkin(matrix: sp.bsr_array, prolong: Prolongation) -> sp.bsr_array:
    """Stiffness (6 c, 6 c) of the groups: ``P^T A P``.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks
    prolong : Prolongation
    """
    own, count = (matrix.indptr, matrix.indices), prolong.groups
    indptr, indices = _met(*own, prolong.indptr, prolong.indices, count)
    data = np.zeros((len(indices), 6, 6))
    _project(*own, matrix.data, *prolong, indptr, indices, data)
    _reflect(indptr, indices, data)
    return sp.bsr_array((data, indices, indptr), shape=(6 * count, 6 * count))


@njit(cache=True)
def _restrict(indptr, indices, blocks, forces, result):  # type: ignore[no-untyped-def]
    d = blocks.shape[1]
    for i in range(indptr.size - 1):
        for s in range(indptr[i], indptr[i + 1]):
            m, y = blocks[s], result[indices[s]]
            for p in range(d):
                for c in range(6):
                    y[c] += m[p, c] * forces[i, p]


@njit(cache=True, fastmath={"contract", "reassoc"})
def _prolong(indptr, indices, blocks, motions, x):  # type: ignore[no-untyped-def]
    d = blocks.shape[1]
    for i in range(indptr.size - 1):
        for s in range(indptr[i], indptr[i + 1]):
            m, y = blocks[s], motions[indices[s]]
            for p in range(d):
                total = 0.0
                for c in range(6):
                    total += m[p, c] * y[c]
                x[i, p] += total


@njit(cache=True)
def _touched(indptr, indices, of_node, count):  # type: ignore[no-untyped-def]
    """Find the groups of the neighbours of each node."""
    n = indptr.size - 1
    seen = np.full(count, -1, np.int32)
    start, result = np.zeros(n + 1, np.int32), np.empty(indices.size, np.int32)
    place = 0
    for i in range(n):
        for s in range(indptr[i], indptr[i + 1]):
            k = of_node[indices[s]]
            if k >= 0 and seen[k] != i:
                seen[k] = i
                result[place] = k
                place += 1
        start[i + 1] = place
    return start, result[:place].copy()


@njit(cache=True, fastmath=_CONTRACT)
def _smooth(  # type: ignore[no-untyped-def]
    indptr, indices, data, inverse, of_node, motions, damping, start, column, place, blocks
):
    d, most = data.shape[1], 1
    for i in range(start.size - 1):
        most = max(most, start[i + 1] - start[i])
    sums = np.empty((most, d, 6))
    for i in range(start.size - 1):
        first = start[i]
        for s in range(first, start[i + 1]):
            place[column[s]] = s - first
            _clear(sums[s - first])
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            if of_node[j] >= 0:
                _add(data[s], motions[j], sums[place[of_node[j]]])
        for s in range(first, start[i + 1]):
            total = sums[s - first]
            for p in range(d):
                for c in range(6):
                    value = 0.0
                    for q in range(d):
                        value += inverse[i, p, q] * total[q, c]
                    value *= -damping
                    if column[s] == of_node[i]:
                        value += motions[i, p, c]
                    blocks[s, p, c] = value


@njit(cache=True)
def _clear(values):  # type: ignore[no-untyped-def]
    for p in range(values.shape[0]):
        for c in range(6):
            values[p, c] = 0.0


@njit(cache=True, fastmath=_CONTRACT)
def _add(a, b, total):  # type: ignore[no-untyped-def]
    """Add the product of a (r, d) and b (d, 6) to total (r, 6), a row at a time in registers."""
    for p in range(a.shape[0]):
        u, v, w = total[p, 0], total[p, 1], total[p, 2]
        x, y, z = total[p, 3], total[p, 4], total[p, 5]
        for q in range(a.shape[1]):
            f = a[p, q]
            u += f * b[q, 0]
            v += f * b[q, 1]
            w += f * b[q, 2]
            x += f * b[q, 3]
            y += f * b[q, 4]
            z += f * b[q, 5]
        total[p, 0], total[p, 1], total[p, 2] = u, v, w
        total[p, 3], total[p, 4], total[p, 5] = x, y, z


@njit(cache=True)
def _met(indptr, indices, start, column, count):  # type: ignore[no-untyped-def]
    """Pattern of ``P^T A P``, ascending in its rows."""
    n = indptr.size - 1
    first = np.zeros(count + 1, np.int32)
    for k in column:
        first[k + 1] += 1
    for k in range(1, count + 1):
        first[k] += first[k - 1]
    nodes, place = np.empty(column.size, np.int32), first[:-1].copy()
    for i in range(n):
        for s in range(start[i], start[i + 1]):
            nodes[place[column[s]]] = i
            place[column[s]] += 1
    seen, mark = np.full(count, -1, np.int32), np.full(n, -1, np.int32)
    result, own = np.empty(32 * count, np.int32), np.zeros(count + 1, np.int32)
    last = 0
    for k in range(count):
        if last + count > result.size:
            more = np.empty(2 * result.size + count, np.int32)
            for t in range(last):
                more[t] = result[t]
            result = more
        for e in range(first[k], first[k + 1]):
            i = nodes[e]
            for s in range(indptr[i], indptr[i + 1]):
                j = indices[s]
                if mark[j] == k:
                    continue
                mark[j] = k
                for t in range(start[j], start[j + 1]):
                    if seen[column[t]] != k:
                        seen[column[t]] = k
                        result[last] = column[t]
                        last += 1
        for t in range(own[k] + 1, last):
            value, e = result[t], t
            while e > own[k] and result[e - 1] > value:
                result[e] = result[e - 1]
                e -= 1
            result[e] = value
        own[k + 1] = last
    return own, result[:last].copy()


@njit(cache=True, fastmath=_CONTRACT)
def _project(  # type: ignore[no-untyped-def]
    indptr, indices, data, start, column, blocks, count, own, other, result
):
    """Store the blocks of ``P^T A P`` up to the diagonal."""
    most = 0
    for k in range(count):
        most = max(most, own[k + 1] - own[k])
    # All groups met by the neighbours of a node are among those met by its own groups.
    images, groups = np.empty((most, data.shape[1], 6)), np.empty(most, np.int32)
    place = np.full(count, -1, np.int32)
    for i in range(start.size - 1):
        met = 0
        if start[i] == start[i + 1]:
            continue
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            for t in range(start[j], start[j + 1]):
                k = column[t]
                if place[k] < 0:
                    place[k], groups[met] = met, k
                    _clear(images[met])
                    met += 1
                _add(data[s], blocks[t], images[place[k]])
        for t in range(start[i], start[i + 1]):
            row, left = column[t], blocks[t].T
            for e in range(met):
                k = groups[e]
                if k > row:
                    continue
                low, high = own[row], own[row + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if other[middle] < k:
                        low = middle + 1
                    else:
                        high = middle
                _add(left, images[e], result[low])
        for e in range(met):
            place[groups[e]] = -1


@njit(cache=True)
def _reflect(own, other, result):  # type: ignore[no-untyped-def]
    """Copy what is below the diagonal to above it."""
    place = np.empty(own.size - 1, np.int32)
    for i in range(own.size - 1):
        for s in range(own[i], own[i + 1]):
            j = other[s]
            if j == i:
                place[i] = s + 1
                break
            # Rows come in order, and so do the columns of row j beyond its diagonal.
            target = result[place[j]]
            for p in range(6):
                for c in range(6):
                    target[c, p] = result[s, p, c]
            place[j] += 1
