"""A section as a bitmap and its rings of pixels, and back to the plane."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import shapely
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, read_only
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.geometry.shapes import Region

NEIGHBOURS = np.array([(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)])
NEIGHBOURS.flags.writeable = False
"""Steps (row, column) to the 8 neighbours of a pixel, clockwise; even ones share a side."""

_TIE = 1e-6
"""Centres nearer to the border than this, in pixels, are outside: ties agree on all sides."""
_SAMPLE = 0.05
_MOST = 4_000_000


@dataclass(frozen=True)
class Bitmap:
    """Pixels of a section.

    Attributes
    ----------
    mask : (H, W) bool array
        Solid pixels: those with their centre in the section. Row 0 is the top; the outermost rows
        and columns are empty.
    pixel : float, mm
        Side of a pixel.
    origin : (2,) array, mm
        Lower left corner of the bitmap.
    section : shapely (Multi)Polygon, mm
        Prepared: no other thread may use it.
    """

    mask: BoolArray
    pixel: float
    origin: FloatArray
    section: Region

    def __post_init__(self) -> None:
        freeze(self, mask=bool, origin=float)

    def centres(self, pixels: IntArray) -> FloatArray:
        """Centres (k, 2), mm, of pixels (k, 2) by row and column."""
        row, column = np.asarray(pixels).reshape(-1, 2).T
        place = np.stack([column + 0.5, len(self.mask) - 0.5 - row], axis=1)
        return self.origin + self.pixel * place

    def pixels(self, points: FloatArray) -> IntArray:
        """Pixels (k, 2), by row and column, that hold points (k, 2), mm; clipped to the bitmap."""
        place = (np.asarray(points).reshape(-1, 2) - self.origin) / self.pixel
        pixel = np.stack([len(self.mask) - 1 - np.floor(place[:, 1]), np.floor(place[:, 0])], 1)
        return np.clip(pixel, 0, np.array(self.mask.shape) - 1).astype(np.int64)

    @cached_property
    def linked(self) -> BoolArray:
        """Whether the way from each pixel to each of its 8 neighbours is in the section, (H, W, 8).

        False where either is not solid, and across slits that no centre of a pixel lies in.
        """
        mask = self.mask
        linked = np.zeros((*mask.shape, 8), dtype=bool)
        near = self._near_border()
        for k, (down, right) in enumerate(NEIGHBOURS[:4]):
            there = np.roll(mask, (-down, -right), (0, 1))
            linked[..., k] = mask & there
            rows, columns = np.nonzero(linked[..., k] & near)
            start = np.stack([rows, columns], axis=1)
            ends = np.stack([self.centres(start), self.centres(start + NEIGHBOURS[k])], axis=1)
            linked[rows, columns, k] = shapely.covers(self.section, shapely.linestrings(ends))
            linked[..., k + 4] = np.roll(linked[..., k], (down, right), (0, 1))
        return read_only(linked, np.bool_)

    def _near_border(self) -> BoolArray:
        """Pixels (H, W) beside a square between four centres that the border passes through."""
        shapely.prepare(self.section)
        border = shapely.segmentize(shapely.boundary(self.section), _SAMPLE * self.pixel)
        points = (shapely.get_coordinates(border) - self.origin) / self.pixel - 0.5
        low = np.zeros(self.mask.shape, dtype=bool)
        height, width = self.mask.shape
        # Shifted every way: the border may cut off less of a square than lies between samples.
        for shift in _SAMPLE * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
            place = np.floor(points + shift).astype(np.int64)
            row = np.clip(height - 1 - place[:, 1], 0, height - 1)
            low[row, np.clip(place[:, 0], 0, width - 1)] = True
        # Each square by its lower left pixel: all four of its corners.
        near = low | np.roll(low, -1, 0)
        return near | np.roll(near, 1, 1)


def bitmap(section: Region, pixel: float) -> Bitmap:
    """Bitmap, which may be empty, of a section in pixels of a size, mm.

    A box of a whole number of pixels is divided into exactly those; otherwise the pixels are
    centred on it, so that a symmetric section has a symmetric bitmap.
    """
    check_number("the pixel of a bitmap", pixel, above=0.0, unit="mm")
    section = shapely.force_2d(section)  # a copy of its own, to be prepared
    if shapely.is_empty(section):
        return Bitmap(np.zeros((2, 2), dtype=bool), pixel, np.zeros(2), section)
    low, high = np.array(shapely.bounds(section)).reshape(2, 2)
    count = np.ceil((high - low) / pixel - _TIE).astype(np.int64)
    if count.prod() > _MOST:
        raise InputError(
            f"a bitmap of {count[0]} x {count[1]} pixels is too large: give a wider pixel than "
            f"{pixel} mm"
        )
    middle = 0.5 * (low + high)

    def in_pixels(points: FloatArray) -> FloatArray:
        return (points - middle) / pixel

    scaled = shapely.transform(section, in_pixels)
    inner = shapely.buffer(scaled, -_TIE, join_style="mitre")
    shapely.prepare(inner)
    width, height = count
    x = np.arange(width) - 0.5 * (width - 1)
    y = 0.5 * (height - 1) - np.arange(height)
    mask = shapely.contains_xy(inner, *np.meshgrid(x, y))
    return Bitmap(np.pad(mask, 1), pixel, middle - pixel * (0.5 * count + 1.0), section)


# Rings of pixels by their distance to the border.


Metric = Literal["euclid", "cross", "square"]


def depth(mask: BoolArray) -> FloatArray:
    """Distance (H, W), in pixels, of the centre of each solid pixel to the nearest empty one's."""
    return np.asarray(ndimage.distance_transform_edt(mask), dtype=np.float64)


def bands(mask: BoolArray, metric: Metric = "euclid") -> IntArray:
    """Find the ring that each pixel lies in.

    Parameters
    ----------
    mask : (H, W) bool array
        Its outermost rows and columns are empty.
    metric : {"euclid", "cross", "square"}, default "euclid"
        Rings a pixel wide at every angle; or those that erosion by a cross or by a square of
        3 x 3 pixels takes off, which at 45 degrees are 0.71 and 1.41 pixels wide.

    Returns
    -------
    (H, W) int array
        0 at the border; -1 where the mask is empty.
    """
    if metric == "euclid":
        ring = np.floor(depth(mask) - 0.5)
    else:
        name = "taxicab" if metric == "cross" else "chessboard"
        ring = ndimage.distance_transform_cdt(mask, name) - 1.0
    return np.where(mask, np.maximum(ring, 0.0), -1.0).astype(np.int64)
