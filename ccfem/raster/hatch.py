"""Parallel lines of pixels in any direction."""

import numpy as np

from ccfem.arrays import BoolArray, IntArray

__all__ = ["hatch_lines"]


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
