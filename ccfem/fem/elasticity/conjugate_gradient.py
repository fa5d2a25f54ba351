"""Conjugate gradients with a given preconditioner, and the accuracy of a solution."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError
from ccfem.fem.elasticity.block_product import times

_LANCZOS = 6
"""Steps after which the highest eigenvalue is accurate to about six per cent."""


def conjugate_gradient(
    matrix: Any,
    rhs: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    x0: FloatArray | None = None,
    tolerance: float = 1e-8,
    most: int = 1000,
) -> tuple[FloatArray, int, float]:
    """Solve a symmetric positive definite system (Saad, Iterative Methods, 2003, algorithm 9.1).

    The step length ``beta`` is that of Polak and Ribiere, which tolerates a slightly unsymmetric
    preconditioner.

    Parameters
    ----------
    matrix : sparse array (n, n)
    rhs : (n,) array
    precondition : callable
        Approximate solution (n,) for a residual (n,).
    x0 : (n,) array, optional
        Start of the iteration; default zero.
    tolerance : float
        On ``|rhs - matrix x| / |rhs|``.
    most : int
        Largest number of iterations; the caller checks the residual.

    Returns
    -------
    x : (n,) array
    iterations : int
    lowest : float
        Lowest eigenvalue of the preconditioned matrix that the directions span (Saad, section
        6.7.3), not below the lowest of all; 1 without any iteration.
    """
    x, steps, ratios = _iterate(matrix, rhs, precondition, x0, tolerance, most)
    return x, len(steps), float(_eigenvalues(steps, ratios).min())


def highest_eigenvalue(matrix: Any, precondition: Callable[[FloatArray], FloatArray]) -> float:
    """Highest eigenvalue of a matrix preconditioned as in `conjugate_gradient`, or slightly less.

    By the Lanczos method.
    """
    rhs = np.random.default_rng(0).normal(size=matrix.shape[0])
    _, steps, ratios = _iterate(matrix, rhs, precondition, None, 0.0, _LANCZOS)
    return float(_eigenvalues(steps, ratios).max())


def _iterate(
    matrix: Any,
    rhs: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    x0: FloatArray | None,
    tolerance: float,
    most: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solution, and the lengths and ratios of the steps."""
    x = np.zeros_like(rhs) if x0 is None else np.array(x0, dtype=np.float64)
    residual = rhs - times(matrix, x) if x0 is not None else rhs.copy()
    target = tolerance**2 * product(rhs, rhs)
    direction = np.zeros_like(rhs)
    previous, old = residual, 1.0
    steps: list[float] = []
    ratios: list[float] = []
    for iteration in range(most):
        if not product(residual, residual) > target:
            break
        z = precondition(residual)
        new = product(residual, z)
        beta = (new - product(previous, z)) / old if iteration else 0.0
        direction *= beta
        direction += z
        image = times(matrix, direction)
        curvature = product(direction, image)
        if not curvature > 0.0:  # not positive definite, or no direction left
            break
        step = new / curvature
        x += step * direction
        previous, old = residual, new
        residual = residual - step * image
        steps.append(step)
        ratios.append(max(beta, 0.0))
    return x, np.array(steps), np.array(ratios)


def _eigenvalues(steps: FloatArray, ratios: FloatArray) -> FloatArray:
    """Eigenvalues of the tridiagonal matrix that the steps make up."""
    if not len(steps):
        return np.ones(1)
    diagonal = 1.0 / steps
    diagonal[1:] += ratios[1:] / steps[:-1]
    return np.asarray(eigvalsh_tridiagonal(diagonal, np.sqrt(ratios[1:]) / steps[:-1]))


# Result of a solve, its accuracy, and whether that is sufficient.
#
# A residual says little by itself. On a slender part the load is tiny beside the forces that cancel
# in the equations; rounding then leaves a residual of 1e-6 of it where the displacement is accurate
# to nine digits. So a solution is accepted if its residual is below the tolerance, or if it exactly
# solves equations that differ from these by no more than rounding: its backward error (Rigal and
# Gaches, J. ACM 14, 1967, 543-548; Higham, Accuracy and Stability of Numerical Algorithms, 2002,
# section 7.1). Its distance from the exact solution follows from the energy of the error, ``|x -
# x*|_A / |x|_A`` with ``|e|_A^2 = e^T A e = r^T A^-1 r``.


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
    rest, load = norm(rhs - times(matrix, x)), norm(rhs)
    scale = size * norm(x) + load
    return Solution(x, iterations, rest / (load or 1.0), rest / (scale or 1.0), lowest)


def reached(solution: Solution, tolerance: float) -> bool:
    """Whether a solution is as accurate as wanted, or as rounding allows."""
    return solution.residual <= tolerance or solution.backward_error <= ROUNDING


def checked(solution: Solution, tolerance: float, backend: str) -> Solution:
    """Return a solution that is accurate enough."""
    if not reached(solution, tolerance):
        raise SolveError(
            f"{backend}: relative residual {solution.residual:.1e} after {solution.iterations} "
            f"iterations, above the tolerance {tolerance:.1e}, and backward error "
            f"{solution.backward_error:.1e}, above rounding"
        )
    return solution
