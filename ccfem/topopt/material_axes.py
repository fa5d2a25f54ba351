"""Material axes that turn in the plane of a part: its compliance, and where to turn them."""

from collections.abc import Callable

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.errors import InputError
from ccfem.plates.stiffness import plane_harmonics, turned_by
from ccfem.tensor import rotate_stiffness, strongest_in_plane
from ccfem.topopt.compliance import GroupedCompliance, Loaded, PlaneCompliance, TetCompliance
from ccfem.topopt.filters import ConeFilter

__all__ = [
    "OrientedCompliance",
    "axes_about_z",
    "by_gradient",
    "by_principal_stress",
    "harmonics",
    "sheet",
]

_LARGEST_TURN = np.radians(5.0)
"""Of a gradient step."""

Part = PlaneCompliance | TetCompliance | GroupedCompliance


def sheet(plane: FloatArray) -> FloatArray:
    """Stiffness (6, 6) of a solid that is strained in its plane as a thin sheet, MPa.

    Parameters
    ----------
    plane : (3, 3) array, MPa
        Plane stress stiffness of the sheet.

    Returns
    -------
    (6, 6) array, MPa
        Stress and strain along z have nothing to do with those in the plane; the shears across it
        are as stiff as the one in it. For tetrahedra that are held along z at every node.
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

    Parameters
    ----------
    material : (3, 3) or (6, 6) array, MPa

    Raises
    ------
    InputError
        For a solid that is not alike on both sides of the x-y plane.
    """
    if material.shape == (3, 3):
        return plane_harmonics(material)

    def turned(angle: FloatArray) -> FloatArray:
        return rotate_stiffness(material, axes_about_z(angle))

    angles = np.asarray(np.arange(5) * np.pi / 5.0, dtype=np.float64)
    found = np.tensordot(np.linalg.inv(turned_by(angles)), turned(angles), axes=1)
    other = np.array([0.3, 1.9])
    missed = turned(other) - np.tensordot(turned_by(other), found, axes=1)
    if np.abs(missed).max() > 1e-9 * np.abs(material).max():
        raise InputError(
            "a material whose axis turns about z must be alike on both sides of the x-y plane: "
            "give one with an axis of symmetry along z"
        )
    return found


class OrientedCompliance:
    """Compliance of a part whose material axis turns from cell to cell, about z.

    Parameters
    ----------
    part : PlaneCompliance, TetCompliance or GroupedCompliance
        With one angle for each of its m cells or groups.
    material : (k, k) array, MPa
        Stiffness in material axes: (3, 3) of a plate, (6, 6) of tetrahedra.
    angle : (m,) array, radians
        From global axis x to the material axis, at the start.
    turn : callable, optional
        New angles (m,) from this value and its answer and the factors (m,); applied between one
        call and the next.
    """

    def __init__(
        self,
        part: Part,
        material: FloatArray,
        angle: FloatArray,
        turn: "Turn | None" = None,
    ) -> None:
        self.part, self.angle = part, angle
        self.centres, self.volumes = part.centres, part.volumes
        self._harmonics = harmonics(material)
        self._turn = turn
        self._next = angle

    def stiffness(self, derivative: bool = False) -> FloatArray:
        """Stiffness (m, k, k) in the global axes, MPa, or its derivative by the angle."""
        return np.einsum("mk,kij->mij", turned_by(self.angle, derivative), self._harmonics)

    def __call__(self, factor: FloatArray) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell, at the present angles."""
        self.angle = self._next
        answer = self.part(factor, self.stiffness())
        if self._turn is not None:
            self._next = self._turn(self, answer, factor)
        return answer

    def angle_gradient(self, answer: Loaded, factor: FloatArray) -> FloatArray:
        """Differentiate the compliance by the angle of each cell: (m,) array, N mm."""
        slope, energy = self.stiffness(derivative=True), np.zeros(len(factor))
        for case, displacement in answer.displacement.items():
            energy += self.part.weights[case] * self.part.energy(displacement, slope)
        return -factor * energy

    def principal(self, answer: Loaded, factor: FloatArray) -> FloatArray:
        """Double-angle vectors (m, 2) of the principal stress of largest size, times that size.

        The stress is that in the x-y plane.
        """
        stiffness, total = self.stiffness(), np.zeros((len(factor), 2))
        for case, displacement in answer.displacement.items():
            stress = factor[:, None] * self.part.stress(displacement, stiffness)
            value, angle, _ = strongest_in_plane(stress)
            size = self.part.weights[case] * np.abs(value)
            total += size[:, None] * np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=1)
        return total


Turn = Callable[[OrientedCompliance, Loaded, FloatArray], FloatArray]


def by_principal_stress(cone: ConeFilter, relaxation: float) -> Turn:
    """Turn towards the filtered direction of the largest principal stress."""

    def turn(part: OrientedCompliance, answer: Loaded, factor: FloatArray) -> FloatArray:
        wanted = cone.average(part.principal(answer, factor))
        size = np.linalg.norm(wanted, axis=1)
        present = np.stack([np.cos(2 * part.angle), np.sin(2 * part.angle)], axis=1)
        direction = np.where(
            size[:, None] > 0.0, wanted / np.where(size > 0.0, size, 1.0)[:, None], present
        )
        mixed = (1.0 - relaxation) * present + relaxation * direction
        # At right angles the two cancel: turn at once.
        lost = np.linalg.norm(mixed, axis=1) < 1e-6
        mixed[lost] = direction[lost]
        return 0.5 * np.arctan2(mixed[:, 1], mixed[:, 0])

    return turn


def by_gradient(cone: ConeFilter) -> Turn:
    """Step down the filtered gradient, by 5 degrees where it is as large as at most cells."""

    def turn(part: OrientedCompliance, answer: Loaded, factor: FloatArray) -> FloatArray:
        gradient = cone.average(part.angle_gradient(answer, factor) / part.volumes)
        scale = float(np.percentile(np.abs(gradient), 90.0))
        if not scale > 0.0:
            return part.angle
        step = part.angle - _LARGEST_TURN * np.clip(gradient / scale, -1.0, 1.0)
        return 0.5 * np.arctan2(np.sin(2 * step), np.cos(2 * step))

    return turn
