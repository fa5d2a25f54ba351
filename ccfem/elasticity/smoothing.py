"""Block Gauss-Seidel sweeps over matrices of 3x3 blocks, compiled."""

from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.arrays import FloatArray

__all__ = ["GaussSeidel"]


@njit(cache=True)
def _less_row(low, high, indices, data, x, a, b, c):  # type: ignore[no-untyped-def]
    """Subtract the product of some blocks of a row with x from (a, b, c)."""
    for s in range(low, high):
        j, k = 3 * np.uint32(indices[s]), 9 * s
        u, v, w = x[j], x[j + 1], x[j + 2]
        a -= data[k] * u + data[k + 1] * v + data[k + 2] * w
        b -= data[k + 3] * u + data[k + 4] * v + data[k + 5] * w
        c -= data[k + 6] * u + data[k + 7] * v + data[k + 8] * w
    return a, b, c


@njit(cache=True)
def _sweep(indptr, indices, diagonal, data, inverse, rhs, x, residual):  # type: ignore[no-untyped-def]
    """One sweep in place: forward from x = 0, or backward from x where residual is empty.

    Forward also gives the residual it leaves, ``-U x`` with the strict upper triangle U.
    """
    n = indptr.size - 1
    forward = residual.size > 0
    for row in range(n):
        i = row if forward else n - 1 - row
        a, b, c = rhs[3 * i], rhs[3 * i + 1], rhs[3 * i + 2]
        a, b, c = _less_row(indptr[i], diagonal[i], indices, data, x, a, b, c)
        if not forward:
            a, b, c = _less_row(diagonal[i] + 1, indptr[i + 1], indices, data, x, a, b, c)
        k = 9 * i
        x[3 * i] = inverse[k] * a + inverse[k + 1] * b + inverse[k + 2] * c
        x[3 * i + 1] = inverse[k + 3] * a + inverse[k + 4] * b + inverse[k + 5] * c
        x[3 * i + 2] = inverse[k + 6] * a + inverse[k + 7] * b + inverse[k + 8] * c
    if forward:
        for i in range(n):
            residual[3 * i], residual[3 * i + 1], residual[3 * i + 2] = _less_row(
                diagonal[i] + 1, indptr[i + 1], indices, data, x, 0.0, 0.0, 0.0
            )


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
            diagonal.astype(np.int32),
            matrix.data.reshape(-1),
            inverse.reshape(-1),
        )

    def forward(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sweep forward from zero: the approximation (3n,) and the residual (3n,) it leaves."""
        x, residual = np.zeros_like(rhs), np.empty_like(rhs)
        _sweep(*self._arguments, rhs, x, residual)
        return x, residual

    def backward(self, rhs: FloatArray, x: FloatArray) -> FloatArray:
        """Sweep backward over the approximation x (3n,), in place, and return it."""
        _sweep(*self._arguments, rhs, x, np.empty(0))
        return x
