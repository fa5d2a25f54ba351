"""Stiffness of a material whose axis turns about z."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.fem.plates.stiffness import fitted_harmonics, rotate_plane, turned_by


def sheet(plane: FloatArray) -> FloatArray:
    """Stiffness (6, 6) of a solid that is strained in its plane as a thin sheet, MPa.

    Parameters
    ----------
    plane : (3, 3) array, MPa
        Plane stress stiffness of the sheet.

    Returns
    -------
    (6, 6) array, MPa
        Stress and strain along z are uncoupled from those in the plane; the shears across it are
        as stiff as the one in it. For tetrahedra that are held along z at every node.
    """
    solid = np.diag([0.0, 0.0, 0.5 * (plane[0, 0] + plane[1, 1]), plane[2, 2], plane[2, 2], 0.0])
    solid[np.ix_([0, 1, 5], [0, 1, 5])] = plane
    return solid


def axes_about_z(angle: FloatArray) -> FloatArray:
    """Axes (m, 3, 3) as columns, turned about z by angles (m,), radians."""
    axes = np.zeros((len(angle), 3, 3))
    axes[:, 0, 0] = axes[:, 1, 1] = np.cos(angle)
    axes[:, 1, 0], axes[:, 0, 1], axes[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
    return axes


def harmonics(material: FloatArray) -> FloatArray:
    """Five matrices (5, k, k) that give the stiffness turned about z, as `turned_by` combines them.

    Constant, cos 2a, sin 2a, cos 4a, sin 4a; for an orthotropic sheet the invariants U1 to U5 of
    Tsai and Pagano (1968).

    Parameters
    ----------
    material : (3, 3) or (6, 6) array, MPa
        In material axes.

    Raises
    ------
    InputError
        For a solid that is not symmetric about the x-y plane.
    """
    if material.shape == (3, 3):
        return fitted_harmonics(lambda angle: rotate_plane(material, angle))

    def turned(angle: FloatArray) -> FloatArray:
        return rotate_stiffness(material, axes_about_z(angle))

    fitted = fitted_harmonics(turned)
    other = np.array([0.3, 1.9])
    missed = turned(other) - np.tensordot(turned_by(other), fitted, axes=1)
    if np.abs(missed).max() > 1e-9 * np.abs(material).max():
        raise InputError(
            "a material whose axis turns about z must be symmetric about the x-y plane: "
            "give one with an axis of symmetry along z"
        )
    return fitted
