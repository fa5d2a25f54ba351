"""Thinning of the regions of an image to lines one pixel wide.

Z. Guo, R. W. Hall, Parallel thinning with two-subiteration algorithms, Communications of the ACM
32 (1989) 359.
"""

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, IntArray


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
    return np.asarray(_thin(np.ascontiguousarray(regions, dtype=np.int64)))


@njit(cache=True)
def _around(left, regions, i, j, p):  # type: ignore[no-untyped-def]
    """Fill p (8,) with which neighbours, clockwise from above, are of the same region."""
    own = regions[i, j]
    p[0] = left[i - 1, j] and regions[i - 1, j] == own
    p[1] = left[i - 1, j + 1] and regions[i - 1, j + 1] == own
    p[2] = left[i, j + 1] and regions[i, j + 1] == own
    p[3] = left[i + 1, j + 1] and regions[i + 1, j + 1] == own
    p[4] = left[i + 1, j] and regions[i + 1, j] == own
    p[5] = left[i + 1, j - 1] and regions[i + 1, j - 1] == own
    p[6] = left[i, j - 1] and regions[i, j - 1] == own
    p[7] = left[i - 1, j - 1] and regions[i - 1, j - 1] == own


@njit(cache=True)
def _pieces(p):  # type: ignore[no-untyped-def]
    """Count the connected pieces of the neighbours; 1 where the pixel is not needed between."""
    count = 0
    for k in range(0, 8, 2):
        if not p[k] and (p[k + 1] or p[(k + 2) % 8]):
            count += 1
    return count


@njit(cache=True)
def _thin(regions):  # type: ignore[no-untyped-def]
    height, width = regions.shape
    left = regions >= 0
    p = np.zeros(8, dtype=np.bool_)
    off = np.empty((height * width, 2), dtype=np.int64)
    changed = True
    while changed:
        changed = False
        for turn in range(2):
            count = 0
            for i in range(1, height - 1):
                for j in range(1, width - 1):
                    if not left[i, j]:
                        continue
                    _around(left, regions, i, j, p)
                    if _pieces(p) != 1:
                        continue
                    one = (p[7] or p[0]) + (p[1] or p[2]) + (p[3] or p[4]) + (p[5] or p[6])
                    two = (p[0] or p[1]) + (p[2] or p[3]) + (p[4] or p[5]) + (p[6] or p[7])
                    if not 2 <= min(one, two) <= 3:
                        continue
                    if turn == 0:
                        kept = (p[4] or p[5] or not p[7]) and p[6]
                    else:
                        kept = (p[0] or p[1] or not p[3]) and p[2]
                    if not kept:
                        off[count, 0], off[count, 1] = i, j
                        count += 1
            for k in range(count):
                left[off[k, 0], off[k, 1]] = False
            changed = changed or count > 0
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            if left[i, j]:
                _around(left, regions, i, j, p)
                corner = (p[0] or p[4]) and (p[2] or p[6])
                if corner and _pieces(p) == 1:
                    left[i, j] = False
    return left
