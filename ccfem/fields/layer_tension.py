"""Tension sampled on the triangles of a layer: from its own plane, or from the whole part."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.elasticity.part_stress import PartStress
from ccfem.fields.compatibility import Incompatible, incompatible
from ccfem.fields.orientation import orient
from ccfem.fields.tensile import Tension, plane_tension, spatial_tension
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import LayerStress
from ccfem.tensor import in_plane, strongest_in_plane

__all__ = ["MeshTension", "SampledTension", "layer_tension", "mesh_tension"]


_ANY_COMPRESSION = 1e12
"""Limit of compression over tension that rules nothing out."""


@dataclass(frozen=True)
class SampledTension:
    """Tension on the t triangles of a layer.

    Attributes
    ----------
    direction : (t, 2) array
        Unit vectors in plane coordinates; arbitrary where undefined.
    stress : (t,) array, MPa
    defined : (t,) bool array
    oriented : bool
        Whether neighbouring vectors already point the same way.
    """

    direction: FloatArray
    stress: FloatArray
    defined: BoolArray
    oriented: bool


def layer_tension(
    stress: LayerStress,
    source: Literal["nodal", "cell"] = "nodal",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
) -> SampledTension:
    """Tension of the stress in the plane of a layer.

    Parameters
    ----------
    stress : LayerStress
    source : {"nodal", "cell"}
        Recovered stress, averaged over the corners of each triangle, or that of its tetrahedron.
    sense : {"tensile", "absolute"}
        Take the tensile principal stress, or the one of the largest size.
    compression_limit : float, default 3.0
        See `fields.tensile.plane_tension`.
    """
    layer = stress.layer
    tensors = stress.cell if source == "cell" else stress.nodal[layer.triangles].mean(axis=1)
    plane = in_plane(tensors, layer.plane.frame)
    tension = plane_tension(plane, compression_limit)
    if sense == "absolute":
        tension = _absolute(plane)
    return SampledTension(tension.direction, tension.stress, tension.defined, oriented=False)


def _absolute(plane: FloatArray) -> Tension:
    """Direction and size of the principal stress of the largest size, whatever its sign."""
    value, angle, _ = strongest_in_plane(plane)
    size = np.abs(value)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Tension(direction, size, size > 0.0)


@dataclass(frozen=True)
class MeshTension:
    """Oriented and filtered tension of every tetrahedron.

    Attributes
    ----------
    direction : (m, 3) array
    stress : (m,) array, MPa
    defined : (m,) bool array
    """

    direction: FloatArray
    stress: FloatArray
    defined: BoolArray

    def on(self, layer: Layer) -> SampledTension:
        """Project to a layer: each triangle takes the vector and stress of its tetrahedron."""
        plane = self.direction[layer.cell] @ layer.plane.frame[:2].T
        length = np.linalg.norm(plane, axis=1)
        defined = self.defined[layer.cell] & (length > 1e-6)
        unit = plane / np.maximum(length, 1e-300)[:, None]
        unit = np.where(defined[:, None], unit, [1.0, 0.0])
        return SampledTension(unit, self.stress[layer.cell], defined, oriented=True)


def mesh_tension(
    stress: PartStress,
    source: Literal["nodal", "cell"] = "cell",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
    rule: Incompatible = "any",
) -> MeshTension:
    """Tension in space of all tetrahedra, as Chen et al. 2021 section 4.1 processes it.

    Vectors are chosen by `spatial_tension`, oriented along the minimum spanning tree over the
    faces (cells without a tensile direction take part in that only), and undefined where the
    filter finds them incompatible; the stress is kept there.
    """
    cells = stress.mesh.corners
    tensors = stress.stress if source == "cell" else stress.nodal[cells].mean(axis=1)
    tension = spatial_tension(tensors, compression_limit)
    if sense == "absolute":
        pushed = spatial_tension(-tensors, _ANY_COMPRESSION)
        push = pushed.stress > tension.stress
        tension = Tension(
            np.where(push[:, None], pushed.direction, tension.direction),
            np.where(push, pushed.stress, tension.stress),
            tension.defined | pushed.defined,
        )
    direction = orient(tension.direction, stress.mesh.neighbours)
    against = incompatible(direction, cells, tension.defined, rule)
    return MeshTension(direction, tension.stress, tension.defined & ~against)
