"""Backends that solve the stiffness equations, and the choice among them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.checks import check_known
from ccfem.elasticity import direct, multigrid
from ccfem.elasticity.conjugate_gradient import conjugate_gradient
from ccfem.elasticity.skyline import skyline, skyline_operations
from ccfem.errors import InputError, SolveError

__all__ = ["BACKENDS", "DIRECT", "Solution", "Solver", "factorise", "preconditioned_cg"]

DIRECT = ("pypardiso", "cholmod", "superlu", "skyline")
BACKENDS = (*DIRECT, "amg", "two-level", "petsc")

_CURES = {
    "pypardiso": 'pip install "ccfem[mkl]"',
    "cholmod": 'pip install "scikit-sparse<0.5"',
    "petsc": "install petsc4py",
}
_MODULES = {"pypardiso": "pypardiso", "cholmod": "sksparse", "petsc": "petsc4py"}

_SMALL = 6_000
"""Unknowns up to which SuperLU is quicker than setting up a multigrid (measured)."""

_MANY = 4
"""Right-hand sides from which a sparse Cholesky is quicker than a multigrid (measured)."""

_RESTARTS = 2

_SKYLINE = 1e9
"""Operations up to which the skyline is quicker than the sparse factorisations (measured)."""

_SKYLINE_RENEWED = 1e7
"""The same for matrices of one pattern, of which PARDISO analyses the first alone (measured)."""

LARGEST_DIRECT = 100_000
"""Unknowns up to which a direct backend is worth its memory."""


class Solution(NamedTuple):
    """What a solve found.

    Attributes
    ----------
    values : (n,) array
    iterations : int
        0 for a direct solve.
    residual : float
        ``|rhs - matrix values| / |rhs|``, computed from the matrix.
    """

    values: FloatArray
    iterations: int
    residual: float


@dataclass(frozen=True)
class Solver:
    """A factorisation or a preconditioner, ready for any number of right-hand sides.

    Attributes
    ----------
    backend : str
    matrix : bsr_array (n, n)
    apply : callable
        Solution of a right-hand side (n,): exact to rounding of a direct backend, else one
        application of the preconditioner.
    exact : bool
    make : callable
        Makes `apply` of any matrix with the pattern of this one.
    """

    backend: str
    matrix: sp.bsr_array
    apply: Callable[[FloatArray], FloatArray]
    exact: bool
    make: Callable[[sp.bsr_array], Callable[[FloatArray], FloatArray]]

    def refactorise(self, matrix: sp.bsr_array) -> "Solver":
        """Factorise another matrix of the same pattern, such as another stiffness on the mesh.

        "pypardiso" keeps its ordering, and this solver is invalidated; the others refactorise.

        Parameters
        ----------
        matrix : bsr_array (n, n)
            Symmetric positive definite.

        Raises
        ------
        InputError
            When its pattern is another one.
        SolveError
            When the factorisation fails.
        """
        own = self.matrix
        if not (
            matrix.shape == own.shape
            and matrix.data.shape == own.data.shape
            and np.array_equal(matrix.indptr, own.indptr)
            and np.array_equal(matrix.indices, own.indices)
        ):
            raise InputError(
                f"refactorise takes a matrix with the pattern of the one before ({own.shape[0]} "
                f"unknowns, {len(own.indices)} blocks); got another ({matrix.shape[0]}, "
                f"{len(matrix.indices)}): use factorise"
            )
        return replace(self, matrix=matrix, apply=self.make(matrix))

    def solve(
        self, rhs: FloatArray, x0: FloatArray | None = None, tolerance: float = 1e-8
    ) -> Solution:
        """Solve for one right-hand side.

        Parameters
        ----------
        rhs : (n,) array
        x0 : (n,) array, optional
            Where an iterative backend starts.
        tolerance : float
            Largest relative residual that is accepted.

        Raises
        ------
        SolveError
            When the relative residual stays above the tolerance.
        """
        if not self.exact:
            return preconditioned_cg(self.matrix, rhs, self, x0, tolerance)
        x = self.apply(rhs)
        if _residual(self.matrix, x, rhs) > tolerance:
            x = x + self.apply(rhs - self.matrix @ x)
        return _checked(self.matrix, x, rhs, 0, tolerance, self.backend)


def _residual(matrix: sp.bsr_array, x: FloatArray, rhs: FloatArray) -> float:
    # Sums of squares without the threads of a BLAS, which cost more than they save here.
    rest = rhs - matrix @ x
    size = float(np.sqrt(np.einsum("i,i->", rhs, rhs)))
    return float(np.sqrt(np.einsum("i,i->", rest, rest))) / (size or 1.0)


def _checked(
    matrix: sp.bsr_array,
    x: FloatArray,
    rhs: FloatArray,
    iterations: int,
    tolerance: float,
    backend: str,
) -> Solution:
    residual = _residual(matrix, x, rhs)
    if not residual <= tolerance:
        raise SolveError(
            f"{backend}: relative residual {residual:.1e} after {iterations} iterations, above "
            f"the tolerance {tolerance:.1e}"
        )
    return Solution(x, iterations, residual)


def preconditioned_cg(
    matrix: sp.bsr_array,
    rhs: FloatArray,
    solver: Solver,
    x0: FloatArray | None = None,
    tolerance: float = 1e-8,
) -> Solution:
    """Solve by conjugate gradients with the solver of a similar matrix as preconditioner.

    Parameters
    ----------
    matrix : bsr_array (n, n)
    rhs : (n,) array
    solver : Solver
        Of this matrix or of one like it (another stiffness on the same mesh and supports).
    x0 : (n,) array, optional
    tolerance : float

    Raises
    ------
    SolveError
        When the relative residual stays above the tolerance.
    """
    # The residual of the recursion drifts from the true one: aim lower, and start again from what
    # was found where the true one is still too large.
    x, iterations = conjugate_gradient(matrix, rhs, solver.apply, x0, 0.5 * tolerance)
    for _ in range(_RESTARTS):
        if _residual(matrix, x, rhs) <= tolerance:
            break
        x, more = conjugate_gradient(matrix, rhs, solver.apply, x, 0.5 * tolerance)
        iterations += more
    return _checked(matrix, x, rhs, iterations, tolerance, solver.backend)


def direct_backend() -> str:
    """Name the best direct backend that is installed."""
    for backend in ("pypardiso", "cholmod"):
        if find_spec(_MODULES[backend]) is not None:
            return backend
    return "superlu"


def choose_direct(matrix: sp.bsr_array, renewed: bool = False) -> str:
    """Name the direct backend that suits a plane system and what is installed.

    Parameters
    ----------
    matrix : bsr_array (n, n)
    renewed : bool, default False
        Whether many matrices of its pattern will follow.
    """
    best = direct_backend()
    limit = _SKYLINE_RENEWED if renewed and best == "pypardiso" else _SKYLINE
    return "skyline" if skyline_operations(matrix) <= limit else best


def choose(unknowns: int, order: int, solves: int = 1) -> str:
    """Name the backend that suits a system and what is installed.

    Parameters
    ----------
    unknowns : int
    order : int
        Of the displacement: 1 or 2.
    solves : int
        Right-hand sides to expect.
    """
    if unknowns <= _SMALL:
        return "superlu"
    if order == 1 and solves >= _MANY and unknowns <= LARGEST_DIRECT:
        backend = direct_backend()
        if backend != "superlu":
            return backend
    return "amg" if order == 1 else "two-level"


def factorise(
    matrix: sp.bsr_array,
    points: FloatArray,
    backend: str = "auto",
    parents: IntArray | None = None,
    solves: int = 1,
) -> Solver:
    """Factorise a stiffness matrix, or set up a preconditioner for it.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
        Symmetric positive definite, columns sorted; (2n, 2n) with 2x2 blocks in the plane, for
        a direct backend.
    points : (n, 3) array, mm
        Of the nodes that the rows stand for.
    backend : str, default "auto"
        One of `BACKENDS`; "auto" chooses by size and by what is installed.
    parents : (n, 2) int array, optional
        On quadratic meshes: the two rows of the corners whose middle each node is (twice its own
        row for a corner, -1 for a corner without a row). "two-level" needs it.
    solves : int, default 1
        Right-hand sides to expect: with many, "auto" prefers a direct backend.

    Raises
    ------
    InputError
        For an unknown backend and for one that is not installed, with the cure.
    SolveError
        When the factorisation fails.
    """
    if backend == "auto":
        backend = choose(matrix.shape[0], 1 if parents is None else 2, solves)
    check_known("backend", backend, ["auto", *BACKENDS])
    if backend in _MODULES and find_spec(_MODULES[backend]) is None:
        raise InputError(f"backend '{backend}' is not installed: {_CURES[backend]}")
    make = _maker(backend, matrix, points, parents)
    return Solver(backend, matrix, make(matrix), backend in DIRECT, make)


def _maker(
    backend: str, matrix: sp.bsr_array, points: FloatArray, parents: IntArray | None
) -> Callable[[sp.bsr_array], Callable[[FloatArray], FloatArray]]:
    """Choose what makes `Solver.apply` of this matrix, and of others of its pattern."""
    if backend == "pypardiso":
        return direct.Pardiso(matrix).factorise
    if backend == "two-level":
        if parents is None:
            raise InputError("backend 'two-level' is for quadratic meshes: use mesh.quadratic()")
        return partial(multigrid.two_level, points=points, parents=parents)
    if backend == "amg":
        return partial(multigrid.smoothed_aggregation, points=points)
    if backend == "petsc":
        return partial(multigrid.petsc_gamg, points=points)
    return {"cholmod": direct.cholmod, "superlu": direct.superlu, "skyline": skyline}[backend]
