"""The paths of one layer, seen in every way that an index may need."""

from dataclasses import dataclass

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.fem.materials import Material
from ccfem.judging.evaluation.plane_paths import PlanePaths
from ccfem.judging.evaluation.printed_stack import Printed
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress


@dataclass(frozen=True)
class LayerPaths:
    """Paths of one layer, with what they lie on.

    Attributes
    ----------
    toolpaths : Toolpaths
        Every path of the layer, of all kinds, in the order of printing.
    fibre : Toolpaths
        Those of fibre.
    inside : Toolpaths
        Fibre without its links; of a curved layer all of it.
    plane : PlanePaths
        The fibre in the plane of a flat layer, or in the chart of a curved one.
    layer_stress : LayerStress
        On the flat layer, or on the chart.
    below : Layer, optional
        Flat layer under a flat one.
    late : int
        Paths that are printed after paths of a higher layer.
    stack : Printed, optional
        All layers as they are printed, where they are curved.
    build : (3,) array
        Unit vector of the build direction.
    """

    toolpaths: Toolpaths
    fibre: Toolpaths
    inside: Toolpaths
    plane: PlanePaths
    layer: Layer
    layer_stress: LayerStress
    stress: PartStress
    machine: Machine
    below: Layer | None
    late: int
    stack: Printed | None
    build: FloatArray


@dataclass(frozen=True)
class Basis:
    """What indices refer to: the machine, and the material of a part that is full of strands."""

    machine: Machine
    material: Material
