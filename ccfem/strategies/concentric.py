"""Baseline: rings parallel to the border, from the outside in."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.geometry.offsets import join_rings, offset_rings
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import concentric
from ccfem.machine.machine import Machine
from ccfem.paths.planning.infill import Infill, Turns
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.patterns import Regions, concentric_regions
from ccfem.slicing.layers.layer import Layer, LayerStress

_CLOSEST = 0.6
"""Least distance between filled rings, in spacings [Plocher et al. 2022]."""

_KNOWN = 8
"""Sections whose rings are kept for other layers, and for other amounts of what they enclose."""


@dataclass(frozen=True)
class Concentric(Infill):
    """Rings parallel to every border of the section. The stress is ignored.

    The first ring lies half a fibre width inside the border. Opposite sides of a ring stay a fibre
    width apart, so a gap remains along the middle where no further ring fits. Slicers call this
    fill concentric; it is model C of Chen et al. 2021, figure 3.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring rings in fibre widths, at least 1.
    rings : int, optional
        Number of rings along each border; by default as many as fit.
    joined : bool, default True
        Whether short ramps join nested rings to one strand, as on printers that cut the fibre.
        Otherwise every ring is a closed path of its own.
    start : tuple of 2 floats, mm, optional
        Point in the plane of the layer next to which the outermost rings start. By default it is
        the middle of the first edge of the layer's border.
    filled : bool, default False
        Whether rings run sharply into corners and as near as 0.6 spacings to each other, with lines
        along the middle in what they leave open, as in Plocher et al. 2022. Gaps shrink; some
        strands overlap. Not with `joined`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    mode : {"polyline", "raster"}, default "polyline"
        Polylines; or paths of pixels one spacing wide, as in the paper: see `ccfem.paths.raster`.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    spacing: float = 1.0
    rings: int | None = None
    joined: bool = True
    start: tuple[float, float] | None = None
    filled: bool = False
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"
    turns: Turns = "tight"

    ignores_stress: ClassVar[bool] = True
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "single": {"joined": False, "rings": 3},
        "start": {"start": (0.0, 0.0)},
        "filled": {"joined": False, "filled": True},
        "raster": {"joined": False, "mode": "raster"},
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, "rings", at_least=1)
        if self.joined and (self.mode == "raster" or self.filled):
            name = "mode raster" if self.mode == "raster" else "filled"
            raise InputError(f"concentric.{name} lays single rings: set concentric.joined to false")

    def strands(
        self, layer: Layer, stress: LayerStress, machine: Machine, prepared: None
    ) -> list[FloatArray]:
        """Rings, or the strands that join them."""
        width, spacing = machine.fibre_width, self.spacing * machine.fibre_width
        if self.filled:
            return concentric(layer.plane.polygon, spacing, _CLOSEST, 0.5 * width, self.rings)
        start: tuple[float, ...] | None = None
        if self.joined:
            place = self.start
            if place is None:
                place = layer.plane.points[layer.loops[0][:2]].mean(axis=0)
            start = tuple(np.asarray(place, dtype=np.float64).tolist())
        rings = _rings(layer.plane.polygon, spacing, width, self.rings, start)
        return [ring.copy() for ring in rings]

    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Rings of pixels."""
        return concentric_regions(image.mask, rings=self.rings)


@lru_cache(maxsize=_KNOWN)
def _rings(
    section: Region,
    spacing: float,
    width: float,
    count: int | None,
    start: tuple[float, ...] | None,
) -> tuple[FloatArray, ...]:
    """Rings in a section, joined where they have a start: many layers have the same section."""
    levels = offset_rings(section, 0.5 * width, spacing, width, count)
    if start is None or not levels:
        return tuple(ring for level in levels for ring in level)
    return tuple(join_rings(levels, np.asarray(start, dtype=np.float64), spacing, width))
