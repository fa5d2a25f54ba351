"""Cholesky factorisation within the skyline of a matrix: fast where its band is narrow.

It is one compiled loop without a library, so its time does not depend on threads. On a raster of h
rows of cells it does about ``(2 h)^2`` operations an unknown.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import SolveError
from ccfem.body.mesh.numbering import reverse_cuthill_mckee

_TOGETHER = 4
"""Rows that are eliminated together, two columns at a time; they share their first column."""


@njit(cache=True, fastmath=True)
def _tile(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, x: FloatArray, y: FloatArray, n: int
) -> tuple[float, ...]:
    """Products of four rows with two, over their first n entries."""
    p = q = r = s = t = u = v = w = 0.0
    for k in range(n):
        e, f = x[k], y[k]
        p += a[k] * e
        q += b[k] * e
        r += c[k] * e
        s += d[k] * e
        t += a[k] * f
        u += b[k] * f
        v += c[k] * f
        w += d[k] * f
    return p, q, r, s, t, u, v, w


@njit(cache=True, fastmath=True)
def _factorise(first: IntArray, start: IntArray, values: FloatArray) -> int:
    """Factorise in place; return the first row without a positive pivot, or -1.

    Row i lies at ``values[start[i] + j]``, ``first[i] <= j <= i``. Its diagonal entry becomes the
    inverse of the factor's. Slices spare the compiler the check for negative indices, which would
    keep it from vectorising.
    """
    # L[i, j] = (A[i, j] - sum_k L[i, k] L[j, k]) / L[j, j], in tiles of four rows and two columns.
    for i in range(0, first.size, 4):
        low = first[i]
        a = values[start[i] + low : start[i] + i]
        b = values[start[i + 1] + low : start[i + 1] + i]
        c = values[start[i + 2] + low : start[i + 2] + i]
        d = values[start[i + 3] + low : start[i + 3] + i]
        for j in range(low, i, 2):
            begin = max(low, first[j])
            n, m, k = j - begin, begin - low, j - low
            x = values[start[j] + begin : start[j] + j + 1]
            y = values[start[j + 1] + begin : start[j + 1] + j + 2]
            p, q, r, s, t, u, v, w = _tile(a[m:], b[m:], c[m:], d[m:], x, y, n)
            # The second column of a tile needs the first one, which has just been found.
            e, f, g = x[n], y[n], y[n + 1]
            a[k] = (a[k] - p) * e
            b[k] = (b[k] - q) * e
            c[k] = (c[k] - r) * e
            d[k] = (d[k] - s) * e
            a[k + 1] = (a[k + 1] - t - a[k] * f) * g
            b[k + 1] = (b[k + 1] - u - b[k] * f) * g
            c[k + 1] = (c[k + 1] - v - c[k] * f) * g
            d[k + 1] = (d[k + 1] - w - d[k] * f) * g
        # The triangle of the four rows themselves, entry by entry.
        for row in range(i, i + 4):
            for j in range(i, row + 1):
                x = values[start[row] + low : start[row] + j + 1]
                y = values[start[j] + low : start[j] + j + 1]
                p, n = 0.0, j - low
                for k in range(n):
                    p += x[k] * y[k]
                if j < row:
                    x[n] = (x[n] - p) * y[n]
                else:
                    pivot = x[n] - p
                    if not pivot > 1e-14 * abs(x[n]):
                        return row
                    x[n] = 1.0 / np.sqrt(pivot)
    return -1


@njit(cache=True, fastmath=True)
def _substitute(first: IntArray, start: IntArray, values: FloatArray, x: FloatArray) -> None:
    """Solve in place with the factor of `_factorise`."""
    for i in range(first.size):
        row = values[start[i] + first[i] : start[i] + i + 1]
        known = x[first[i] : i + 1]
        n, p = i - first[i], 0.0
        for k in range(n):
            p += row[k] * known[k]
        known[n] = (known[n] - p) * row[n]
    for i in range(first.size - 1, -1, -1):
        row = values[start[i] + first[i] : start[i] + i + 1]
        left = x[first[i] : i + 1]
        n = i - first[i]
        left[n] *= row[n]
        y = left[n]
        for k in range(n):
            left[k] -= row[k] * y


@njit(cache=True)
def _fill_profile(
    indptr: IntArray,
    indices: IntArray,
    place: IntArray,
    start: IntArray,
    data: FloatArray,
    values: FloatArray,
) -> None:
    """Put the lower triangle of a block matrix in its place."""
    d = data.shape[1]
    for block in range(indptr.size - 1):
        for slot in range(indptr[block], indptr[block + 1]):
            if place[indices[slot]] > place[block]:
                continue
            row, column = d * place[block], d * place[indices[slot]]
            for p in range(d):
                for r in range(d):
                    if column + r <= row + p:
                        values[start[row + p] + column + r] = data[slot, p, r]


def _lowest_columns(matrix: sp.bsr_array, place: IntArray) -> IntArray:
    """Lowest new place among the columns of each block row, in new order."""
    columns = np.minimum.reduceat(place[matrix.indices], matrix.indptr[:-1])
    lowest = np.empty_like(place)
    lowest[place] = np.minimum(columns, place)
    return lowest


def _ordering(matrix: sp.bsr_array) -> tuple[IntArray, IntArray]:
    """Find the new place of each block row, and the skyline: unchanged, or by Cuthill-McKee.

    Reverse Cuthill-McKee (George and Liu, Computer Solution of Large Sparse Positive Definite
    Systems, 1981, chapter 4) is used where its factorisation is cheaper. It is not tried if the
    given order costs no more than on a square grid.
    """
    n = len(matrix.indptr) - 1
    natural = np.arange(n)
    best = _lowest_columns(matrix, natural)
    if ((natural - best) ** 2).mean() <= 1.21 * n:
        return natural, best
    order = reverse_cuthill_mckee(matrix.indptr, matrix.indices)
    place = np.empty(n, dtype=np.int64)
    place[order] = natural
    other = _lowest_columns(matrix, place)
    if ((natural - other) ** 2).sum() < ((natural - best) ** 2).sum():
        return place, other
    return natural, best


def skyline_operations(matrix: sp.bsr_array) -> float:
    """Multiplications of a factorisation by `skyline`."""
    return _operations(matrix, _ordering(matrix)[1])


def _operations(matrix: sp.bsr_array, lowest: IntArray) -> float:
    size = matrix.blocksize[0]
    height = size * (np.arange(len(lowest)) - lowest + 0.5)
    return 0.5 * size * float((height**2).sum())


def skyline(matrix: sp.bsr_array) -> Callable[[FloatArray], FloatArray]:
    """Cholesky factorisation within the skyline.

    Parameters
    ----------
    matrix : bsr_array (n, n)
        Symmetric positive definite.

    Raises
    ------
    SolveError
        When the matrix is not positive definite.
    """
    return _factor(matrix, *_ordering(matrix))


def skyline_within(matrix: sp.bsr_array, most: float) -> Callable[[FloatArray], FloatArray] | None:
    """Cholesky factorisation within the skyline if it takes at most `most` multiplications.

    Parameters and errors as in `skyline`; None if it takes more.
    """
    place, lowest = _ordering(matrix)
    return _factor(matrix, place, lowest) if _operations(matrix, lowest) <= most else None


def _factor(
    matrix: sp.bsr_array, place: IntArray, lowest: IntArray
) -> Callable[[FloatArray], FloatArray]:
    (n, _), d = matrix.shape, matrix.blocksize[0]
    padded = -(-n // _TOGETHER) * _TOGETHER
    first = np.arange(padded)
    first[:n] = np.repeat(d * lowest, d)
    # Rows that are eliminated together begin at one even column.
    first = np.repeat(first.reshape(-1, _TOGETHER).min(axis=1) // 2 * 2, _TOGETHER)
    length = np.arange(padded) - first + 1
    begin = np.cumsum(length) - length
    start = begin - first
    values = np.zeros(int(length.sum()))
    _fill_profile(matrix.indptr, matrix.indices, place, start, matrix.data, values)
    # Rows that fill up the last tile are those of the identity.
    values[start[n:] + np.arange(n, padded)] = 1.0
    bad = _factorise(first, start, values)
    if bad >= 0:
        raise SolveError(f"skyline: no positive pivot in row {bad}; the stiffness is not positive")
    unknown = (d * place[:, None] + np.arange(d)).reshape(-1)

    def apply(rhs: FloatArray) -> FloatArray:
        x = np.zeros(padded)
        x[unknown] = rhs
        _substitute(first, start, values, x)
        return x[unknown]

    return apply
