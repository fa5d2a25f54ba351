"""Rings of pixels round guides, from the inside out."""

import numpy as np
from scipy import ndimage

from ccfem.arrays import BoolArray, IntArray

__all__ = ["first_touch", "ring_regions", "rings_round"]


def rings_round(guides: IntArray, inside: BoolArray) -> tuple[IntArray, IntArray]:
    """Find the ring round the nearest guide that each pixel lies in.

    Distances are straight, so that rings are round and a pixel apart at every angle.

    Parameters
    ----------
    guides : (H, W) int array
        Guide of each pixel; negative where there is none, some not.
    inside : (H, W) bool array

    Returns
    -------
    ring : (H, W) int array
        0 on the guides; -1 outside.
    guide : (H, W) int array
        The nearest one; -1 outside.
    """
    distance, nearest = ndimage.distance_transform_edt(guides < 0, return_indices=True)
    ring = np.floor(distance + 0.5).astype(np.int64)
    guide = guides[nearest[0], nearest[1]]
    return np.where(inside, ring, -1), np.where(inside, guide, -1)


def first_touch(ring: IntArray) -> int:
    """Find the first ring with a pixel at a side of one outside."""
    inside = ring >= 0
    return int(ring[inside & ~ndimage.binary_erosion(inside)].min())


def ring_regions(ring: IntArray, guide: IntArray) -> IntArray:
    """One region for each ring of each guide; -1 outside."""
    count = int(ring.max(initial=0)) + 1
    return np.where(ring >= 0, guide * count + ring, -1)
