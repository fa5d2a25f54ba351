"""First in, spiral out: one strand that starts in the middle of a region and winds to its border.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.geometry.contour_tree import contour_trees
from ccfem.machine.machine import Machine
from ccfem.paths.linking.first_in import first_in_spiral_out
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.planning.strategy import Amount
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress

_NARROW = 0.5
"""Least distance between opposite sides of a contour, in spacings, where laps keep a radius."""


@dataclass(frozen=True)
class Fiso:
    """Contours of a region joined to one strand, which is never cut inside it. No stress is needed.

    The contours lie half a spacing from the border and at every further spacing inwards. Those
    between the border and the point farthest from it become laps: the fibre starts at the innermost
    one and steps outwards from lap to lap. All other contours are merged into their neighbours.
    A region is a connected part of the section that is at least as wide as a strand.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring contours in fibre widths, at least 1.
    closest : float, default 0
        Least distance between opposite sides of a contour, in spacings, from 0 to 1. With 0, as
        published, two strands may lie nearer than a width along the ridge between two borders. With
        1 none does, but a gap up to three spacings wide stays open there.
    least_radius : float, mm, default 0
        Least radius of the corners of contours and of the ramps between laps. All laps then run in
        one sense, and the corners of the section and the middle of small regions stay open. Turns
        where contours are merged are still half a spacing wide. With 0, as published, all turns
        are that tight.
    entry : bool, default False
        Whether the strand also starts at the border, and goes straight to the middle through the
        openings of the laps. Not with `least_radius`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`. Unless this is "tight", contours that are long enough for the cutter are not
        merged.
    """

    spacing: float = 1.0
    closest: float = 0.0
    least_radius: float = 0.0
    entry: bool = False
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "apart": {"closest": 1.0},
        "round": {"least_radius": 3.85},
        "entry": {"entry": True},
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "closest", at_least=0.0, at_most=1.0, unit="spacings")
        check_fields(self, "least_radius", at_least=0.0, unit="mm")
        if self.entry and self.least_radius > 0.0:
            raise InputError(
                "fiso.entry goes through openings that leave no room for ramps: set "
                "fiso.least_radius to 0, or fiso.entry to false"
            )

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        spacing, radius = self.spacing * machine.fibre_width, self.least_radius
        closest = max(self.closest, _NARROW) if radius > 0.0 else self.closest
        start = layer.plane.points[layer.loops[0][:2]].mean(axis=0)
        lines: list[FloatArray] = []
        least = np.inf if self.turns == "tight" else machine.minimum_length
        section = layer.plane.polygon
        for tree in contour_trees(section, spacing, start, closest, radius):
            lines += first_in_spiral_out(tree, spacing, start, self.entry, radius, least)
        lines = with_turns(self, lines, machine).lines
        return long_enough(Toolpaths.from_plane(lines, layer), self.minimum_length, machine)
