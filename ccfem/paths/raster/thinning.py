"""Thinning of the regions of an image to lines one pixel wide.

Z. Guo, R. W. Hall, Parallel thinning with two-subiteration algorithms, Communications of the ACM
32 (1989) 359. What happens to a pixel depends on its eight neighbours alone, so it is looked up in
tables of 256 entries.
"""

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import BoolArray, IntArray

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
    """Pixels that stay when every region is thinned.

    Every connected (8 neighbours) piece of a region keeps at least one pixel, and its holes.
    Corners that a diagonal step can cut are taken off last.

    Parameters
    ----------
    regions : (H, W) int array
        Region of each pixel; negative where there is none. The outermost rows and columns are
        empty.

    Returns
    -------
    (H, W) bool array
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
