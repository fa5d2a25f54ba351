"""A uniform grid of buckets for boxes, to find neighbours and containing boxes."""

from typing import NamedTuple

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray

_MOST_CELLS = 4_000_000


class Buckets(NamedTuple):
    """Boxes by the cells of a uniform grid.

    Attributes
    ----------
    origin : (d,) array, mm
        Lowest corner of the grid; d is 2 or 3.
    cell : float, mm
        Size of a cell.
    shape : (3,) int array
        Cells along each axis; 1 along a third axis of a plane grid.
    starts, items : int arrays
        Cell (i, j, k) holds the boxes ``items[starts[c]:starts[c + 1]]`` with
        ``c = (i * shape[1] + j) * shape[2] + k``.
    """

    origin: FloatArray
    cell: float
    shape: IntArray
    starts: IntArray
    items: IntArray


def bucket(low: FloatArray, high: FloatArray, cell: float | None = None) -> Buckets:
    """Put boxes into the cells of a grid that they overlap.

    Parameters
    ----------
    low, high : (n, d) arrays, mm
        Corners of at least one box, d = 2 or 3.
    cell : float, mm, optional
        Size of a cell; by default about one box a cell. It is increased if the grid would have more
        than four million cells.
    """
    origin = low.min(axis=0)
    extent = np.maximum(high.max(axis=0) - origin, 1e-12)
    dimension = len(origin)
    if cell is None:
        spread = float((np.prod(extent) / len(low)) ** (1.0 / dimension))
        cell = max(spread, float(np.mean(high - low)))
    while np.prod(np.floor(extent / cell) + 1.0) > _MOST_CELLS:
        cell *= 1.5
    shape = np.ones(3, dtype=np.int64)
    shape[:dimension] = np.floor(extent / cell).astype(np.int64) + 1
    first = np.zeros((len(low), 3), dtype=np.int64)
    last = np.zeros((len(low), 3), dtype=np.int64)
    first[:, :dimension] = np.floor((low - origin) / cell)
    last[:, :dimension] = np.floor((high - origin) / cell)
    starts, items = _boxes_by_cell(first, np.minimum(last, shape - 1), shape)
    return Buckets(origin, cell, shape, starts, items)


@njit(cache=True, nogil=True)
def _boxes_by_cell(first: IntArray, last: IntArray, shape: IntArray) -> tuple[IntArray, IntArray]:
    """Items of each grid cell: boxes of cells from `first` to `last`, counted, then written."""
    starts = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    items = np.empty(0, np.int64)
    for writing in range(2):
        if writing:
            total = 0
            for c in range(len(starts)):
                size = starts[c]
                starts[c] = total
                total += size
            items = np.empty(total, np.int64)
        for box in range(len(first)):
            for i in range(first[box, 0], last[box, 0] + 1):
                for j in range(first[box, 1], last[box, 1] + 1):
                    for k in range(first[box, 2], last[box, 2] + 1):
                        c = (i * shape[1] + j) * shape[2] + k
                        if writing:
                            items[starts[c]] = box
                        starts[c] += 1
    # Writing has moved the start of every cell to that of the next one.
    for c in range(len(starts) - 1, 0, -1):
        starts[c] = starts[c - 1]
    starts[0] = 0
    return starts, items
