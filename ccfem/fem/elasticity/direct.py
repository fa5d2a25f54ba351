"""Direct factorisations, each of one library."""

import os
import threading
import weakref
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from ccfem.base.arrays import Float32Array, FloatArray, Int32Array, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.errors import SolveError
from ccfem.body.mesh.numbering import reverse_cuthill_mckee

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
        Whether many solves follow. The lower factor is then stored by supernodes in single
        precision, which takes as long as is saved in about thirty solves: solutions are accurate to
        about six digits, and conjugate gradients hardly need more iterations.
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

    One analysis of the pattern (ordering and symbolic factorisation) of a symmetric positive
    definite matrix with sorted columns serves any number of matrices. The memory is released with
    the object. Threads may share it.
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
    values : float32 array
        Blocks, column by column; in the square block only below the diagonal, which is 1.
    """

    order: IntArray
    pivots: FloatArray
    first: IntArray
    starts: IntArray
    row_starts: IntArray
    values: Float32Array
    rows: IntArray

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Solution (n,) for a right-hand side (n,)."""
        x = np.empty(len(rhs))
        x[self.order] = rhs
        _substitute_blocks(
            self.first, self.starts, self.row_starts, self.values, self.rows, self.pivots, x
        )
        return x.take(self.order)


def supernodes(factor: SuperLU) -> Supernodes | None:
    """Factor by supernodes of one made in symmetric mode; None if pivots are off the diagonal."""
    if (factor.perm_r != factor.perm_c).any():
        return None
    lower = factor.L
    lower.sort_indices()
    first = _first_columns(lower.indptr, lower.indices)
    wide, high = np.diff(first), np.diff(lower.indptr)[first[:-1]]
    starts, row_starts = (np.append(0, np.cumsum(size)) for size in (wide * high, high - wide))
    # Made by NumPy, which asks the system for large pages: every solve reads all of it twice.
    values = np.zeros(starts[-1], dtype=np.float32)
    rows = np.empty(row_starts[-1], dtype=np.int32)
    _fill_blocks(lower.indptr, lower.indices, lower.data, first, starts, row_starts, values, rows)
    order = np.asarray(factor.perm_r, dtype=np.int64)
    return Supernodes(order, factor.U.diagonal(), first, starts, row_starts, values, rows)


@compiled
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


@compiled
def _fill_blocks(
    indptr: Int32Array,
    indices: Int32Array,
    data: FloatArray,
    first: IntArray,
    starts: IntArray,
    row_starts: IntArray,
    values: Float32Array,
    rows: Int32Array,
) -> None:  # pragma: no cover
    """Fill blocks: dense, their columns one after the other, the triangle first, then the rest."""
    for s in range(len(first) - 1):
        wide, begin = first[s + 1] - first[s], indptr[first[s]]
        high = indptr[first[s] + 1] - begin
        for i in range(high - wide):
            rows[row_starts[s] + i] = indices[begin + wide + i]
        for c in range(wide):
            column = indptr[first[s] + c]
            for i in range(c, high):
                values[starts[s] + c * high + i] = data[column + i - c]


@compiled(fastmath={"contract", "reassoc"})
def _subtract(total: FloatArray, column: Float32Array, factor: float) -> None:  # pragma: no cover
    for i in range(len(total)):
        total[i] -= column[i] * factor


# Four columns at a time: the vector they are added to is read and written once.
@compiled(fastmath={"contract", "reassoc"})
def _add_four(
    total: FloatArray,
    a: Float32Array,
    b: Float32Array,
    c: Float32Array,
    d: Float32Array,
    factors: FloatArray,
) -> None:  # pragma: no cover
    p, q, r, s = factors[0], factors[1], factors[2], factors[3]
    for i in range(len(total)):
        total[i] += a[i] * p + b[i] * q + c[i] * r + d[i] * s


@compiled(fastmath={"contract", "reassoc"})
def _product(column: Float32Array, other: FloatArray) -> float:  # pragma: no cover
    total = 0.0
    for i in range(len(other)):
        total += column[i] * other[i]
    return total


@compiled(fastmath={"contract", "reassoc"})
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


@compiled
def _substitute_blocks(
    first: IntArray,
    starts: IntArray,
    row_starts: IntArray,
    values: Float32Array,
    rows: Int32Array,
    pivots: FloatArray,
    x: FloatArray,
) -> None:  # pragma: no cover
    count, room = len(first) - 1, np.empty(len(x))
    # Forward: within the block of each supernode, then off what lies below it, all its columns at
    # once.
    for s in range(count):
        segment = x[first[s] : first[s + 1]]
        wide, below = len(segment), rows[row_starts[s] : row_starts[s + 1]]
        high = wide + len(below)
        block, total = values[starts[s] : starts[s + 1]], room[: len(below)]
        for c in range(wide - 1):
            _subtract(segment[c + 1 :], block[c * high + c + 1 : c * high + wide], segment[c])
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
                    segment[c : c + 4],
                )
                c += 4
            else:
                _subtract(total, block[at : at + len(total)], -segment[c])
                c += 1
        for i in range(len(total)):
            x[below[i]] -= total[i]
    # The pivots, which U has besides the transpose of L: L D L^T.
    for i in range(len(x)):
        x[i] /= pivots[i]
    # Backward: gather what is known below the block, subtract its products, solve within the block.
    for s in range(count - 1, -1, -1):
        segment = x[first[s] : first[s + 1]]
        wide, below = len(segment), rows[row_starts[s] : row_starts[s + 1]]
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
                segment[c] -= p
                segment[c + 1] -= q
                segment[c + 2] -= r
                segment[c + 3] -= t
                c += 4
            else:
                segment[c] -= _product(block[at : at + len(other)], other)
                c += 1
        for c in range(wide - 2, -1, -1):
            segment[c] -= _product(block[c * high + c + 1 : c * high + wide], segment[c + 1 :])


# Cholesky factorisation within the skyline of a matrix: fast where its band is narrow.
#
# It is one compiled loop without a library, so its time does not depend on threads. On a raster of
# h rows of cells it does about ``(2 h)^2`` operations an unknown.


_TOGETHER = 4
"""Rows that are eliminated together, two columns at a time; they share their first column."""


@compiled(fastmath=True)
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


@compiled(fastmath=True)
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


@compiled(fastmath=True)
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


@compiled
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
    """Cholesky factorisation of a symmetric positive definite matrix within the skyline."""
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
