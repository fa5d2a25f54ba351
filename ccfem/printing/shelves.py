"""Boxes laid out in rows on a bed, the most compact way first."""

from collections.abc import Iterator

import numpy as np

from ccfem.base.arrays import FloatArray


def shelves(sizes: FloatArray, gap: float, room: FloatArray) -> Iterator[FloatArray]:
    """Ways to lay boxes out in rows, one behind the other.

    The deepest boxes come first, each row from left to right, as long as the first few of them
    together. (Next-fit decreasing height: Coffman et al. 1980, SIAM J. Comput. 9, 808.)

    Parameters
    ----------
    sizes : (n, 2) array, mm
    gap : float, mm
        Least distance of two boxes.
    room : (2,) array, mm
        Size beyond which no way is of use.

    Yields
    ------
    (n, 2) array, mm
        Corner of each box with the least coordinates, from that of all; in order of half the
        perimeter of the box round all.
    """
    order = np.lexsort([np.arange(len(sizes)), -sizes[:, 1]])
    ways = []
    for length in (np.cumsum(sizes[order, 0] + gap) - gap).tolist():
        if length > room[0]:
            break
        corners = _in_rows(sizes, order.tolist(), gap, max(length, float(sizes[:, 0].max())))
        extent = (corners + sizes).max(axis=0)
        if (extent <= room).all():
            ways.append((float(extent.sum().round(6)), float(extent[1].round(6)), corners))
    for *_, corners in sorted(ways, key=lambda way: way[:2]):
        yield corners


def _in_rows(sizes: FloatArray, order: list[int], gap: float, length: float) -> FloatArray:
    """Corners (n, 2) of boxes in rows of at most a length."""
    corners = np.zeros_like(sizes)
    x, y, depth = 0.0, 0.0, 0.0
    for k in order:
        width, deep = sizes[k].tolist()
        if x > 0.0 and x + width > length + 1e-6:
            x, y, depth = 0.0, y + depth + gap, 0.0
        corners[k] = x, y
        x, depth = x + width + gap, max(depth, deep)
    return corners
