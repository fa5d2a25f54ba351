"""Shells, and parallel straight lines inside them: the grids of Plocher et al. 2022.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.geometry.hatch import hatch
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import shells
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, Infill, Turns, check_shells
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.patterns import Regions, grid_regions
from ccfem.slicing.layers.layer import Layer, LayerStress


@dataclass(frozen=True)
class Grid(Infill):
    """Shells along the border, and straight lines in two directions inside. The stress is ignored.

    Every line is a path of its own, as in the paper; `Zigzag` links its lines.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring strands inside the shells in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border, a fibre width apart whatever the spacing.
    angle, turn : float, degrees, default 45 and 90
        Angle of the first family of lines to the first axis of the layer, and the turn from it to
        the second family: 45 for +-45, 0 for 0/90.
    families : {"alternate", "both"}, default "alternate"
        One family a layer, alternating; or both on every layer, where they cross.
    lines : {"printable", "paper"}, default "printable"
        Lines at the true spacing; or, as in the paper, lines along rows of pixels one spacing wide.
        There every diagonal is a line, so that lines at 45 degrees overlap by a factor of sqrt 2.
    closest : float, default 0.6
        As in `Mps`, for the shells of thin parts.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels one spacing wide, as in the paper: see `ccfem.paths.raster`.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    shells: int = 3
    angle: float = 45.0
    turn: float = 90.0
    families: Literal["alternate", "both"] = "alternate"
    lines: Literal["printable", "paper"] = "printable"
    closest: float = 0.6
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"
    turns: Turns = "tight"

    amount: ClassVar[Amount] = replace(SPACING, beyond=(("shells", 60),))
    ignores_stress: ClassVar[bool] = True
    direction: ClassVar[str] = "angle"
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "both": {"families": "both"},
        "paper": {"lines": "paper"},
        "raster": {"mode": "raster"},
        "raster_paper": {"mode": "raster", "lines": "paper"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shells(self)
        check_fields(self, "angle", "turn", unit="degrees")
        if self.mode == "raster" and self.families == "both":
            raise InputError("grid.mode raster lays one family a layer: set families to alternate")

    @property
    def on_axes(self) -> bool:
        """Whether the paths, or the distances between them, follow the axes of the layer."""
        return self.mode == "raster" or self.lines == "paper"

    @property
    def crosses(self) -> bool:
        """Whether strands cross each other on purpose."""
        return self.families == "both"

    def prepare(self, section: Region, machine: Machine) -> tuple[list[FloatArray], Region]:
        """Shells, and the region inside them."""
        width = machine.fibre_width
        return shells(section, width, width, self.shells, self.closest)

    def strands(
        self,
        layer: Layer,
        stress: LayerStress,
        machine: Machine,
        prepared: tuple[list[FloatArray], Region],
    ) -> list[FloatArray]:
        """Shells, then each family of lines."""
        lines, interior = prepared
        interior = shapely.force_2d(interior)  # a copy: threads must not share a geometry
        for number in (0, 1) if self.families == "both" else (layer.index,):
            angle = self._angle(number)
            step = self.spacing * machine.fibre_width
            if self.lines == "paper":
                step *= max(abs(np.cos(angle)), abs(np.sin(angle)))
            lines = lines + hatch(interior, angle, step).lines
        return lines

    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Shells and rows of pixels."""
        angle, every = self._angle(layer.index), self.lines == "paper"
        return grid_regions(image.mask, angle, self.shells, every)

    def _angle(self, number: int) -> float:
        """Direction of a family, radians."""
        return float(np.radians(self.angle + self.turn * number))
