"""The stress that load paths follow, at any points of a flat layer, as signed lines."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.slicing.layers.layer import LayerStress


@dataclass(frozen=True)
class StressLines:
    """Principal stress of largest absolute value at k places."""

    direction: FloatArray  # (k, 2): unit vectors of lines, whose sign is arbitrary
    value: FloatArray  # (k,), MPa: positive in tension
    # (k,): False where both principal stresses have the same absolute value (`tensor`)
    defined: BoolArray


def plane_stress_at(stress: LayerStress, points: FloatArray, reach: float) -> FloatArray:
    """Recovered plane stress [s11, s22, s12] (k, 3), MPa, at points (k, 2) of a layer.

    Points outside the layer by up to `reach`, mm, take the stress at its border; others 0.
    """
    layer = stress.layer
    cell, weights = layer.plane_triangles.locate(points, reach)
    corner = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[cell]]
    return np.where(cell[:, None] >= 0, np.einsum("kc,kci->ki", weights, corner), 0.0)


def stress_lines(plane_stress: FloatArray) -> StressLines:
    """Principal stress of largest absolute value of plane stress (k, 3), MPa."""
    value, angle, defined = strongest_in_plane(plane_stress)
    return StressLines(np.stack([np.cos(angle), np.sin(angle)], axis=-1), value, defined)


def misalignment(direction: FloatArray, lines: StressLines, undefined: float) -> FloatArray:
    """Angle beta (k,) between directions (k, 2) and the stress, degrees in [0, 90]: equation 3.

    Where the stress has no direction it is `undefined`.
    """
    cosine = np.abs(np.einsum("ki,ki->k", direction, lines.direction))
    norm = np.maximum(np.linalg.norm(direction, axis=1), 1e-300)
    angle = np.degrees(np.arccos(np.clip(cosine / norm, 0.0, 1.0)))
    return np.where(lines.defined, angle, undefined)


# The smoothness of a step of a load path: equations 4 and 5 of the paper.


_EPSILON = 0.1
"""Coefficient of a property that is 0, an arbitrary constant of the paper. Its two others, the
amplification k and eta, are 1."""


@dataclass(frozen=True)
class Criterion:
    """Criterion for a good step of a load path."""

    turn: float = 75.0  # degrees: limit of the angle alpha between one step and the next
    misalignment: float = 60.0  # degrees: limit of the angle beta between a step and the stress
    distance: float = 3.0  # mm: limit of the length d of a step

    def __call__(self, turn: ArrayLike, misalignment: ArrayLike, distance: ArrayLike) -> FloatArray:
        """Smoothness of steps, the smaller the better: equation 5, the product over all properties.

        Each property contributes its coefficient (equation 4): 0.1 at 0, and 1 at the limit.

        Parameters
        ----------
        turn, misalignment : arrays, degrees
        distance : array, mm
        """
        return (
            _coefficient(turn, self.turn)
            * _coefficient(misalignment, self.misalignment)
            * _coefficient(distance, self.distance)
        )


def _coefficient(value: ArrayLike, limit: float) -> FloatArray:
    return np.asarray(value) / limit * (1.0 - _EPSILON) + _EPSILON
