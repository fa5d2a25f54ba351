"""Common parts of strategies that plan all layers of a part at once, to a share of its area."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress


def full_length(layers: Sequence[Layer], machine: Machine) -> float:
    """Length of fibre that covers a layer side by side, mm, mean over the layers."""
    return float(np.mean([layer.areas.sum() for layer in layers])) / machine.fibre_width


@dataclass(frozen=True)
class WholePart:
    """Paths of a whole part, returned layer by layer: a `LayerPlanner`.

    Attributes
    ----------
    toolpaths : Toolpaths
        Of all layers.
    """

    toolpaths: Toolpaths

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Paths of one layer."""
        return self.toolpaths.on_layer(layer.index)
