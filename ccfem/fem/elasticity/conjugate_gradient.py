"""Conjugate gradients with a given preconditioner."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity.solution import product

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
    """Highest eigenvalue of a preconditioned matrix, or slightly less, by the Lanczos method.

    Parameters
    ----------
    matrix : sparse array (n, n)
    precondition : callable
        As in `conjugate_gradient`.
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
    residual = rhs - matrix @ x if x0 is not None else rhs.copy()
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
        direction = z + beta * direction
        image = matrix @ direction
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
