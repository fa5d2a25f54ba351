"""Paths of pixels with fewer points: staircases to diagonals, straight runs to their ends."""

import numpy as np
from numba import njit

from ccfem.arrays import BoolArray, IntArray

__all__ = ["corners"]

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
                    if m > k and (pixels[m + 2] - pixels[m + 1] != pixels[m] - pixels[m - 1]).any():
                        break
                    m += 1
                if m + 1 - k >= stairs:
                    keep[k + 1 : m + 1] = False
                k = m + 1
        # Straight runs of what is left.
        before, here = first, -1
        for k in range(first + 1, last + 1):
            if not keep[k]:
                continue
            if here >= 0:
                one, other = pixels[here] - pixels[before], pixels[k] - pixels[here]
                along = one[0] * other[0] + one[1] * other[1]
                if one[0] * other[1] == one[1] * other[0] and along > 0:
                    keep[here] = False
                else:
                    before = here
            here = k
    return keep


@njit(cache=True)
def _stair(pixels, m):  # type: ignore[no-untyped-def]
    """Whether the steps from point m and m + 1 go along sides, at a right angle."""
    one, other = pixels[m + 1] - pixels[m], pixels[m + 2] - pixels[m + 1]
    along_sides = abs(one[0]) + abs(one[1]) == 1 and abs(other[0]) + abs(other[1]) == 1
    return along_sides and one[0] * other[0] + one[1] * other[1] == 0
