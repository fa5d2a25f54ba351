"""Symmetric tensors: component order, rotations, principal values.

Voigt order is 11, 22, 33, 23, 13, 12; strains in Voigt form carry engineering shear (twice the
tensor component).
"""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray

_ROWS = np.array([0, 1, 2, 1, 0, 0])
_COLUMNS = np.array([0, 1, 2, 2, 2, 1])
_SQUARE = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_ENGINEERING = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])

_EQUAL = 0.02
"""Share of the larger absolute value by which principal values may differ and still have no
strongest direction: in pure shear two perpendicular directions are equally strong."""


def to_voigt(stress: FloatArray) -> FloatArray:
    """Stress tensors (..., 3, 3) to Voigt vectors (..., 6), MPa."""
    if stress.shape[-2:] != (3, 3):
        raise ValueError(
            f"stress must have shape (..., 3, 3); got {stress.shape}: use tensor.from_voigt"
        )
    return stress[..., _ROWS, _COLUMNS]


def from_voigt(stress: FloatArray) -> FloatArray:
    """Stress Voigt vectors (..., 6) to tensors (..., 3, 3), MPa."""
    if stress.shape[-1:] != (6,):
        raise ValueError(
            f"stress must have shape (..., 6); got {stress.shape}: use tensor.to_voigt"
        )
    return stress[..., _SQUARE]


def strain_to_voigt(strain: FloatArray) -> FloatArray:
    """Strain tensors (..., 3, 3) to Voigt vectors (..., 6) with engineering shear."""
    return to_voigt(strain) * _ENGINEERING


def strain_from_voigt(strain: FloatArray) -> FloatArray:
    """Strain Voigt vectors (..., 6) with engineering shear to tensors (..., 3, 3)."""
    return from_voigt(strain / _ENGINEERING)


def bond_matrix(axes: FloatArray) -> FloatArray:
    """Bond matrices that rotate Voigt stress from material axes to the global frame.

    Parameters
    ----------
    axes : (..., 3, 3) array
        Material axes as columns: ``global = axes @ local``.

    Returns
    -------
    (..., 6, 6) array
        M with ``stress_global = M @ stress_local``; a stiffness rotates as ``M C M.T`` (Auld,
        Acoustic Fields and Waves in Solids, 1973, eq. 3.34).
    """
    a, b = axes[..., _ROWS, :], axes[..., _COLUMNS, :]
    product = 0.5 * (
        a[..., :, _ROWS] * b[..., :, _COLUMNS] + a[..., :, _COLUMNS] * b[..., :, _ROWS]
    )
    return product * _ENGINEERING


def rotate_stiffness(stiffness: FloatArray, axes: FloatArray) -> FloatArray:
    """Rotate stiffness matrices (..., 6, 6) from material axes to the global frame, MPa."""
    matrix = bond_matrix(axes)
    return matrix @ stiffness @ np.swapaxes(matrix, -1, -2)


def principal(stress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal stresses, largest first, and their directions.

    Parameters
    ----------
    stress : (..., 3, 3) array, MPa

    Returns
    -------
    values : (..., 3) array, MPa
        Sorted from the largest (most tensile) to the smallest.
    directions : (..., 3, 3) array
        ``directions[..., :, k]`` is the unit vector of ``values[..., k]``. It is a line: its sign
        is arbitrary, and where values coincide so is the vector in their plane.
    """
    values, directions = np.linalg.eigh(stress)
    return values[..., ::-1], directions[..., ::-1]


def von_mises(stress: FloatArray) -> FloatArray:
    """Von Mises stress (...,) of stress tensors (..., 3, 3), MPa."""
    mean = np.trace(stress, axis1=-2, axis2=-1) / 3.0
    deviator = stress - mean[..., None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("...ij,...ij->...", deviator, deviator))


def in_plane(stress: FloatArray, frame: FloatArray) -> FloatArray:
    """Components s11, s22, s12, MPa, (..., 3), of stress (..., 3, 3), MPa, in a plane.

    Its unit vectors are the first two rows of a frame (2 or 3, 3).
    """
    e1, e2 = frame[0], frame[1]
    first, second = stress @ e1, stress @ e2
    return np.stack([first @ e1, second @ e2, first @ e2], axis=-1)


def in_axes(tensor: FloatArray, axes: FloatArray) -> FloatArray:
    """Components of tensors (..., 3, 3) along other axes (..., 3, 3), whose rows they are."""
    return np.asarray(axes @ tensor @ np.swapaxes(axes, -1, -2))


def largest_in_plane(plane_stress: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Larger and smaller principal value of plane stress (..., 3), and the angle of the larger one.

    The stress is s11, s22, s12. The angle, radians, is to axis 1, in (-pi/2, pi/2]; where both
    values coincide it is 0 and meaningless.
    """
    s11, s22, s12 = np.moveaxis(plane_stress, -1, 0)
    mean, half = 0.5 * (s11 + s22), 0.5 * (s11 - s22)
    radius = np.hypot(half, s12)
    return mean + radius, mean - radius, 0.5 * np.arctan2(s12, half)


def strongest(largest: FloatArray, smallest: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Find which of two in-plane principal values has the larger absolute value.

    Parameters
    ----------
    largest, smallest : (...,) arrays, MPa
        As from `largest_in_plane`.

    Returns
    -------
    across : (...,) bool array
        True where ``|smallest| > |largest|``: the strongest direction is perpendicular to
        that of `largest`.
    defined : (...,) bool array
        True where the sizes differ by more than 2 % of the larger one.
    """
    high, low = np.abs(largest), np.abs(smallest)
    return low > high, np.abs(high - low) > _EQUAL * np.maximum(high, low)


def strongest_in_plane(plane_stress: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Principal value of plane stress of largest absolute value, in tension or compression.

    Parameters
    ----------
    plane_stress : (..., 3) array, MPa
        s11, s22, s12.

    Returns
    -------
    value : (...,) array, MPa
        Positive in tension; the tension where both values are of one size.
    angle : (...,) array, radians
        Of its direction to axis 1, in (-pi/2, pi].
    defined : (...,) bool array
        Where there is one such direction: see `strongest`.
    """
    largest, smallest, angle = largest_in_plane(plane_stress)
    across, defined = strongest(largest, smallest)
    return np.where(across, smallest, largest), angle + 0.5 * np.pi * across, defined
