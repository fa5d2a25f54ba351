"""Block Gauss-Seidel sweeps over matrices of 3x3 blocks, compiled."""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.arrays import FloatArray

__all__ = ["GaussSeidel"]


# Both sweeps run through the blocks in the order of memory, forward or backward, and read each row
# whole: three times as fast as reading half rows or ascending within descending rows.


@njit(cache=True)
def _times(data, k, u, v, w):  # type: ignore[no-untyped-def]
    """Product of the 3x3 block that starts at k with a vector."""
    return (
        data[k] * u + data[k + 1] * v + data[k + 2] * w,
        data[k + 3] * u + data[k + 4] * v + data[k + 5] * w,
        data[k + 6] * u + data[k + 7] * v + data[k + 8] * w,
    )


@njit(cache=True)
def _forward(indptr, indices, data, inverse, rhs, x, residual):  # type: ignore[no-untyped-def]
    """Sweep from x = 0, and leave the residual ``-U x``, U the strict upper triangle.

    Row i knows x up to i; what it adds to the residual of the rows above comes from its own lower
    blocks, since the matrix is symmetric.
    """
    for i in range(indptr.size - 1):
        a, b, c = rhs[3 * i], rhs[3 * i + 1], rhs[3 * i + 2]
        for s in range(indptr[i], indptr[i + 1]):
            j = 3 * indices[s]
            p, q, r = _times(data, 9 * s, x[j], x[j + 1], x[j + 2])
            a, b, c = a - p, b - q, c - r
        u, v, w = _times(inverse, 9 * i, a, b, c)
        x[3 * i], x[3 * i + 1], x[3 * i + 2] = u, v, w
        for s in range(indptr[i], indptr[i + 1]):
            if indices[s] >= i:
                break
            j, k = 3 * indices[s], 9 * s
            residual[j] -= data[k] * u + data[k + 3] * v + data[k + 6] * w
            residual[j + 1] -= data[k + 1] * u + data[k + 4] * v + data[k + 7] * w
            residual[j + 2] -= data[k + 2] * u + data[k + 5] * v + data[k + 8] * w


@njit(cache=True)
def _backward(indptr, indices, data, inverse, rhs, x):  # type: ignore[no-untyped-def]
    """Sweep backward over x, in place."""
    for i in range(indptr.size - 2, -1, -1):
        a, b, c = rhs[3 * i], rhs[3 * i + 1], rhs[3 * i + 2]
        for s in range(indptr[i + 1] - 1, indptr[i] - 1, -1):
            if indices[s] == i:
                continue
            j = 3 * indices[s]
            p, q, r = _times(data, 9 * s, x[j], x[j + 1], x[j + 2])
            a, b, c = a - p, b - q, c - r
        x[3 * i], x[3 * i + 1], x[3 * i + 2] = _times(inverse, 9 * i, a, b, c)


class GaussSeidel:
    """Symmetric block Gauss-Seidel round a coarse correction.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
        Sorted columns, a positive definite block on each diagonal.
    """

    def __init__(self, matrix: sp.bsr_array) -> None:
        n = len(matrix.indptr) - 1
        indptr, indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
        rows = np.repeat(np.arange(n), np.diff(indptr))
        diagonal = np.flatnonzero(indices == rows)
        inverse = np.linalg.inv(matrix.data[diagonal])
        self._arguments: tuple[Any, ...] = (
            indptr,
            indices,
            matrix.data.reshape(-1),
            inverse.reshape(-1),
        )

    def forward(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sweep forward from zero: the approximation (3n,) and the residual (3n,) it leaves."""
        x, residual = np.zeros_like(rhs), np.zeros_like(rhs)
        _forward(*self._arguments, rhs, x, residual)
        return x, residual

    def backward(self, rhs: FloatArray, x: FloatArray) -> FloatArray:
        """Sweep backward over the approximation x (3n,), in place, and return it."""
        _backward(*self._arguments, rhs, x)
        return x
