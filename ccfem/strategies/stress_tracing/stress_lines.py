"""The stress that load paths follow, at any points of a flat layer, as signed lines."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.geometry.locate import locate
from ccfem.slicing.layers.layer_stress import LayerStress


@dataclass(frozen=True)
class StressLines:
    """Principal stress of largest absolute value at k places.

    Attributes
    ----------
    direction : (k, 2) array
        Unit vectors of lines, whose sign is arbitrary.
    value : (k,) array, MPa
        Positive in tension.
    defined : (k,) bool array
        False where both principal stresses have the same absolute value (`tensor`).
    """

    direction: FloatArray
    value: FloatArray
    defined: BoolArray


def plane_stress_at(stress: LayerStress, points: FloatArray, reach: float) -> FloatArray:
    """Recovered plane stress [s11, s22, s12] (k, 3), MPa, at points (k, 2) of a layer.

    Points outside the layer by up to `reach`, mm, take the stress at its border; others 0.
    """
    layer = stress.layer
    cell, weights = locate(layer.plane.points, layer.triangles, points, reach)
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
