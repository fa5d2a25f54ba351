"""What a solve found, how good it is, and whether that is good enough.

A residual says little by itself: on a slender part the load is tiny beside the forces that cancel
in the equations, and rounding leaves a residual of 1e-6 of it where the displacement is right to
nine digits. So a solution counts as reached when its residual is below the tolerance, or when it
solves exactly equations that differ from these by no more than rounding: its backward error
(Rigal and Gaches, J. ACM 14, 1967, 543-548; Higham, Accuracy and Stability of Numerical
Algorithms, 2002, section 7.1). How far it lies from the exact solution is told by the energy of
the error, ``|x - x*|_A / |x|_A`` with ``|e|_A^2 = e^T A e = r^T A^-1 r``.
"""

from typing import Any, NamedTuple

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.errors import SolveError

__all__ = ["ROUNDING", "Solution", "checked", "judged", "norm", "product", "reached"]

ROUNDING = 1e-14
"""Backward error that counts as rounding: what Cholesky leaves is 1e-17 to 1e-16 (measured)."""


class Solution(NamedTuple):
    """What a solve found.

    Attributes
    ----------
    values : (n,) array
    iterations : int
        0 for a direct solve.
    residual : float
        ``|r| / |rhs|`` with ``r = rhs - matrix values``, computed from the matrix.
    backward_error : float
        ``|r| / (|matrix| |values| + |rhs|)``, with the largest diagonal entry for the norm of the
        matrix, which it does not exceed.
    lowest : float
        Lowest eigenvalue of the preconditioned matrix that conjugate gradients saw; 1 for a direct
        solve.
    """

    values: FloatArray
    iterations: int
    residual: float
    backward_error: float
    lowest: float = 1.0


def product(a: FloatArray, b: FloatArray) -> float:
    """Inner product without the threads of a BLAS, which cost more than they save here."""
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
    """Whether a solution is as good as wanted, or as rounding lets it be."""
    return solution.residual <= tolerance or solution.backward_error <= ROUNDING


def checked(solution: Solution, tolerance: float, backend: str) -> Solution:
    """Return a solution that is good enough.

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
