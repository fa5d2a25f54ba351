"""Stiffness of fibre layers in the plane: turned, and stacked."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError


def _stress_matrix(angle: ArrayLike) -> FloatArray:
    """T (..., 3, 3) with ``stress_global = T @ stress_local`` for axes turned by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [[c * c, s * s, -2 * c * s], [s * s, c * c, 2 * c * s], [c * s, -c * s, c * c - s * s]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotate_plane(stiffness: FloatArray, angle: ArrayLike) -> FloatArray:
    """Turn plane stiffness from material axes to the global ones.

    Parameters
    ----------
    stiffness : (3, 3) or (..., 3, 3) array, MPa
        In material axes, as from `ccfem.fem.materials.plane_stress`.
    angle : (...,) array, radians
        From global axis x to the fibre, counter-clockwise.

    Returns
    -------
    (..., 3, 3) array, MPa
        ``T Q T^T`` (Jones, Mechanics of Composite Materials, 1999, eq. 2.84).
    """
    turn = _stress_matrix(angle)
    return turn @ stiffness @ np.swapaxes(turn, -1, -2)


def fitted_harmonics(turned: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Five matrices (5, k, k) that `turned_by` combines to a stiffness turned about z.

    Parameters
    ----------
    turned : callable
        Stiffness (a, k, k) at angles (a,), radians.
    """
    angles = np.asarray(np.arange(5) * np.pi / 5.0, dtype=np.float64)
    return np.tensordot(np.linalg.inv(turned_by(angles)), turned(angles), axes=1)


def turned_by(angle: FloatArray, derivative: bool = False) -> FloatArray:
    """Factors (..., 5) of `fitted_harmonics` at an angle (...,), radians, or their derivatives."""
    two, four = 2.0 * angle, 4.0 * angle
    if derivative:
        parts = [0.0 * two, -2 * np.sin(two), 2 * np.cos(two), -4 * np.sin(four), 4 * np.cos(four)]
    else:
        parts = [1.0 + 0.0 * two, np.cos(two), np.sin(two), np.cos(four), np.sin(four)]
    return np.stack(parts, axis=-1)


def stack_plane(layers: FloatArray, thickness: ArrayLike | None = None) -> FloatArray:
    """Stiffness of layers that share the strain in their plane.

    Parameters
    ----------
    layers : (L, ..., 3, 3) array, MPa
        Of each layer in the global axes.
    thickness : (L,) array, optional
        Of each layer, in any unit; default equal.

    Returns
    -------
    (..., 3, 3) array, MPa
        The mean weighted by thickness: ``A / h`` of classical lamination theory (Jones, eq. 4.24).
    """
    layers = np.asarray(layers, dtype=np.float64)
    weights = np.ones(len(layers)) if thickness is None else np.asarray(thickness, dtype=np.float64)
    if weights.shape != (len(layers),) or not (weights > 0.0).all():
        raise InputError(
            f"thickness must be {len(layers)} positive numbers, one a layer; got {thickness!r}"
        )
    return np.tensordot(weights / weights.sum(), layers, axes=1)


def stress_in_axes(stress: FloatArray, angle: ArrayLike) -> FloatArray:
    """Components of plane stress (..., 3), MPa, in axes turned by an angle (...,), radians."""
    return np.einsum("...ij,...j->...i", _stress_matrix(-np.asarray(angle)), stress)


def strain_in_axes(strain: FloatArray, angle: ArrayLike) -> FloatArray:
    """Components of plane strain (..., 3), engineering shear, in axes turned by an angle."""
    turn = np.swapaxes(_stress_matrix(np.asarray(angle)), -1, -2)
    return np.einsum("...ij,...j->...i", turn, strain)
