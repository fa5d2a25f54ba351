"""The patterns of Plocher et al. (2022): regions of pixels, one a pixel wide and one a path.

Regions are numbered from 0 as an image (H, W), -1 outside. The first `shells` rings along the
border are the same in all patterns.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ccfem.base.arrays import BoolArray, IntArray, freeze
from ccfem.paths.raster.bitmap import Metric, bands
from ccfem.paths.raster.skeleton import nearest_segment, skeleton

SHELL, GUIDE, INFILL = range(3)

_DASH = 12
"""Pieces of rings with fewer pixels than this are dashes."""
_LADDER = 12
"""Number of dashes side by side that give way to rings along the strip: in corners there are fewer.
"""

_LEAST_AXIS = 4
"""Minimum number of pixels of a medial axis: a part with fewer is filled by concentric rings."""


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


def inside_shells(mask: BoolArray, shells: int) -> BoolArray:
    """Pixels that the shells leave."""
    return bands(mask) >= shells


def rings_round(guides: IntArray, inside: BoolArray) -> tuple[IntArray, IntArray]:
    """Find the ring round the nearest guide that each pixel (H, W) lies in, and that guide.

    Distances are straight, so that rings are round and a pixel apart at every angle. Pixels without
    a guide have negative numbers; ring 0 is the guides, and -1 outside.
    """
    distance, nearest = ndimage.distance_transform_edt(guides < 0, return_indices=True)
    ring = np.floor(distance + 0.5).astype(np.int64)
    return np.where(inside, ring, -1), np.where(inside, guides[nearest[0], nearest[1]], -1)


def first_touch(ring: IntArray) -> int:
    """Find the first ring with a pixel that shares a side with one outside."""
    inside = ring >= 0
    return int(ring[inside & ~ndimage.binary_erosion(inside)].min())


def hatch_lines(mask: BoolArray, angle: float, every_row: bool = False) -> IntArray:
    """Find the line that each pixel lies on.

    Parameters
    ----------
    mask : (H, W) bool array
    angle : float, radians
        Of the lines to the rows of pixels.
    every_row : bool, default False
        Lines of one pixel in every column (or row), which are nearer than a pixel to each other
        unless they run along rows or columns: at 45 degrees every diagonal is one. Otherwise the
        lines are strips a pixel wide.

    Returns
    -------
    (H, W) int array
        -1 where the mask is empty.
    """
    height, width = mask.shape
    x = np.arange(width) - 0.5 * (width - 1)
    y = (0.5 * (height - 1) - np.arange(height))[:, None]
    across, down = np.cos(angle), np.sin(angle)
    step = max(abs(across), abs(down)) if every_row else 1.0
    # Half an odd number of lines falls between two: a small shift decides alike everywhere.
    line = np.floor((across * y - down * x) / step + 0.5 + 1e-9).astype(np.int64)
    return np.where(mask, line - line.min(), -1)


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


def _shells(
    mask: BoolArray, shells: int, metric: Metric = "euclid"
) -> tuple[tuple[IntArray, int], BoolArray]:
    """Rings of the shells with their domain, and the pixels that they leave."""
    ring = bands(mask, metric)
    return (np.where(ring < shells, ring, -1), SHELL), ring >= shells


def concentric_regions(
    mask: BoolArray, shells: int = 3, rings: int | None = None, metric: Metric = "euclid"
) -> Regions:
    """Rings from the border to the middle, or the first few of them."""
    ring = bands(mask, metric)
    if rings is not None:
        ring = np.where(ring < rings, ring, -1)
    return _stack(_shells(mask, min(shells, rings or shells), metric)[0], (ring, INFILL))


def grid_regions(
    mask: BoolArray, angle: float, shells: int = 3, every_row: bool = False
) -> Regions:
    """Shells and parallel lines at an angle, radians; `every_row` as in `hatch_lines`."""
    shell, inside = _shells(mask, shells)
    lines = hatch_lines(inside, angle, every_row) if inside.any() else np.full(mask.shape, -1)
    return _stack(shell, (lines, INFILL))


def medial_regions(mask: BoolArray, shells: int = 3, metric: Metric = "euclid") -> Regions:
    """Shells, rings round the medial axis up to the first that touches them, then concentric."""
    shell, inside = _shells(mask, shells, metric)
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


def stress_regions(mask: BoolArray, guides: IntArray, shells: int = 3) -> Regions:
    """Shells, and rings round the nearest of some guides, an image, -1 where there is none.

    Pieces inside the shells that no guide runs through are filled by concentric rings, and so is
    what rings round the end of a guide would fill with dashes from one side of a strip to the
    other.
    """
    shell, inside = _shells(mask, shells)
    pieces, _ = ndimage.label(inside, np.ones((3, 3)))
    guides = np.where(inside, guides, -1)
    guided = np.isin(pieces, np.unique(pieces[guides >= 0])) & inside
    grown = np.full(mask.shape, -1, dtype=np.int64)
    if guided.any():
        ring, guide = rings_round(guides, guided)
        grown = np.where(ring >= 0, guide * (ring.max() + 1) + ring, -1)
        grown[_ladders(grown, ring > 0)] = -1
    return _stack(shell, (grown, GUIDE), (bands(inside & (grown < 0)), INFILL))


def _ladders(number: IntArray, counts: BoolArray) -> BoolArray:
    """Pixels (H, W) of dashes that lie side by side, of regions where these count."""
    pieces = _components(number, counts)
    size = np.bincount(pieces.ravel())
    dashes = counts & (number >= 0) & (size < _DASH)[pieces]
    together, count = ndimage.label(dashes, np.ones((3, 3)))
    pairs = np.unique(np.stack([together[dashes], pieces[dashes]], axis=1), axis=0)
    many = np.bincount(pairs[:, 0], minlength=count + 1) >= _LADDER
    return dashes & many[together]


def _components(number: IntArray, counts: BoolArray) -> IntArray:
    """Give each piece (H, W) of a region that counts a number from 1; 0 where none counts."""
    components = np.zeros(number.shape, dtype=np.int64)
    total = 0
    boxes = ndimage.find_objects(np.where(counts, number + 1, 0))
    for region, box in enumerate(boxes):
        if box is None:
            continue
        inside = counts[box] & (number[box] == region)
        labels, count = ndimage.label(inside, np.ones((3, 3)))
        components[box][inside] = labels[inside] + total
        total += count
    return components
