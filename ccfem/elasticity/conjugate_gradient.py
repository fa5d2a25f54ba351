"""Conjugate gradients with a preconditioner that somebody else made."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ccfem.arrays import FloatArray

__all__ = ["conjugate_gradient"]


def _dot(a: FloatArray, b: FloatArray) -> float:
    """Inner product without the threads of a BLAS, which cost more than they save here."""
    return float(np.einsum("i,i->", a, b))


def conjugate_gradient(
    matrix: Any,
    rhs: FloatArray,
    precondition: Callable[[FloatArray], FloatArray],
    x0: FloatArray | None = None,
    tolerance: float = 1e-8,
    most: int = 1000,
) -> tuple[FloatArray, int]:
    """Solve a symmetric positive definite system (Saad, Iterative Methods, 2003, algorithm 9.1).

    The step length ``beta`` is Polak and Ribiere's, which forgives a preconditioner that is not
    quite symmetric.

    Parameters
    ----------
    matrix : sparse array (n, n)
    rhs : (n,) array
    precondition : callable
        Approximate solution (n,) for a residual (n,).
    x0 : (n,) array, optional
        Where to start; default zero.
    tolerance : float
        On ``|rhs - matrix x| / |rhs|``.
    most : int
        Iterations after which to give up; the caller checks the residual.

    Returns
    -------
    x : (n,) array
    iterations : int
    """
    x = np.zeros_like(rhs) if x0 is None else np.array(x0, dtype=np.float64)
    residual = rhs - matrix @ x if x0 is not None else rhs.copy()
    target = tolerance**2 * _dot(rhs, rhs)
    direction = np.zeros_like(rhs)
    previous, old = residual, 1.0
    for iteration in range(most):
        if not _dot(residual, residual) > target:
            return x, iteration
        z = precondition(residual)
        new = _dot(residual, z)
        beta = (new - _dot(previous, z)) / old if iteration else 0.0
        direction = z + beta * direction
        image = matrix @ direction
        curvature = _dot(direction, image)
        if not curvature > 0.0:  # not positive definite, or no direction left
            return x, iteration
        step = new / curvature
        x += step * direction
        previous, old = residual, new
        residual = residual - step * image
    return x, most
