"""Block Gauss-Seidel sweeps over symmetric matrices stored as one triangle, compiled.

The blocks below the diagonal determine those above it. A sweep uses each block of row i twice: to
gather the contributions of earlier rows to row i, and to scatter those of row i back. It reads half
as much memory as a sweep over whole rows.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import Float32Array, FloatArray, Int32Array
from ccfem.base.compiled import compiled

_CONTRACT = {"contract"}
"""Products and sums may be fused."""


_SINGULAR = 1e-12
"""Share of the largest eigenvalue of a block below which one counts as zero."""


def rows_of(matrix: sp.bsr_array) -> Int32Array:
    """Row of each block."""
    return np.repeat(np.arange(len(matrix.indptr) - 1, dtype=np.int32), np.diff(matrix.indptr))


@compiled(fastmath=_CONTRACT)
def _three(
    start: Int32Array,
    column: Int32Array,
    low: Float32Array,
    inverse: FloatArray,
    rest: FloatArray,
    x: FloatArray,
    backward: bool,
) -> None:
    """Sweep over 3x3 blocks.

    Forward, from ``x = 0`` and ``rest = 0``, with the right-hand side in x: `rest` becomes the
    residual ``-U x``, U the strict upper triangle. Backward `rest` is the right-hand side, which
    loses ``U x`` on the way.
    """
    n = start.size - 1
    for row in range(n):
        i = n - 1 - row if backward else row
        f = rest[i] if backward else x[i]
        a, b, c = f[0], f[1], f[2]
        for s in range(start[i], start[i + 1]):
            m, y = low[s], x[column[s]]
            u, v, w = y[0], y[1], y[2]
            a -= m[0, 0] * u + m[0, 1] * v + m[0, 2] * w
            b -= m[1, 0] * u + m[1, 1] * v + m[1, 2] * w
            c -= m[2, 0] * u + m[2, 1] * v + m[2, 2] * w
        m = inverse[i]
        u = m[0, 0] * a + m[0, 1] * b + m[0, 2] * c
        v = m[1, 0] * a + m[1, 1] * b + m[1, 2] * c
        w = m[2, 0] * a + m[2, 1] * b + m[2, 2] * c
        x[i, 0], x[i, 1], x[i, 2] = u, v, w
        # The transpose of the same blocks is the strict upper triangle: the residual follows at
        # once.
        for s in range(start[i], start[i + 1]):
            m, y = low[s], rest[column[s]]
            y[0] -= m[0, 0] * u + m[1, 0] * v + m[2, 0] * w
            y[1] -= m[0, 1] * u + m[1, 1] * v + m[2, 1] * w
            y[2] -= m[0, 2] * u + m[1, 2] * v + m[2, 2] * w


@compiled(fastmath=_CONTRACT)
def _six(
    start: Int32Array,
    column: Int32Array,
    low: FloatArray,
    inverse: FloatArray,
    rest: FloatArray,
    x: FloatArray,
    backward: bool,
) -> None:
    """Do the same over 6x6 blocks."""
    n, f, u = start.size - 1, np.empty(6), np.empty(6)
    for row in range(n):
        i = n - 1 - row if backward else row
        for p in range(6):
            f[p] = rest[i, p] if backward else x[i, p]
        for s in range(start[i], start[i + 1]):
            m, y = low[s], x[column[s]]
            for p in range(6):
                total = f[p]
                for q in range(6):
                    total -= m[p, q] * y[q]
                f[p] = total
        m = inverse[i]
        for p in range(6):
            total = 0.0
            for q in range(6):
                total += m[p, q] * f[q]
            u[p] = total
            x[i, p] = total
        for s in range(start[i], start[i + 1]):
            m, y = low[s], rest[column[s]]
            for p in range(6):
                for q in range(6):
                    y[q] -= m[p, q] * u[p]


class GaussSeidel:
    """Symmetric block Gauss-Seidel round a coarse correction.

    Parameters
    ----------
    matrix : bsr_array (d n, d n) with d x d blocks, d 3 or 6
        Symmetric, a positive definite block on each diagonal; components without any stiffness
        stay zero.
    single : bool, default False
        Whether to store the off-diagonal blocks in single precision.
    singular : bool, default False
        Whether diagonal blocks may be singular: their pseudoinverses are then used.
    """

    def __init__(self, matrix: sp.bsr_array, single: bool = False, singular: bool = False) -> None:
        # The blocks below the diagonal, and those on it.
        row, column, count = rows_of(matrix), matrix.indices, len(matrix.indptr) - 1
        below, diagonal = column < row, matrix.data[column == row]
        in_rows = np.bincount(row[below], minlength=count)
        start = np.concatenate([[0], np.cumsum(in_rows)]).astype(np.uint32)
        column = column[below].astype(np.uint32)
        low = matrix.data[below].astype(np.float32 if single else np.float64, copy=False)
        nothing = np.einsum("npp->np", diagonal) == 0.0
        np.einsum("npp->np", diagonal)[nothing] = 1.0
        self.inverse: FloatArray = (
            np.linalg.pinv(diagonal, rcond=_SINGULAR, hermitian=True)
            if singular
            else np.linalg.inv(diagonal)
        )
        self._arguments: tuple[Any, ...] = (start, column, low, self.inverse)
        self._sweep = _three if low.shape[1] == 3 else _six

    def forward(self, rhs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Sweep forward from zero: the approximation (d n,) and the residual (d n,) it leaves."""
        x, residual = rhs.copy(), np.zeros_like(rhs)
        self._run(residual, x, False)
        return x, residual

    def backward(self, rhs: FloatArray, x: FloatArray) -> FloatArray:
        """Sweep backward over the approximation x (d n,), in place, and return it."""
        self._run(rhs.copy(), x, True)
        return x

    def jacobi(self, rhs: FloatArray) -> FloatArray:
        """Product (d n,) with the inverse of the diagonal blocks."""
        shape = self.inverse.shape[:2]
        return np.einsum("npq,nq->np", self.inverse, rhs.reshape(shape)).reshape(-1)

    def _run(self, rest: FloatArray, x: FloatArray, backward: bool) -> None:
        shape = self.inverse.shape[:2]
        self._sweep(*self._arguments, rest.reshape(shape), x.reshape(shape), backward)
