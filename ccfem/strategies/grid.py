"""Shells and parallel straight lines: the grids of Plocher et al. 2022.

J. Plocher, J.-B. Wioland, A. Panesar, Additive manufacturing with fibre-reinforcement: design
guidelines and investigation into the influence of infill patterns, Rapid Prototyping Journal 28
(2022) 1241.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.elasticity.stress_field import LayerStress
from ccfem.errors import InputError
from ccfem.geometry.hatch import hatch
from ccfem.geometry.shells import shells
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount
from ccfem.raster.bitmap import bitmap
from ccfem.raster.patterns import grid_regions
from ccfem.raster.plan import RasterPlan, raster_plan
from ccfem.toolpaths import Toolpaths

__all__ = ["Grid"]


@dataclass(frozen=True)
class Grid:
    """Shells along the border, and inside straight lines in two directions. The stress is unseen.

    Every line is a path of its own, as in the paper; `Zigzag` links them.

    Attributes
    ----------
    spacing : float, default 1
        Distance of neighbouring strands in fibre widths, at least 1.
    shells : int, default 3
        Number of rings along every border.
    angle, turn : float, degrees, default 45 and 90
        Direction of the first family of lines to the first axis of the layer, and its turn to the
        second one: 45 for +-45, 0 for 0/90.
    families : {"alternate", "both"}, default "alternate"
        One family a layer, in turn, or both on every layer, where they cross.
    lines : {"printable", "paper"}, default "printable"
        Lines at the true spacing; or as near as rows of pixels of one spacing are, every diagonal
        a line, which overlap by a factor of sqrt 2 at 45 degrees (the paper).
    closest : float, default 0.6
        As in `Mps`, for the shells of thin parts.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels a spacing wide, as in the paper: see `ccfem.raster`.
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

    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)
    direction: ClassVar[str] = "angle"
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "both": {"families": "both"},
        "paper": {"lines": "paper"},
        "raster": {"mode": "raster"},
        "raster_paper": {"mode": "raster", "lines": "paper"},
    }

    def __post_init__(self) -> None:
        if self.mode not in ("polyline", "raster"):
            raise InputError(f"grid.mode must be polyline or raster; got {self.mode!r}")
        if not 1.0 <= self.spacing < float("inf"):
            raise InputError(f"grid.spacing must be at least 1 fibre width; got {self.spacing}")
        if self.shells < 0:
            raise InputError(f"grid.shells must be at least 0; got {self.shells}")
        if not np.isfinite([self.angle, self.turn]).all():
            raise InputError(
                f"grid.angle and grid.turn must be finite degrees; got {self.angle} and {self.turn}"
            )
        if self.families not in ("alternate", "both"):
            raise InputError(f"grid.families must be alternate or both; got {self.families!r}")
        if self.mode == "raster" and self.families == "both":
            raise InputError("grid.mode raster lays one family a layer: set families to alternate")
        if self.lines not in ("printable", "paper"):
            raise InputError(f"grid.lines must be printable or paper; got {self.lines!r}")
        if not 0.5 <= self.closest <= 1.0:
            raise InputError(f"grid.closest must lie between 0.5 and 1; got {self.closest}")
        if self.minimum_length is not None and not 0.0 <= self.minimum_length < float("inf"):
            raise InputError(
                f"grid.minimum_length must be a finite number >= 0; got {self.minimum_length}"
            )

    @property
    def on_axes(self) -> bool:
        """Whether paths keep to the axes of the layer, or their distance does."""
        return self.mode == "raster" or self.lines == "paper"

    @property
    def crosses(self) -> bool:
        """Whether strands cross each other by intention."""
        return self.families == "both"

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        if self.mode == "raster":
            plan = self.raster(layer, stress, machine)
            return plan.toolpaths(layer, machine, self.minimum_length)
        pitch = self.spacing * machine.fibre_width
        lines, interior = shells(
            layer.polygon, machine.fibre_width, pitch, self.shells, self.closest
        )
        turns = (0, 1) if self.families == "both" else (layer.index,)
        for number in turns:
            angle = np.radians(self.angle + self.turn * number)
            step = pitch
            if self.lines == "paper":
                step *= max(abs(np.cos(angle)), abs(np.sin(angle)))
            lines += hatch(interior, angle, step).lines
        paths = Toolpaths.from_plane(lines, layer)
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
        return paths.select(paths.lengths >= least)

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.polygon, self.spacing * machine.fibre_width)
        angle = np.radians(self.angle + self.turn * layer.index)
        every = self.lines == "paper"
        return raster_plan(image, grid_regions(image.mask, angle, self.shells, every))
