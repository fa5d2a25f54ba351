"""Direct factorisations, each of one library."""

import os
import threading
import weakref
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.sparse.linalg import SuperLU, splu

from ccfem.base.arrays import FloatArray, Int32Array, IntArray
from ccfem.base.errors import SolveError

Apply = Callable[[FloatArray], FloatArray]

_SMALL = 300_000
"""Entries of an upper triangle up to which PARDISO uses one thread: with more threads it is hardly
faster, and several times slower beside other work on the machine (measured)."""

_PIVOT = -4
"""Error of PARDISO at a pivot that is not positive."""


def superlu(matrix: sp.bsr_array, often: bool = False) -> Apply:
    """SuperLU in symmetric mode: minimum degree ordering, no pivoting off the diagonal.

    Parameters
    ----------
    matrix : bsr_array (n, n)
        Symmetric.
    often : bool, default False
        Whether many solves follow. The lower factor is then stored by supernodes, which takes as
        long as is saved in about thirty solves.
    """
    rows = matrix.tocsr()
    columns = sp.csc_array((rows.data, rows.indices, rows.indptr), shape=rows.shape)
    try:
        factor = splu(
            columns,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SolveError(f"superlu: {error}; the stiffness is not positive definite") from error
    kept = supernodes(factor) if often else None
    return (lambda rhs: np.asarray(factor.solve(rhs))) if kept is None else kept.solve


class Pardiso:
    """Cholesky factorisation by PARDISO of the MKL, of the upper triangle (matrix type 2).

    One analysis of the pattern (ordering and symbolic factorisation) serves any number of matrices.
    The memory is released with the object. Threads may share it.

    Parameters
    ----------
    matrix : bsr_array (n, n)
        Symmetric positive definite, columns sorted; its pattern is analysed.
    """

    def __init__(self, matrix: sp.bsr_array) -> None:
        from pypardiso import PyPardisoSolver

        self._solver = PyPardisoSolver(mtype=2)
        weakref.finalize(self, self._solver.free_memory, everything=True)
        # It searches the whole environment for the library every time unless told where that is.
        os.environ.setdefault("PYPARDISO_MKL_RT", self._solver.libmkl._name)
        self._solver.set_iparm(1, 1)  # no defaults, which refine every solution once
        self._solver.set_iparm(2, 2)  # nested dissection
        entries = np.arange(matrix.data.size, dtype=np.float64).reshape(matrix.data.shape)
        numbered = sp.bsr_array((entries, matrix.indices, matrix.indptr), shape=matrix.shape)
        self._upper = sp.csr_matrix(sp.triu(numbered.tocsr(), format="csr"))
        self._solver._check_A(self._upper)
        self._entries = self._upper.data.astype(np.int64)
        self._lock = threading.Lock()
        self._latest = 0
        mkl = self._solver.libmkl
        self._threads = 1 if self._upper.nnz <= _SMALL else mkl.MKL_Get_Max_Threads()
        self._call(11, np.zeros(matrix.shape[0]))

    def _call(self, phase: int, rhs: FloatArray) -> FloatArray:
        from pypardiso.pardiso_wrapper import PyPardisoError

        # It crashes if phases differ in their number of threads.
        limit = self._solver.libmkl.MKL_Set_Num_Threads_Local
        before = limit(self._threads)
        try:
            # Its public `solve` compares the whole matrix with the factorised one at every call.
            self._solver.set_phase(phase)
            return np.asarray(self._solver._call_pardiso(self._upper, np.asfortranarray(rhs)))
        except PyPardisoError as error:
            why = "; the stiffness is not positive definite" if error.value == _PIVOT else ""
            raise SolveError(f"pypardiso: {error}{why}") from error
        finally:
            limit(before)

    def factorise(self, matrix: sp.bsr_array) -> Apply:
        """Factorise a matrix of the pattern; an earlier factor is invalidated."""
        with self._lock:
            self._latest += 1
            current = self._latest
            self._upper.data = matrix.data.reshape(-1)[self._entries]
            self._call(22, np.zeros(matrix.shape[0]))

        def apply(rhs: FloatArray) -> FloatArray:
            with self._lock:
                if current != self._latest:
                    raise SolveError(
                        "pypardiso: a later matrix took the place of this factor: solve with what "
                        "`refactorise` returned"
                    )
                return self._call(33, rhs)

        return apply


def cholmod(matrix: sp.bsr_array) -> Apply:
    """CHOLMOD through scikit-sparse."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    try:
        factor = cholesky(sp.csc_matrix(matrix.tocsc()))
    except CholmodNotPositiveDefiniteError as error:
        raise SolveError(f"cholmod: {error}; the stiffness is not positive definite") from error
    return lambda rhs: np.asarray(factor(rhs))


# Triangular solves with a factor whose columns are stored by supernodes.
#
# Consecutive columns of a sparse Cholesky factor often have the same rows. Such a supernode is a
# dense block, which a solve processes without looking up rows (Davis, Direct Methods for Sparse
# Linear Systems, 2006, section 4.8). With ``A = L D L^T`` only the lower factor is read, whereas
# SuperLU also reads the upper one, entry by entry.


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
        _substitute_blocks(
            self.first, self.starts, self.row_starts, self.values, self.rows, self.pivots, x
        )
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
    blocks = _supernode_blocks(lower.indptr, lower.indices, lower.data, first)
    order = np.asarray(factor.perm_r, dtype=np.int64)
    return Supernodes(order, factor.U.diagonal(), first, *blocks)


@njit(cache=True, nogil=True)
def _first_columns(indptr: Int32Array, indices: Int32Array) -> IntArray:  # pragma: no cover
    """First columns of supernodes, and the number of columns."""
    n = len(indptr) - 1
    first, count = np.empty(n + 1, np.int64), 0
    # A column goes on with a supernode where it has the rows of the one before, less its diagonal.
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
def _supernode_blocks(
    indptr: Int32Array, indices: Int32Array, data: FloatArray, first: IntArray
) -> tuple[IntArray, IntArray, FloatArray, Int32Array]:  # pragma: no cover
    """Return where blocks and their rows begin, values and rows."""
    count = len(first) - 1
    starts, row_starts = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    # A block is dense: its columns one after the other, the triangle first, then the rows below.
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
def _subtract(total: FloatArray, column: FloatArray, factor: float) -> None:  # pragma: no cover
    for i in range(len(total)):
        total[i] -= column[i] * factor


# Four columns at a time: the vector they are added to is read and written once.
@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _add_four(
    total: FloatArray,
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    d: FloatArray,
    factors: FloatArray,
) -> None:  # pragma: no cover
    p, q, r, s = factors[0], factors[1], factors[2], factors[3]
    for i in range(len(total)):
        total[i] += a[i] * p + b[i] * q + c[i] * r + d[i] * s


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _product(column: FloatArray, other: FloatArray) -> float:  # pragma: no cover
    total = 0.0
    for i in range(len(other)):
        total += column[i] * other[i]
    return total


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _four_products(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray, other: FloatArray
) -> tuple[float, float, float, float]:  # pragma: no cover
    p, q, r, s = 0.0, 0.0, 0.0, 0.0
    for i in range(len(other)):
        p += a[i] * other[i]
        q += b[i] * other[i]
        r += c[i] * other[i]
        s += d[i] * other[i]
    return p, q, r, s


@njit(cache=True, nogil=True)
def _substitute_blocks(
    first: IntArray,
    starts: IntArray,
    row_starts: IntArray,
    values: FloatArray,
    rows: Int32Array,
    pivots: FloatArray,
    x: FloatArray,
) -> None:  # pragma: no cover
    count, room = len(first) - 1, np.empty(len(x))
    # Forward: within the block of each supernode, then off what lies below it, all its columns at
    # once.
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
    # The pivots, which U has besides the transpose of L: L D L^T.
    for i in range(len(x)):
        x[i] /= pivots[i]
    # Backward: gather what is known below the block, subtract its products, solve within the block.
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
