"""Direct factorisations, each of one library."""

import os
import weakref
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.arrays import FloatArray
from ccfem.errors import SolveError

__all__ = ["cholmod", "pardiso", "superlu"]

Apply = Callable[[FloatArray], FloatArray]


def superlu(matrix: sp.bsr_array) -> Apply:
    """SuperLU in symmetric mode: minimum degree ordering, no pivoting off the diagonal."""
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
    return lambda rhs: np.asarray(factor.solve(rhs))


def pardiso(matrix: sp.bsr_array) -> Apply:
    """PARDISO of the MKL, Cholesky of the upper triangle (matrix type 2)."""
    from pypardiso import PyPardisoSolver
    from pypardiso.pardiso_wrapper import PyPardisoError

    upper = sp.csr_matrix(sp.triu(matrix.tocsr(), format="csr"))
    solver = PyPardisoSolver(mtype=2)
    # It searches the whole environment for the library every time unless told where that is.
    os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)
    try:
        solver.factorize(upper)
    except PyPardisoError as error:
        raise SolveError(f"pypardiso: {error}; the stiffness is not positive definite") from error

    def apply(rhs: FloatArray) -> FloatArray:
        # Its public `solve` compares the whole matrix with the factorised one at every call.
        solver.set_phase(33)
        return np.asarray(solver._call_pardiso(upper, np.asfortranarray(rhs)))

    weakref.finalize(apply, solver.free_memory, everything=True)
    return apply


def cholmod(matrix: sp.bsr_array) -> Apply:
    """CHOLMOD through scikit-sparse."""
    from sksparse.cholmod import CholmodNotPositiveDefiniteError, cholesky

    try:
        factor = cholesky(sp.csc_matrix(matrix.tocsc()))
    except CholmodNotPositiveDefiniteError as error:
        raise SolveError(f"cholmod: {error}; the stiffness is not positive definite") from error
    return lambda rhs: np.asarray(factor(rhs))
