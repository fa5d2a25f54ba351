"""Direct factorisations, each of one library."""

import os
import threading
import weakref
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError
from ccfem.fem.elasticity.supernodes import supernodes

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
            own = self._latest
            self._upper.data = matrix.data.reshape(-1)[self._entries]
            self._call(22, np.zeros(matrix.shape[0]))

        def apply(rhs: FloatArray) -> FloatArray:
            with self._lock:
                if own != self._latest:
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
