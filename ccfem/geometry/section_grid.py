"""A section for compiled loops: whether a point lies in it, and how far its border is at least."""

from typing import Any, NamedTuple

import numpy as np
import shapely
from numba import njit
from scipy.ndimage import distance_transform_edt

from ccfem.arrays import FloatArray, IntArray

__all__ = ["SectionGrid", "contains", "section_grid", "side_and_room"]

_MOST_CELLS = 1_000_000


class SectionGrid(NamedTuple):
    """Edges of a section by rows of a grid, and distances of the cells to its border.

    Attributes
    ----------
    origin : (2,) array, mm
        Lowest corner of the grid.
    cell : float, mm
        Height of the rows, and size of the cells.
    room : (nx, ny) array, mm
        No point of the border is nearer to any point of a cell; positive inside the section,
        negative outside, 0 close to the border.
    starts, edges : (ny + 1,) int and (e, 4) arrays, mm
        Row j meets ``edges[starts[j]:starts[j + 1]]``, as x, y of both ends.
    """

    origin: FloatArray
    cell: float
    room: FloatArray
    starts: IntArray
    edges: FloatArray


def section_grid(section: Any, margin: float, cell: float = 0.5) -> SectionGrid:
    """Prepare a section for `contains` and `side_and_room`.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    margin : float, mm
        By how much the grid is larger than the section on every side.
    cell : float, mm, default 0.5
        Made larger where the grid would have more than a million cells. Room is known where the
        section and its voids are wider than this.
    """
    points, ring = shapely.get_coordinates(
        shapely.get_rings(shapely.get_parts(section)), return_index=True
    )
    follows = ring[1:] == ring[:-1]
    edges = np.concatenate([points[:-1], points[1:]], axis=1)[follows]
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    cell = max(cell, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    nx, ny = (np.floor((high - low) / cell) + 1).astype(int)
    rows = np.sort(((edges[:, [1, 3]] - low[1]) / cell).astype(np.int64), axis=1)
    count = rows[:, 1] - rows[:, 0] + 1
    edge = np.repeat(np.arange(len(edges)), count)
    row = rows[edge, 0] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=ny))])
    by_row = np.ascontiguousarray(edges[edge[np.argsort(row, kind="stable")]])
    bare = SectionGrid(low, cell, np.zeros((nx, ny)), starts.astype(np.int64), by_row)
    inside = _centres_inside(bare)
    # A centre of the other side at distance d: the border is no nearer to the centre than about
    # d less one cell's diagonal, and to the rest of the cell by half a diagonal less.
    away = distance_transform_edt(inside) - distance_transform_edt(~inside)
    room = np.sign(away) * np.maximum(np.abs(away) - 2.2, 0.0) * cell
    return bare._replace(room=room)


@njit(cache=True, nogil=True)
def _centres_inside(grid):  # type: ignore[no-untyped-def]
    nx, ny = grid.room.shape
    inside = np.zeros((nx, ny), np.bool_)
    for j in range(ny):
        y = grid.origin[1] + (j + 0.5) * grid.cell
        for k in range(grid.starts[j], grid.starts[j + 1]):
            x0, y0, x1, y1 = grid.edges[k]
            if (y0 > y) != (y1 > y):
                x = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
                last = int(np.floor((x - grid.origin[0]) / grid.cell + 0.5))
                for i in range(min(last, nx)):
                    inside[i, j] = not inside[i, j]
    return inside


@njit(cache=True, nogil=True)
def contains(grid, x, y):  # type: ignore[no-untyped-def]
    """Whether a point lies in the section."""
    j = int(np.floor((y - grid.origin[1]) / grid.cell))
    if j < 0 or j >= grid.room.shape[1]:
        return False
    inside = False
    for k in range(grid.starts[j], grid.starts[j + 1]):
        x0, y0, x1, y1 = grid.edges[k]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            inside = not inside
    return inside


@njit(cache=True, nogil=True)
def side_and_room(grid, x, y):  # type: ignore[no-untyped-def]
    """Distance that is free of border: positive inside, negative outside, 0 close to the border."""
    i = int(np.floor((x - grid.origin[0]) / grid.cell))
    j = int(np.floor((y - grid.origin[1]) / grid.cell))
    nx, ny = grid.room.shape
    if i < 0 or j < 0 or i >= nx or j >= ny:
        i, j = min(max(i, 0), nx - 1), min(max(j, 0), ny - 1)
    return grid.room[i, j]
