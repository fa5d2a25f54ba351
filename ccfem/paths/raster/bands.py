"""Rings of pixels by their distance to the border."""

from typing import Literal

import numpy as np
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, IntArray

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
