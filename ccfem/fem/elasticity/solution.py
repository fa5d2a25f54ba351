"""Result of a solve, its accuracy, and whether that is sufficient.

A residual says little by itself. On a slender part the load is tiny beside the forces that cancel
in the equations; rounding then leaves a residual of 1e-6 of it where the displacement is accurate
to nine digits. So a solution is accepted if its residual is below the tolerance, or if it exactly
solves equations that differ from these by no more than rounding: its backward error (Rigal and
Gaches, J. ACM 14, 1967, 543-548; Higham, Accuracy and Stability of Numerical Algorithms, 2002,
section 7.1). Its distance from the exact solution follows from the energy of the error,
``|x - x*|_A / |x|_A`` with ``|e|_A^2 = e^T A e = r^T A^-1 r``.
"""

from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError

ROUNDING = 1e-14
"""Backward error that counts as rounding: Cholesky leaves 1e-17 to 1e-16 (measured)."""


class Solution(NamedTuple):
    """Result of a solve.

    Attributes
    ----------
    values : (n,) array
    iterations : int
        0 for a direct solve.
    residual : float
        ``|r| / |rhs|`` with ``r = rhs - matrix values``, computed from the matrix.
    backward_error : float
        ``|r| / (|matrix| |values| + |rhs|)``, using the largest diagonal entry, a lower bound, for
        the norm of the matrix.
    lowest : float
        Lowest eigenvalue of the preconditioned matrix found by conjugate gradients; 1 for a direct
        solve.
    """

    values: FloatArray
    iterations: int
    residual: float
    backward_error: float
    lowest: float = 1.0


def product(a: FloatArray, b: FloatArray) -> float:
    """Inner product without BLAS threads, which cost more than they save here."""
    return float(np.einsum("i,i->", a, b))


def norm(a: FloatArray) -> float:
    """Euclidean norm."""
    return float(np.sqrt(product(a, a)))


def judged(
    matrix: Any,
    x: FloatArray,
    rhs: FloatArray,
    size: float,
    iterations: int = 0,
    lowest: float = 1.0,
) -> Solution:
    """Solution with its residual and its backward error, `size` being the norm of the matrix."""
    rest, load = norm(rhs - matrix @ x), norm(rhs)
    scale = size * norm(x) + load
    return Solution(x, iterations, rest / (load or 1.0), rest / (scale or 1.0), lowest)


def reached(solution: Solution, tolerance: float) -> bool:
    """Whether a solution is as accurate as wanted, or as rounding allows."""
    return solution.residual <= tolerance or solution.backward_error <= ROUNDING


def checked(solution: Solution, tolerance: float, backend: str) -> Solution:
    """Return a solution that is accurate enough.

    Raises
    ------
    SolveError
        Where it is not.
    """
    if not reached(solution, tolerance):
        raise SolveError(
            f"{backend}: relative residual {solution.residual:.1e} after {solution.iterations} "
            f"iterations, above the tolerance {tolerance:.1e}, and backward error "
            f"{solution.backward_error:.1e}, above rounding"
        )
    return solution
