"""The patterns of Plocher et al. (2022): regions of pixels, one a pixel wide and one a path.

Regions are numbered from 0 as an image (H, W), -1 outside. The first `shells` rings along the
border are the same in all patterns.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ccfem.arrays import BoolArray, IntArray, freeze
from ccfem.raster.bands import Metric, bands
from ccfem.raster.dilation import first_touch, ring_regions, rings_round
from ccfem.raster.hatch import hatch_lines
from ccfem.raster.skeleton import nearest_segment, skeleton

__all__ = [
    "GUIDE",
    "INFILL",
    "SHELL",
    "Regions",
    "concentric_regions",
    "grid_regions",
    "inside_shells",
    "medial_regions",
    "stress_regions",
]

SHELL, GUIDE, INFILL = range(3)

_LEAST_AXIS = 4
"""Pixels of the least medial axis: a part with a shorter one is filled by concentric rings."""


@dataclass(frozen=True)
class Regions:
    """A pattern.

    Attributes
    ----------
    number : (H, W) int array
        Region of each solid pixel; -1 elsewhere.
    domain : (H, W) int array
        SHELL, GUIDE (medial axis or streamline, and what runs parallel to it) or INFILL; -1.
    """

    number: IntArray
    domain: IntArray

    def __post_init__(self) -> None:
        freeze(self, number=int, domain=int)


def inside_shells(mask: BoolArray, shells: int, metric: Metric = "euclid") -> BoolArray:
    """Pixels that the shells leave."""
    return bands(mask, metric) >= shells


def _stack(*parts: tuple[IntArray, int]) -> Regions:
    """Regions of several images with their domains, the first ones above the others."""
    number = np.full(parts[0][0].shape, -1, dtype=np.int64)
    domain = number.copy()
    start = 0
    for regions, kind in parts:
        fresh = (number < 0) & (regions >= 0)
        number[fresh], domain[fresh] = start + regions[fresh], kind
        start += int(regions.max(initial=-1)) + 1
    return Regions(number, domain)


def _shell_rings(mask: BoolArray, shells: int, metric: Metric) -> tuple[IntArray, int]:
    ring = bands(mask, metric)
    return np.where(ring < shells, ring, -1), SHELL


def concentric_regions(
    mask: BoolArray, shells: int = 3, rings: int | None = None, metric: Metric = "euclid"
) -> Regions:
    """Rings from the border to the middle, or so many of them."""
    ring = bands(mask, metric)
    if rings is not None:
        ring = np.where(ring < rings, ring, -1)
    return _stack(_shell_rings(mask, min(shells, rings or shells), metric), (ring, INFILL))


def grid_regions(
    mask: BoolArray,
    angle: float,
    shells: int = 3,
    every_row: bool = False,
    metric: Metric = "euclid",
) -> Regions:
    """Shells and parallel lines at an angle, radians; `every_row` as in `hatch_lines`."""
    inside = inside_shells(mask, shells, metric)
    lines = hatch_lines(inside, angle, every_row) if inside.any() else np.full(mask.shape, -1)
    return _stack(_shell_rings(mask, shells, metric), (lines, INFILL))


def medial_regions(mask: BoolArray, shells: int = 3, metric: Metric = "euclid") -> Regions:
    """Shells, rings round the medial axis up to the first that touches them, then concentric."""
    inside = inside_shells(mask, shells, metric)
    shell = _shell_rings(mask, shells, metric)
    line = skeleton(inside)
    pieces, count = ndimage.label(line, np.ones((3, 3)))
    line &= (np.bincount(pieces.ravel(), minlength=count + 1) >= _LEAST_AXIS)[pieces]
    if not line.any():
        return _stack(shell, (bands(inside, metric), INFILL))
    axis = nearest_segment(line)
    ring, _ = rings_round(np.where(line, 0, -1), inside)
    last = first_touch(ring)
    grown = np.where((ring > 0) & (ring <= last), ring - 1, -1)
    rest = bands(inside & (ring > last), metric)
    return _stack(shell, (axis, GUIDE), (grown, GUIDE), (rest, INFILL))


def stress_regions(
    mask: BoolArray, guides: IntArray, shells: int = 3, metric: Metric = "euclid"
) -> Regions:
    """Shells, and rings round the nearest of some guides, an image, -1 where there is none.

    Pieces inside the shells that no guide runs through are filled by concentric rings.
    """
    inside = inside_shells(mask, shells, metric)
    shell = _shell_rings(mask, shells, metric)
    pieces, _ = ndimage.label(inside, np.ones((3, 3)))
    guides = np.where(inside, guides, -1)
    guided = np.isin(pieces, np.unique(pieces[guides >= 0])) & inside
    grown = np.full(mask.shape, -1, dtype=np.int64)
    if guided.any():
        grown = ring_regions(*rings_round(guides, guided))
    return _stack(shell, (grown, GUIDE), (bands(inside & ~guided, metric), INFILL))
