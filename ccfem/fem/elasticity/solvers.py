"""Backends that solve the stiffness equations, and the choice among them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import direct, multigrid
from ccfem.fem.elasticity.conjugate_gradient import (
    Solution,
    checked,
    conjugate_gradient,
    judged,
    product,
    reached,
)
from ccfem.fem.elasticity.direct import skyline, skyline_operations

DIRECT = ("pypardiso", "cholmod", "superlu", "skyline")
BACKENDS = (*DIRECT, "amg", "two-level")

_CURES = {"pypardiso": 'pip install "ccfem[mkl]"', "cholmod": 'pip install "scikit-sparse<0.5"'}
_MODULES = {"pypardiso": "pypardiso", "cholmod": "sksparse"}

_SMALL = 6_000
"""Unknowns up to which SuperLU is faster than setting up a multigrid (measured)."""

_MANY = 4
"""Right-hand sides from which a sparse Cholesky is faster than a multigrid (measured)."""

_SEVERAL = 3
"""Right-hand sides from which a multigrid with a several times longer set-up pays off on thin parts
(measured: from 3 on parts one cell high, from 9 on two; never on higher ones)."""

_OFTEN = 30
"""Right-hand sides from which it pays to store the factor of SuperLU by supernodes, in single
precision."""

_THIN = 12.4
"""Neighbours of a node of linear cells, including itself, below which a part is so thin that
PARDISO is faster than a multigrid even for one right-hand side (measured): two cells high."""

_THIN_LARGEST = 40_000
"""Unknowns up to which this holds (measured on flat and curved sheets: 16,000 and 71,000)."""

_REFINEMENTS = 2
"""Times that a solution is improved by solving for its residual."""

_SKYLINE = 1e9
"""Operations up to which the skyline is faster than the sparse factorisations (measured)."""

_SKYLINE_RENEWED = 1e7
"""The same for matrices of one pattern, of which PARDISO analyses only the first (measured)."""

LARGEST_DIRECT = 100_000
"""Unknowns up to which a direct backend is worth its memory."""


@dataclass(frozen=True)
class Solver:
    """A factorisation or a preconditioner, ready for any number of right-hand sides.

    Attributes
    ----------
    matrix : bsr_array (n, n)
    apply : callable
        Returns the solution for a right-hand side (n,): to rounding if it is `exact`, otherwise
        one application of the preconditioner.
    exact : bool
        For a direct backend, but for a factor that is stored in single precision for many solves.
    make : callable
        Makes `apply` for any matrix with the pattern of this one.
    because : str
        The rule that chose the backend.
    """

    backend: str
    matrix: sp.bsr_array
    apply: Callable[[FloatArray], FloatArray]
    exact: bool
    make: Callable[[sp.bsr_array], Callable[[FloatArray], FloatArray]]
    because: str = ""

    def refactorise(self, matrix: sp.bsr_array) -> "Solver":
        """Factorise another matrix of the same pattern, such as another stiffness on the mesh.

        "pypardiso" keeps its ordering, and this solver is invalidated; the others refactorise.
        """
        known = self.matrix
        if not (
            matrix.shape == known.shape
            and matrix.data.shape == known.data.shape
            and np.array_equal(matrix.indptr, known.indptr)
            and np.array_equal(matrix.indices, known.indices)
        ):
            raise InputError(
                f"refactorise takes a matrix with the pattern of the one before ({known.shape[0]} "
                f"unknowns, {len(known.indices)} blocks); got another ({matrix.shape[0]}, "
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
            Start of an iterative backend.
        tolerance : float
            Largest relative residual that is accepted.

        Raises
        ------
        SolveError
            When the relative residual stays above the tolerance, and the backward error above
            rounding.
        """
        if not self.exact:
            return preconditioned_cg(self.matrix, rhs, self, x0, tolerance)
        solution = judged(self.matrix, self.apply(rhs), rhs, self.size)
        for _ in range(_REFINEMENTS):
            if solution.residual <= tolerance:
                break
            x = solution.values + self.apply(rhs - self.matrix @ solution.values)
            better = judged(self.matrix, x, rhs, self.size)
            if not better.residual < solution.residual:
                break
            solution = better
        return checked(solution, tolerance, self.backend)

    @cached_property
    def size(self) -> float:
        """Largest diagonal entry of the matrix, a lower bound of its norm."""
        return float(self.matrix.diagonal().max(initial=0.0))

    def energy_error(self, rhs: FloatArray, solution: Solution) -> float:
        """Bound of the energy of a solution's error, ``|x - x*|_A / |x|_A``.

        The preconditioner M gives ``|e|_A^2 = r^T A^-1 r <= r^T M^-1 r / lowest``, with the lowest
        eigenvalue of ``M^-1 A`` (Axelsson, Iterative Solution Methods, 1994, section 13.4); a
        factorisation is its own preconditioner. Conjugate gradients approach the lowest eigenvalue
        from above, so half of their value is used.
        """
        x = solution.values
        image = self.matrix @ x
        rest, size = rhs - image, product(x, image)
        lowest = 1.0 if self.exact else 0.5 * solution.lowest
        error = max(product(rest, self.apply(rest)), 0.0) / lowest
        return float(np.sqrt(error / size)) if size > 0.0 else 0.0


def preconditioned_cg(
    matrix: Any,
    rhs: FloatArray,
    solver: Solver,
    x0: FloatArray | None = None,
    tolerance: float = 1e-8,
) -> Solution:
    """Solve by conjugate gradients with the solver of a similar matrix as preconditioner.

    Parameters
    ----------
    matrix : bsr_array (n, n), or anything that ``@`` applies to an (n,) array
    rhs : (n,) array
    solver : Solver
        For this matrix or a similar one (another stiffness on the same mesh and supports).
    x0 : (n,) array, optional
    """
    # The recursive residual drifts from the true one: aim lower, and restart from the result if the
    # true one is still too large.
    best, total = None, 0
    for _ in range(1 + _REFINEMENTS):
        x, more, lowest = conjugate_gradient(matrix, rhs, solver.apply, x0, 0.5 * tolerance)
        total += more
        lowest = min(lowest, best.lowest) if best is not None and more else lowest
        better = judged(matrix, x, rhs, solver.size, total, lowest)
        if best is not None and not better.residual < 0.5 * best.residual:
            break
        best, x0 = better, x
        if reached(best, tolerance):
            break
    assert best is not None
    return checked(best, tolerance, solver.backend)


def direct_backend() -> str:
    """Name the best direct backend that is installed."""
    for backend in ("pypardiso", "cholmod"):
        if find_spec(_MODULES[backend]) is not None:
            return backend
    return "superlu"


def choose_direct(matrix: sp.bsr_array, renewed: bool = False) -> str:
    """Name the direct backend that suits a plane system and what is installed.

    Where it is renewed, many matrices of its pattern will follow.
    """
    best = direct_backend()
    limit = _SKYLINE_RENEWED if renewed and best == "pypardiso" else _SKYLINE
    return "skyline" if skyline_operations(matrix) <= limit else best


class Choice(NamedTuple):
    """A backend and the rule that chose it."""

    backend: str
    because: str


def choose(unknowns: int, order: int, solves: int = 1, neighbours: float = np.inf) -> Choice:
    """Choose the backend that suits a system and what is installed.

    Parameters
    ----------
    order : int
        Of the displacement: 1 or 2.
    solves : int
        Right-hand sides to expect.
    neighbours : float
        Mean number of neighbours of a node, including itself.
    """
    if unknowns <= _SMALL:
        return Choice("superlu", f"at most {_SMALL:,} unknowns")
    if order == 2:
        return Choice("two-level", f"quadratic cells, more than {_SMALL:,} unknowns")
    best = direct_backend()
    direct = unknowns <= LARGEST_DIRECT and best != "superlu"
    if direct and solves >= _MANY:
        return Choice(best, f"{solves} load cases on at most {LARGEST_DIRECT:,} unknowns")
    if best == "pypardiso" and neighbours < _THIN and unknowns <= _THIN_LARGEST:
        thin = f"one or two cells high ({neighbours:.1f} neighbours a node, below {_THIN})"
        return Choice(best, f"{thin}, at most {_THIN_LARGEST:,} unknowns")
    if unknowns > LARGEST_DIRECT:
        return Choice("amg", f"linear cells, more than {LARGEST_DIRECT:,} unknowns")
    if best == "superlu" and (solves >= _MANY or neighbours < _THIN):
        return Choice("amg", "linear cells, and no sparse Cholesky is installed")
    return Choice("amg", "linear cells, few load cases")


def factorise(
    matrix: sp.bsr_array,
    points: FloatArray,
    backend: str = "auto",
    parents: IntArray | multigrid.Coarse | None = None,
    solves: int = 1,
) -> Solver:
    """Factorise a stiffness matrix, or set up a preconditioner for it.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n) with 3x3 blocks
        Symmetric positive definite, columns sorted; (2n, 2n) with 2x2 blocks in the plane, for
        a direct backend.
    points : (n, 3) array, mm
        Points of the nodes that the rows belong to; or (3n, 6) their rigid-body motions, if rows
        belong to something else.
    backend : str, default "auto"
        One of `BACKENDS`; "auto" chooses by size and by what is installed.
    parents : (n, 2) int array, optional
        On quadratic meshes: the two rows of the corners whose midpoint each node is (twice its own
        row for a corner, -1 for a corner without a row); or the linear displacements, if the rows
        do not define them. "two-level" needs it.
    solves : int, default 1
        Right-hand sides to expect: with many, "auto" prefers a direct backend.

    Raises
    ------
    InputError
        For an unknown backend and for one that is not installed, with the cure.
    SolveError
        When the factorisation fails.
    """
    because = "asked for"
    if backend == "auto":
        order = 1 if parents is None else 2
        backend, because = choose(matrix.shape[0], order, solves, _mean_neighbours(matrix))
    check_backend(backend)
    make = _maker(backend, matrix, points, parents, solves)
    exact = backend in DIRECT and not (backend == "superlu" and solves >= _OFTEN)
    return Solver(backend, matrix, make(matrix), exact, make, because)


def check_backend(backend: str) -> None:
    """Refuse a backend that is unknown or not installed."""
    check_known("backend", backend, ["auto", *BACKENDS])
    if backend in _MODULES and find_spec(_MODULES[backend]) is None:
        raise InputError(f"backend '{backend}' is not installed: {_CURES[backend]}")


def _mean_neighbours(matrix: sp.bsr_array) -> float:
    """Mean number of neighbours of a node, including itself."""
    return len(matrix.indices) / max(1, len(matrix.indptr) - 1)


def _maker(
    backend: str,
    matrix: sp.bsr_array,
    points: FloatArray,
    parents: IntArray | multigrid.Coarse | None,
    solves: int,
) -> Callable[[sp.bsr_array], Callable[[FloatArray], FloatArray]]:
    """Choose the function that makes `Solver.apply` for this matrix and others of its pattern."""
    if backend == "pypardiso":
        return direct.Pardiso(matrix).factorise
    if backend == "two-level":
        if parents is None:
            raise InputError("backend 'two-level' is for quadratic meshes: use mesh.quadratic()")
        return partial(multigrid.two_level, points=points, parents=parents)
    if backend == "amg":
        frugal = solves < _SEVERAL or _mean_neighbours(matrix) >= _THIN
        return partial(multigrid.smoothed_aggregation, points=points, frugal=frugal)
    if backend == "superlu":
        return partial(direct.superlu, often=solves >= _OFTEN)
    return {"cholmod": direct.cholmod, "skyline": skyline}[backend]
