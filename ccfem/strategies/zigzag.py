"""Baseline: parallel lines across the section, linked at their ends."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ccfem.base.checks import check_fields
from ccfem.geometry.hatch import zigzag
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress


@dataclass(frozen=True)
class Zigzag:
    """Parallel lines at one angle a layer, linked into as few strands as possible.

    Slicers call this rectilinear or isotropic fibre fill; it is model B of Chen et al. 2021,
    figure 3. The stress is ignored.

    Attributes
    ----------
    spacing : float, default 1
        Distance between the lines in fibre widths, at least 1.
    angle : float, degrees, default 45
        Direction of the lines on layer 0 to the first axis of the layer.
    turn : float, degrees, default 90
        Turn from each layer to the next. 90 alternates between two directions, as the published
        paths of Chen et al. 2021 do; 45 cycles through four.
    turns : {"tight", "printable", "cut"}, default "tight"
        "tight": strands follow every turn. "printable": strands are cut at turns tighter than the
        machine's minimum radius, if both parts are long enough for its cutter. "cut": strands are
        cut at all such turns, and parts that are too short are dropped.
    """

    spacing: float = 1.0
    angle: float = 45.0
    turn: float = 90.0
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    ignores_stress: ClassVar[bool] = True
    in_plane: ClassVar[bool] = True
    direction: ClassVar[str] = "angle"
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "angle", "turn", unit="degrees")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        angle = np.radians(self.angle + self.turn * layer.index)
        lines = zigzag(layer.plane.polygon, 0.5 * width, width, self.spacing * width, angle)
        lines = with_turns(self, lines, machine).lines
        return long_enough(Toolpaths.from_plane(lines, layer), None, machine)
