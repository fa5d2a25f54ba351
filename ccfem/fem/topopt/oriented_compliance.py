"""Cells whose material axis turns: their compliance, and where to turn the axes."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import strongest_in_plane
from ccfem.fem.plates.stiffness import turned_by
from ccfem.fem.topopt.compliance import Compliance, Response
from ccfem.fem.topopt.filters import ConeFilter

_LARGEST_TURN = np.radians(5.0)
"""Of a gradient step."""


@dataclass(frozen=True)
class OrientedCompliance:
    """Compliance of a part whose material axis turns from group to group, about z.

    Attributes
    ----------
    part : Compliance
    harmonics : (5, k, k) array, MPa
        Of the material: see `ccfem.fem.topopt.material_axes.harmonics`.
    angle : (g,) array, radians
        From global axis x to the material axis.
    """

    part: Compliance
    harmonics: FloatArray
    angle: FloatArray

    def stiffness(self, derivative: bool = False) -> FloatArray:
        """Stiffness (g, k, k) in the global axes, MPa, or its derivative by the angle."""
        return np.einsum("mk,kij->mij", turned_by(self.angle, derivative), self.harmonics)

    def __call__(self, factor: FloatArray) -> Response:
        """Response with a factor (g,) on the stiffness of each group."""
        return self.part(factor, self.stiffness())

    def angle_gradient(self, response: Response, factor: FloatArray) -> FloatArray:
        """Differentiate the compliance by the angle of each group: (g,) array, N mm."""
        slope, energy = self.stiffness(derivative=True), np.zeros(len(factor))
        for case, displacement in response.displacement.items():
            energy += self.part.weights[case] * self.part.energy(displacement, slope)
        return -factor * energy

    def principal(self, response: Response, factor: FloatArray) -> FloatArray:
        """Double-angle vectors (g, 2) of the principal stress of largest size, times that size.

        The stress is that in the x-y plane.
        """
        stiffness, total = self.stiffness(), np.zeros((len(factor), 2))
        for case, displacement in response.displacement.items():
            stress = factor[:, None] * self.part.stress(displacement, stiffness)
            value, angle, _ = strongest_in_plane(stress)
            size = self.part.weights[case] * np.abs(value)
            total += size[:, None] * _doubled(angle)
        return total


Turn = Callable[[OrientedCompliance, Response, FloatArray], OrientedCompliance]
"""Compliance of the next iteration, from that of this one, its response and factors (g,)."""


def to_principal_stress(
    model: OrientedCompliance,
    response: Response,
    factor: FloatArray,
    cone: ConeFilter,
    relaxation: float,
) -> OrientedCompliance:
    """Turn towards the filtered direction of the principal stress of largest size."""
    wanted = cone.average(model.principal(response, factor))
    size = np.linalg.norm(wanted, axis=1)
    present = _doubled(model.angle)
    direction = np.where(
        size[:, None] > 0.0, wanted / np.where(size > 0.0, size, 1.0)[:, None], present
    )
    mixed = (1.0 - relaxation) * present + relaxation * direction
    # At right angles the two cancel: turn at once.
    lost = np.linalg.norm(mixed, axis=1) < 1e-6
    mixed[lost] = direction[lost]
    return replace(model, angle=0.5 * np.arctan2(mixed[:, 1], mixed[:, 0]))


def down_the_gradient(
    model: OrientedCompliance, response: Response, factor: FloatArray, cone: ConeFilter
) -> OrientedCompliance:
    """Step down the filtered gradient, by 5 degrees where it reaches its 90th percentile."""
    gradient = cone.average(model.angle_gradient(response, factor) / cone.volumes)
    scale = float(np.percentile(np.abs(gradient), 90.0))
    if not scale > 0.0:
        return model
    step = model.angle - _LARGEST_TURN * np.clip(gradient / scale, -1.0, 1.0)
    return replace(model, angle=0.5 * np.arctan2(np.sin(2 * step), np.cos(2 * step)))


def _doubled(angle: FloatArray) -> FloatArray:
    """Vectors (g, 2) of length 1 at twice the angles (g,): lines, whatever their sense."""
    return np.stack([np.cos(2 * angle), np.sin(2 * angle)], axis=1)
