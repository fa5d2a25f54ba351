"""The medial axis of a bitmap: thinned, without spurs, symmetric where the bitmap is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.paths.raster.bitmap import NEIGHBOURS, depth

_ALL = np.ones((3, 3), dtype=bool)
_LEAST_SPUR = 5.0
_SPUR, _MORE = 1.5, 1.0
"""Branches with a free end are spurs when they are shorter, in pixels, than 5 or than 1.5 times the
distance from their fork to the border and one more."""


@dataclass(frozen=True)
class Segment:
    """A line of pixels between the forks and free ends of a thinned image.

    Attributes
    ----------
    pixels : (k, 2) int array
        Row and column, in their order.
    forks : tuple of 2 ints
        Number of the fork at each end; -1 for a free end, and for those of a closed line.
    """

    pixels: IntArray
    forks: tuple[int, int]
    closed: bool

    def __post_init__(self) -> None:
        freeze(self, pixels=int)

    @property
    def length(self) -> float:
        """Length with the steps to the forks, in pixels."""
        steps = np.linalg.norm(np.diff(self.pixels, axis=0), axis=1).sum()
        return float(steps) + sum(fork >= 0 for fork in self.forks)


def skeleton(mask: BoolArray) -> BoolArray:
    """Medial axis of the solid pixels (H, W): at least one for every connected piece.

    Branches that are spurs are removed and the rest is thinned again, until none is left. Then one
    half of a bitmap that is its own mirror image is copied onto the other; a line along an axis
    that falls between two rows of pixels becomes two pixels wide. The outermost rows and columns
    are empty.
    """
    line = thin(np.where(mask, 0, -1))
    far = depth(mask)
    while True:
        branches, forks = segments(line)
        spurs = [segment for segment in branches if _is_spur(segment, forks, far)]
        if not spurs:
            break
        for spur in spurs:
            line[tuple(spur.pixels.T)] = False
        line = thin(np.where(line, 0, -1))
    for axis in (0, 1):
        if np.array_equal(mask, np.flip(mask, axis)):
            line = _mirrored(line, axis)
    return line


def _is_spur(segment: Segment, forks: IntArray, far: FloatArray) -> bool:
    if (segment.forks[0] < 0) == (segment.forks[1] < 0):
        return False
    reach = far[forks == max(segment.forks)].max()
    return segment.length < max(_LEAST_SPUR, _SPUR * reach + _MORE)


def _mirrored(line: BoolArray, axis: int) -> BoolArray:
    """One half and its mirror image: the first way that keeps pieces and holes."""
    upper = np.moveaxis(line, axis, 0)
    half = (len(upper) + 1) // 2
    wanted = _topology(line)
    for left, other in ((upper, upper[::-1]), (upper[::-1], upper)):
        for near in (0, 1):
            kept = left[:half].copy()
            if near:
                kept[-1] |= other[half - 1]
            both = np.concatenate([kept, kept[: len(left) - half][::-1]])
            both = np.moveaxis(both, 0, axis)
            if _topology(both) == wanted:
                return np.ascontiguousarray(both)
    return line | np.flip(line, axis)


def _topology(line: BoolArray) -> tuple[int, int]:
    """Count connected pieces (8 neighbours), and those of the rest (4 neighbours)."""
    return ndimage.label(line, _ALL)[1], ndimage.label(~line)[1]


def segments(line: BoolArray) -> tuple[tuple[Segment, ...], IntArray]:
    """Lines between forks and free ends, and the fork that each pixel is part of, or -1.

    The image is thinned, and its outermost rows and columns are empty.
    """
    around = ndimage.convolve(line.astype(np.int64), _ALL.astype(np.int64), mode="constant")
    forks = ndimage.label(line & (around > 3), _ALL)[0].astype(np.int64) - 1
    pieces, count = ndimage.label(line & (forks < 0), _ALL)
    branches = []
    for number, box in zip(range(1, count + 1), ndimage.find_objects(pieces), strict=True):
        corner = np.array([part.start for part in box])
        chain = _ordered(np.argwhere(pieces[box] == number) + corner)
        ends = [_forks_beside(forks, pixel) for pixel in (chain[0], chain[-1])]
        if len(chain) == 1:
            ends = [ends[0][:1], ends[0][1:2]]
        closed = not any(ends) and len(chain) > 3 and np.abs(chain[0] - chain[-1]).max() == 1
        first, last = (end[0] if end else -1 for end in ends)
        branches.append(Segment(chain, (first, last), closed))
    return tuple(branches), forks


def _forks_beside(forks: IntArray, pixel: IntArray) -> list[int]:
    around = [int(forks[tuple(pixel + step)]) for step in NEIGHBOURS]
    return sorted({fork for fork in around if fork >= 0})


def _ordered(pixels: IntArray) -> IntArray:
    """Pixels (k, 2) of a line without forks from one end to the other."""
    left = {(int(i), int(j)) for i, j in pixels}
    beside = {
        (i, j): [(i + a, j + b) for a, b in NEIGHBOURS if (i + a, j + b) in left] for i, j in left
    }
    at = min(left, key=lambda pixel: (len(beside[pixel]), pixel))
    chain = [at]
    left.discard(at)
    while onward := [pixel for pixel in beside[at] if pixel in left]:
        at = onward[0]
        chain.append(at)
        left.discard(at)
    return np.array(chain, dtype=np.int64)


def nearest_segment(line: BoolArray) -> IntArray:
    """Segment of the thinned image that each pixel of a medial axis is nearest to; -1 elsewhere.

    A piece that is a single fork is a segment of its own. The axis is as `skeleton` returns it, in
    places two pixels wide.
    """
    branches, _ = segments(thin(np.where(line, 0, -1)))
    number = np.full(line.shape, -1, dtype=np.int64)
    for k, segment in enumerate(branches):
        number[tuple(segment.pixels.T)] = k
    pieces, _ = ndimage.label(line, _ALL)
    alone = ~np.isin(pieces, np.unique(pieces[number >= 0])) & line
    number[alone] = len(branches) + pieces[alone]
    _, nearest = ndimage.distance_transform_edt(number < 0, return_indices=True)
    return np.where(line, number[nearest[0], nearest[1]], -1)


# Thinning of the regions of an image to lines one pixel wide.
#
# Z. Guo, R. W. Hall, Parallel thinning with two-subiteration algorithms, Communications of the ACM
# 32 (1989) 359. What happens to a pixel depends on its eight neighbours alone, so it is looked up
# in tables of 256 entries.


_BITS = np.array([[128, 1, 2], [64, 0, 4], [32, 16, 8]], dtype=np.uint8)
"""A pixel's neighbours in a number: p_0 to p_7 are its bits, clockwise from above."""


def _tables() -> tuple[BoolArray, BoolArray, BoolArray, BoolArray]:
    """Whether each pass takes a pixel off; whether it is a corner; whether a corner can go."""
    p = (np.arange(256) >> np.arange(8)[:, None] & 1).astype(bool)
    side, diagonal = p[0::2], p[1::2]
    before, after = np.roll(diagonal, 1, axis=0), np.roll(side, -1, axis=0)
    # The neighbours are one connected piece: the pixel is not needed between them.
    alone = (~side & (diagonal | after)).sum(axis=0) == 1
    pairs = np.minimum((before | side).sum(axis=0), (side | diagonal).sum(axis=0))
    border = alone & (pairs >= 2) & (pairs <= 3)
    first = border & ~((p[4] | p[5] | ~p[7]) & p[6])
    second = border & ~((p[0] | p[1] | ~p[3]) & p[2])
    corner = (p[0] | p[4]) & (p[2] | p[6])
    return first, second, corner, corner & alone


_FIRST, _SECOND, _CORNER, _FREE_CORNER = _tables()


def thin(regions: IntArray) -> BoolArray:
    """Mask (H, W) of the pixels that stay when every region is thinned.

    Every connected (8 neighbours) piece of a region keeps at least one pixel, and its holes.
    Corners that a diagonal step can cut are taken off last.

    Parameters
    ----------
    regions : (H, W) int array
        Region of each pixel; negative where there is none. The outermost rows and columns are
        empty.
    """
    left = regions >= 0
    inner = left[1:-1, 1:-1]
    neighbours = []
    for i, j in np.argwhere(_BITS):
        window = slice(i, i + len(inner)), slice(j, j + inner.shape[1])
        alike = regions[window] == regions[1:-1, 1:-1]
        neighbours.append((left[window], _BITS[i, j] * alike))

    def numbers() -> NDArray[np.uint8]:
        """Return the neighbours of all pixels, as entries of the tables."""
        total = np.zeros(inner.shape, dtype=np.uint8)
        for beside, bit in neighbours:
            total |= beside * bit
        return total

    pixels = -1
    while pixels != (pixels := int(inner.sum())):
        for removed in (_FIRST, _SECOND):
            inner &= ~removed[numbers()]
    # One after the other, since two corners may not both go.
    for i, j in np.argwhere(inner & _CORNER[numbers()]):
        square = slice(i, i + 3), slice(j, j + 3)
        alike = left[square] & (regions[square] == regions[i + 1, j + 1])
        inner[i, j] = not _FREE_CORNER[int(_BITS[alike].sum())]
    return left
