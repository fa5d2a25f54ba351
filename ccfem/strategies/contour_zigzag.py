"""Baseline: contours along the border, and a zigzag inside them."""

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
from ccfem.strategies.concentric import Concentric


@dataclass(frozen=True)
class ContourZigzag:
    """Rings along every border, and linked parallel lines inside them. The stress is ignored.

    Commercial fibre slicers lay this pattern. Chen et al. 2021 compare their paths with it as the
    load-independent ones (table 2).

    Attributes
    ----------
    spacing : float, default 1
        Distance between the zigzag's lines in fibre widths, at least 1. The contours stay one fibre
        width apart.
    contours : int, default 2
        Number of rings along each border.
    angle, turn : float, degrees, default 45 and 90
        As in `Zigzag`.
    joined : bool, default True
        As in `Concentric`.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    contours: int = 2
    angle: float = 45.0
    turn: float = 90.0
    joined: bool = True
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    ignores_stress: ClassVar[bool] = True
    in_plane: ClassVar[bool] = True
    direction: ClassVar[str] = "angle"
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "single": {"joined": False},
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "contours", at_least=1)
        check_fields(self, "angle", "turn", unit="degrees")

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        rings = Concentric(rings=self.contours, joined=self.joined, turns=self.turns)
        contours = rings(layer, stress, machine)
        inside, angle = (
            (self.contours + 0.5) * width,
            np.radians(self.angle + self.turn * layer.index),
        )
        lines = zigzag(layer.plane.polygon, inside, width, self.spacing * width, angle)
        lines = with_turns(self, lines, machine).lines
        inner = long_enough(Toolpaths.from_plane(lines, layer), None, machine)
        return Toolpaths.concatenate([contours, inner])
