"""Triangular solves with a factor whose columns are stored by supernodes.

Consecutive columns of a sparse Cholesky factor often have the same rows. Such a supernode is a
dense block, which a solve processes without looking up rows (Davis, Direct Methods for Sparse
Linear Systems, 2006, section 4.8). With ``A = L D L^T`` only the lower factor is read, whereas
SuperLU also reads the upper one, entry by entry.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse.linalg import SuperLU

from ccfem.base.arrays import FloatArray, IntArray


class Supernodes(NamedTuple):
    """Factor ``P A P^T = L D L^T`` of a symmetric matrix (n, n).

    Attributes
    ----------
    order : (n,) int array
        Row of the factor of each unknown.
    pivots : (n,) array
        D.
    first : (s + 1,) int array
        First column of each supernode.
    starts, row_starts : (s + 1,) int arrays
        Where its block begins, and where its rows below the diagonal square block begin.
    values : array
        Blocks, column by column; in the square block only below the diagonal, which is 1.
    rows : int array
    """

    order: IntArray
    pivots: FloatArray
    first: IntArray
    starts: IntArray
    row_starts: IntArray
    values: FloatArray
    rows: IntArray

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (n,) for a right-hand side (n,)."""
        x = np.empty(len(rhs))
        x[self.order] = rhs
        _solve(self.first, self.starts, self.row_starts, self.values, self.rows, self.pivots, x)
        return x[self.order]


def supernodes(factor: SuperLU) -> Supernodes | None:
    """Factor of a symmetric matrix by supernodes; None if pivots are off the diagonal.

    Parameters
    ----------
    factor : SuperLU
        Made in symmetric mode.
    """
    if (factor.perm_r != factor.perm_c).any():
        return None
    lower = factor.L
    lower.sort_indices()
    first = _first_columns(lower.indptr, lower.indices)
    blocks = _blocks(lower.indptr, lower.indices, lower.data, first)
    order = np.asarray(factor.perm_r, dtype=np.int64)
    return Supernodes(order, factor.U.diagonal(), first, *blocks)


@njit(cache=True, nogil=True)
def _first_columns(indptr, indices):  # type: ignore[no-untyped-def]  # pragma: no cover
    """First columns of supernodes, and the number of columns."""
    n = len(indptr) - 1
    first, count = np.empty(n + 1, np.int64), 0
    for j in range(n):
        begin, size = indptr[j], indptr[j + 1] - indptr[j]
        goes_on = j > 0 and begin - indptr[j - 1] - 1 == size
        for i in range(size):
            goes_on = goes_on and indices[begin + i] == indices[begin + i - size]
        if not goes_on:
            first[count] = j
            count += 1
    first[count] = n
    return first[: count + 1].copy()


@njit(cache=True, nogil=True)
def _blocks(indptr, indices, data, first):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Return where blocks and their rows begin, values and rows."""
    count = len(first) - 1
    starts, row_starts = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    for s in range(count):
        wide, high = first[s + 1] - first[s], indptr[first[s] + 1] - indptr[first[s]]
        starts[s + 1] = starts[s] + wide * high
        row_starts[s + 1] = row_starts[s] + high - wide
    values, rows = np.zeros(starts[count]), np.empty(row_starts[count], np.int32)
    for s in range(count):
        wide, begin = first[s + 1] - first[s], indptr[first[s]]
        high = indptr[first[s] + 1] - begin
        for i in range(high - wide):
            rows[row_starts[s] + i] = indices[begin + wide + i]
        for c in range(wide):
            column = indptr[first[s] + c]
            for i in range(c, high):
                values[starts[s] + c * high + i] = data[column + i - c]
    return starts, row_starts, values, rows


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _subtract(total, column, factor):  # type: ignore[no-untyped-def]  # pragma: no cover
    for i in range(len(total)):
        total[i] -= column[i] * factor


# Four columns at a time: the vector they are added to is read and written once.
@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_four(total, a, b, c, d, factors):  # type: ignore[no-untyped-def]  # pragma: no cover
    p, q, r, s = factors[0], factors[1], factors[2], factors[3]
    for i in range(len(total)):
        total[i] += a[i] * p + b[i] * q + c[i] * r + d[i] * s


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _product(column, other):  # type: ignore[no-untyped-def]  # pragma: no cover
    total = 0.0
    for i in range(len(other)):
        total += column[i] * other[i]
    return total


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _four_products(a, b, c, d, other):  # type: ignore[no-untyped-def]  # pragma: no cover
    p, q, r, s = 0.0, 0.0, 0.0, 0.0
    for i in range(len(other)):
        p += a[i] * other[i]
        q += b[i] * other[i]
        r += c[i] * other[i]
        s += d[i] * other[i]
    return p, q, r, s


@njit(cache=True, nogil=True)
def _solve(first, starts, row_starts, values, rows, pivots, x):  # type: ignore[no-untyped-def]  # pragma: no cover
    count, room = len(first) - 1, np.empty(len(x))
    for s in range(count):
        own = x[first[s] : first[s + 1]]
        wide, below = len(own), rows[row_starts[s] : row_starts[s + 1]]
        high = wide + len(below)
        block, total = values[starts[s] : starts[s + 1]], room[: len(below)]
        for c in range(wide - 1):
            _subtract(own[c + 1 :], block[c * high + c + 1 : c * high + wide], own[c])
        for i in range(len(total)):
            total[i] = 0.0
        c = 0
        while c < wide:
            at = c * high + wide
            if c + 4 <= wide:
                _add_four(
                    total,
                    block[at : at + len(total)],
                    block[at + high : at + high + len(total)],
                    block[at + 2 * high : at + 2 * high + len(total)],
                    block[at + 3 * high : at + 3 * high + len(total)],
                    own[c : c + 4],
                )
                c += 4
            else:
                _subtract(total, block[at : at + len(total)], -own[c])
                c += 1
        for i in range(len(total)):
            x[below[i]] -= total[i]
    for i in range(len(x)):
        x[i] /= pivots[i]
    for s in range(count - 1, -1, -1):
        own = x[first[s] : first[s + 1]]
        wide, below = len(own), rows[row_starts[s] : row_starts[s + 1]]
        high = wide + len(below)
        block, other = values[starts[s] : starts[s + 1]], room[: len(below)]
        for i in range(len(other)):
            other[i] = x[below[i]]
        c = 0
        while c < wide:
            at = c * high + wide
            if c + 4 <= wide:
                p, q, r, t = _four_products(
                    block[at : at + len(other)],
                    block[at + high : at + high + len(other)],
                    block[at + 2 * high : at + 2 * high + len(other)],
                    block[at + 3 * high : at + 3 * high + len(other)],
                    other,
                )
                own[c] -= p
                own[c + 1] -= q
                own[c + 2] -= r
                own[c + 3] -= t
                c += 4
            else:
                own[c] -= _product(block[at : at + len(other)], other)
                c += 1
        for c in range(wide - 2, -1, -1):
            own[c] -= _product(block[c * high + c + 1 : c * high + wide], own[c + 1 :])
