"""Stress on a layer: all that planning on it needs to know about the part."""

from dataclasses import dataclass

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.display import Shown
from ccfem.base.tensor import in_axes
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class LayerStress(Shown):
    """Stress on a layer.

    Attributes
    ----------
    cell : (t, 3, 3) array, MPa
        Stress of the tetrahedron that each triangle was cut from.
    nodal : (n, 3, 3) array, MPa
        Stress at the layer's points.
    held_or_loaded : tuple of str, default none
        Names of the part's patches that carry a support or a load.
    """

    layer: Layer
    cell: FloatArray
    nodal: FloatArray
    held_or_loaded: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"LayerStress on {self.layer!r}"

    def __post_init__(self) -> None:
        freeze(self, cell=float, nodal=float)


def stress_on(layer: Layer, stress: PartStress) -> LayerStress:
    """Stress of a part on one of its layers, in the axes of the layer (`Layer.turns`)."""
    cell, nodal = stress.stress[layer.cell], layer.interpolate(stress.nodal)
    if layer.turns is not None and layer.point_turns is not None:
        cell, nodal = in_axes(cell, layer.turns), in_axes(nodal, layer.point_turns)
    return LayerStress(layer, cell, nodal, stress.held_or_loaded)
