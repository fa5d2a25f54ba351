"""Tension on the triangles of a layer, from the in-plane stress or from the whole part."""

from typing import Literal

import numpy as np

from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.paths.fields.compatibility import Incompatible, incompatible
from ccfem.paths.fields.orientation import orient
from ccfem.paths.fields.tensile import Tension, plane_tension, spatial_tension
from ccfem.slicing.layers.layer_stress import LayerStress

_ANY_COMPRESSION = 1e12
"""Limit of compression over tension that excludes nothing."""


def layer_tension(
    stress: LayerStress,
    source: Literal["nodal", "cell"] = "nodal",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
) -> Tension:
    """Tension on the triangles of a layer from its in-plane stress.

    Parameters
    ----------
    source : {"nodal", "cell"}
        Recovered stress, averaged over the corners of each triangle, or stress of its tetrahedron.
    sense : {"tensile", "absolute"}
        Use the tensile principal stress, or that of largest absolute value.
    compression_limit : float, default 3.0
        See `fields.tensile.plane_tension`.
    """
    layer = stress.layer
    tensors = stress.cell if source == "cell" else stress.nodal[layer.triangles].mean(axis=1)
    plane = in_plane(tensors, layer.plane.frame)
    if sense == "tensile":
        return plane_tension(plane, compression_limit)
    value, angle, _ = strongest_in_plane(plane)
    size = np.abs(value)
    return Tension(np.stack([np.cos(angle), np.sin(angle)], axis=1), size, size > 0.0)


def mesh_tension(
    stress: PartStress,
    source: Literal["nodal", "cell"] = "cell",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
    rule: Incompatible = "any",
) -> Tension:
    """Tension in space of all tetrahedra, as Chen et al. 2021 section 4.1 processes it.

    Vectors are chosen by `spatial_tension` and oriented along the minimum spanning tree over the
    faces; cells without a tensile direction only take part in the orientation. Where the filter
    finds vectors incompatible, they become undefined, but the stress is kept.
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
    return Tension(direction, tension.stress, tension.defined & ~against, oriented=True)
