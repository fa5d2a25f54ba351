"""Baseline: rings parallel to the border, from the outside in."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.elasticity.stress_field import LayerStress
from ccfem.errors import InputError
from ccfem.geometry.offsets import join_rings, offset_rings
from ccfem.geometry.shells import concentric
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount
from ccfem.raster.bitmap import bitmap
from ccfem.raster.patterns import concentric_regions
from ccfem.raster.plan import RasterPlan, raster_plan
from ccfem.toolpaths import Toolpaths

__all__ = ["Concentric"]

_CLOSEST = 0.6
"""Least distance of filled rings, in spacings [Plocher et al. 2022]."""


@dataclass(frozen=True)
class Concentric:
    """Rings parallel to every border of the section, the stress unseen.

    The first ring lies half a fibre width inside the border; opposite sides of a ring stay a fibre
    width apart, which leaves a gap along the middle where no further ring fits. This is the fill
    that slicers call concentric, and model C of Chen et al. 2021, figure 3.

    Attributes
    ----------
    spacing : float, default 1
        Distance of neighbouring rings in fibre widths, at least 1.
    rings : int, optional
        Number of rings along each border; by default as many as fit.
    joined : bool, default True
        Whether nested rings are joined by short ramps into one strand, as printers that cut the
        fibre do. Otherwise every ring is a closed path of its own.
    start : tuple of 2 floats, mm, optional
        Point in the plane of the layer that the outermost rings start next to; by default the
        middle of the first edge of the layer's border.
    filled : bool, default False
        Whether the rings run sharply into corners and to within 0.6 spacings of each other, and
        lines along the middle fill what they leave, as Plocher et al. 2022 have it: less
        gaps, some overlap. Not with `joined`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels a spacing wide, as in the paper: see `ccfem.raster`.
    """

    spacing: float = 1.0
    rings: int | None = None
    joined: bool = True
    start: tuple[float, float] | None = None
    filled: bool = False
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"

    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "single": {"joined": False, "rings": 3},
        "start": {"start": (0.0, 0.0)},
        "filled": {"joined": False, "filled": True},
        "raster": {"joined": False, "mode": "raster"},
    }

    def __post_init__(self) -> None:
        if self.mode not in ("polyline", "raster"):
            raise InputError(f"concentric.mode must be polyline or raster; got {self.mode!r}")
        if not 1.0 <= self.spacing < float("inf"):
            raise InputError(
                f"concentric.spacing must be at least 1 fibre width; got {self.spacing}"
            )
        if self.mode == "raster" and self.joined:
            raise InputError(
                "concentric.mode raster lays single rings: set concentric.joined to false"
            )
        if self.rings is not None and self.rings < 1:
            raise InputError(f"concentric.rings must be at least 1; got {self.rings}")
        if self.filled and self.joined:
            raise InputError("concentric.filled lays single rings: set concentric.joined to false")
        if self.minimum_length is not None and not 0.0 <= self.minimum_length < float("inf"):
            raise InputError(
                f"concentric.minimum_length must be a finite number >= 0; got {self.minimum_length}"
            )

    @property
    def on_axes(self) -> bool:
        """Whether paths keep to the axes of the layer."""
        return self.mode == "raster"

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        if self.mode == "raster":
            plan = self.raster(layer, stress, machine)
            return plan.toolpaths(layer, machine, self.minimum_length)
        width = machine.fibre_width
        spacing = self.spacing * width
        if self.filled:
            lines = concentric(layer.polygon, spacing, _CLOSEST, 0.5 * width, self.rings)
        else:
            levels = offset_rings(layer.polygon, 0.5 * width, spacing, width, self.rings)
            lines = [ring for level in levels for ring in level]
            if self.joined and levels:
                first = layer.plane_points[layer.loops[0][:2]].mean(axis=0)
                start = first if self.start is None else np.asarray(self.start, dtype=np.float64)
                lines = join_rings(levels, start, spacing, width)
        paths = Toolpaths.from_plane(lines, layer)
        least = machine.minimum_length if self.minimum_length is None else self.minimum_length
        return paths.select(paths.lengths >= least)

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.polygon, self.spacing * machine.fibre_width)
        return raster_plan(image, concentric_regions(image.mask, rings=self.rings))
