"""Level sets of the distance to the border, unchanged: for comparison.

Wang et al. 2021 show three strategies beside their own; this is one of them, after V. S.
Papapetrou, C. Patel, A. Y. Tamijani, Stiffness-based optimization framework for the topology and
fiber paths of continuous fiber composites, Composites Part B 183 (2020) 107681.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.offsets import rings
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress

_QUARTER = 16
"""Segments per quarter turn round a re-entrant corner."""


@dataclass(frozen=True)
class Offset:
    """Rings at half a fibre width from the border and at every spacing further in.

    Each ring is a closed path. Unlike the rings of `concentric`, they are not opened where the
    section narrows, so opposite sides may touch or the ring may split; and they are not joined. The
    middle of a member stays open or is filled too densely, depending on the member's width.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring rings in fibre widths, at least 1.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    ignores_stress: ClassVar[bool] = True
    in_plane: ClassVar[bool] = True
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        width = machine.fibre_width
        lines = _level_sets(layer.plane.polygon, 0.5 * width, self.spacing * width)
        lines = with_turns(self, lines, machine).lines
        return long_enough(Toolpaths.from_plane(lines, layer), self.minimum_length, machine)


def _level_sets(section: Region, first: float, spacing: float) -> list[FloatArray]:
    """Find the closed curves (k, 2), mm, at `first`, `first + spacing`, ... inside a section.

    Each begins where it is nearest to the first point of the section, which turns with the part:
    of cuts that are worth the same the first one counts.
    """
    curves: list[FloatArray] = []
    distance, origin = first, shapely.get_coordinates(section)[0]
    while level := rings(shapely.buffer(section, -distance, quad_segs=_QUARTER)):
        for ring in level:
            start = int(np.linalg.norm(ring[:-1] - origin, axis=1).argmin())
            curves.append(np.concatenate([ring[start:-1], ring[: start + 1]]))
        distance += spacing
    return curves
