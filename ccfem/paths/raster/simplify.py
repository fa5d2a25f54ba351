"""Paths of pixels with fewer points: staircases to diagonals, straight runs to their ends."""

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, IntArray

_STAIRS = 3
"""Minimum number of steps, alternating between two directions, that make a staircase."""


def corners(pixels: IntArray, offsets: IntArray, stairs: bool = True) -> BoolArray:
    """Points of pixel paths that stay: those where the path turns.

    Parameters
    ----------
    pixels : (P, 2) int array
        Neighbouring pixels a path; a closed path repeats its first.
    offsets : (K + 1,) int array
    stairs : bool, default True
        Whether three or more steps along sides of pixels, alternating between two directions, are
        one straight step from the first pixel to the last. Two staircases share no step, and a
        single corner stays.

    Returns
    -------
    (P,) bool array
    """
    return np.asarray(_corners(np.ascontiguousarray(pixels), offsets, _STAIRS if stairs else 0))


@njit(cache=True)
def _corners(pixels, offsets, stairs):  # type: ignore[no-untyped-def]
    keep = np.ones(len(pixels), dtype=np.bool_)
    for path in range(len(offsets) - 1):
        first, last = offsets[path], offsets[path + 1] - 1
        if stairs:
            k = first
            while k < last:
                m = k
                while m + 1 < last and _stair(pixels, m):
                    if m > k and not _parallel(pixels, m):
                        break
                    m += 1
                if m + 1 - k >= stairs:
                    for p in range(k + 1, m + 1):
                        keep[p] = False
                k = m + 1
        # Straight runs of what is left.
        before, here = first, -1
        for k in range(first + 1, last + 1):
            if not keep[k]:
                continue
            if here >= 0:
                ax, ay = pixels[here, 0] - pixels[before, 0], pixels[here, 1] - pixels[before, 1]
                bx, by = pixels[k, 0] - pixels[here, 0], pixels[k, 1] - pixels[here, 1]
                if ax * by == ay * bx and ax * bx + ay * by > 0:
                    keep[here] = False
                else:
                    before = here
            here = k
    return keep


@njit(cache=True)
def _stair(pixels, m):  # type: ignore[no-untyped-def]
    """Whether the steps from point m and m + 1 go along sides, at a right angle."""
    ax, ay = pixels[m + 1, 0] - pixels[m, 0], pixels[m + 1, 1] - pixels[m, 1]
    bx, by = pixels[m + 2, 0] - pixels[m + 1, 0], pixels[m + 2, 1] - pixels[m + 1, 1]
    along_sides = abs(ax) + abs(ay) == 1 and abs(bx) + abs(by) == 1
    return along_sides and ax * bx + ay * by == 0


@njit(cache=True)
def _parallel(pixels, m):  # type: ignore[no-untyped-def]
    """Whether the step to point m and that from point m + 1 are the same."""
    for i in range(2):
        if pixels[m + 2, i] - pixels[m + 1, i] != pixels[m, i] - pixels[m - 1, i]:
            return False
    return True
