"""Direction and size of the tension at every point [Chen et al. 2021, section 4.1]."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import largest_in_plane, principal, strongest
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class Tension:
    """Tension at k places, such as the triangles of a layer or the tetrahedra of a part.

    Attributes
    ----------
    direction : (k, 2) array in a plane, (k, 3) in space
        Unit vectors; arbitrary where undefined.
    stress : (k,) array, MPa
        Tensile stress along the direction, 0 where there is none. The paper uses 1e-5 MPa, which
        would count more, the smaller the load is.
    defined : (k,) bool array
        Whether there is a tensile direction.
    oriented : bool
        Whether neighbouring vectors point the same way. Otherwise they are lines, whose sign is
        arbitrary.
    """

    direction: FloatArray
    stress: FloatArray
    defined: BoolArray
    oriented: bool = False

    def on(self, layer: Layer) -> "Tension":
        """Project from tetrahedra to a flat layer: each triangle takes the values of its cell."""
        direction = self.direction[layer.cell]
        if layer.turns is not None:
            direction = np.einsum("tij,tj->ti", layer.turns, direction)
        plane = direction @ layer.plane.frame[:2].T
        length = np.linalg.norm(plane, axis=1)
        defined = self.defined[layer.cell] & (length > 1e-6)
        unit = plane / np.maximum(length, 1e-300)[:, None]
        unit = np.where(defined[:, None], unit, [1.0, 0.0])
        return Tension(unit, self.stress[layer.cell], defined, self.oriented)


def spatial_tension(stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of stress tensors in space, by the paper's rule.

    Principal stresses are sorted by absolute value, largest first. The first is used if it is
    tensile. Otherwise the second is used if it is tensile, and the first is less than
    `compression_limit` times as large. Otherwise there is no tensile direction, and the first
    direction replaces it.

    Parameters
    ----------
    stress : (k, 3, 3) array, MPa
    compression_limit : float, default 3.0
        The paper's mu.
    """
    values, directions = principal(stress)
    order = np.argsort(-np.abs(values), axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    directions = np.take_along_axis(directions, order[:, None, :], axis=2)
    first = values[:, 0] > 0.0
    second = ~first & (values[:, 1] > 0.0) & (-values[:, 0] < compression_limit * values[:, 1])
    taken = np.where(second, 1, 0)
    rows = np.arange(len(values))
    defined = first | second
    size = np.where(defined, values[rows, taken], 0.0)
    return Tension(directions[rows, :, taken], size, defined)


def plane_tension(plane_stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of plane stress, by the paper's rule applied in the plane of the layer.

    A fibre in a flat layer carries only the stress in its plane, so planning uses this by default.
    For in-plane stress it equals the projection of `spatial_tension`. The plane stress (k, 3), MPa,
    is s11, s22, s12; the limit is the paper's mu.
    """
    largest, smallest, angle = largest_in_plane(plane_stress)
    defined = (largest > 0.0) & (-smallest < compression_limit * largest)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    compressed, _ = strongest(largest, smallest)
    direction = np.where((compressed & ~defined)[:, None], across, direction)
    return Tension(direction, np.where(defined, largest, 0.0), defined)
