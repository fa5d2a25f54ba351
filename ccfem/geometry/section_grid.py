"""A section for compiled loops: the place of a point, and a lower bound of its border distance."""

from typing import NamedTuple

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, repeated
from ccfem.base.compiled import compiled
from ccfem.geometry.shapes import INSIDE, OUTSIDE, VOID, Region

_CELL = 0.5
"""Minimum size of a cell, mm."""
_MOST_CELLS = 1_000_000


class SectionGrid(NamedTuple):
    """Edges of a section by rows of a grid, and distances of the cells to its border.

    Attributes
    ----------
    origin : (2,) array, mm
        Lowest corner of the grid.
    cell : float, mm
        Height of the rows, and size of the cells.
    places : (nx, ny) int array
        INSIDE, VOID or OUTSIDE: of the middle of each cell.
    room : (nx, ny) array, mm
        Radius round any point of the cell that is free of border; 0 close to the border.
    starts, edges : (ny + 1,) int and (e, 4) arrays, mm
        Row j meets ``edges[starts[j]:starts[j + 1]]``, as x, y of both ends.
    outer : (e,) bool array
        Whether an edge is one of an outer ring, not of a hole.
    """

    origin: FloatArray
    cell: float
    places: IntArray
    room: FloatArray
    starts: IntArray
    edges: FloatArray
    outer: BoolArray


def section_grid(section: Region, margin: float) -> SectionGrid:
    """Prepare a section for `place` and `place_and_room`.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    margin : float, mm
        Width by which the grid exceeds the section on every side.

    Returns
    -------
    SectionGrid
        With cells of 0.5 mm, or larger ones if these would be more than a million. Room is known
        where the section and its voids are wider than a cell.
    """
    # Edges of all rings, and whether of an outer one: the first ring of a part.
    parts = shapely.get_parts(section)
    rings = shapely.get_rings(shapely.normalize(parts))
    holes = shapely.get_num_interior_rings(parts)
    first = np.concatenate([[0], np.cumsum(holes + 1)])[:-1]
    points, ring = shapely.get_coordinates(rings, return_index=True)
    follows = ring[1:] == ring[:-1]
    edges = np.concatenate([points[:-1], points[1:]], axis=1)[follows]
    outer = np.isin(ring[1:][follows], first)
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    cell = max(_CELL, float(np.sqrt(np.prod(high - low) / _MOST_CELLS)))
    nx, ny = (np.floor((high - low) / cell) + 1).astype(int)
    # Edges by the rows of the grid that they meet.
    rows = np.sort(((edges[:, [1, 3]] - low[1]) / cell).astype(np.int64), axis=1)
    count = rows[:, 1] - rows[:, 0] + 1
    edge, row = repeated(count)
    row = row + rows[edge, 0]
    starts = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=ny))])
    by_row = edge[np.argsort(row, kind="stable")]
    places, room = np.empty((nx, ny), dtype=np.int64), np.empty((nx, ny))
    bare = SectionGrid(
        low, cell, places, room, starts.astype(np.int64), edges[by_row], outer[by_row]
    )
    _fill_places(bare)
    inside = places == INSIDE
    # A centre of the other side at distance d: the border is no nearer to the centre than about
    # d less one cell's diagonal, and to the rest of the cell by half a diagonal less.
    away = distance_transform_edt(inside) + distance_transform_edt(~inside)
    room[:] = np.maximum(away - 2.2, 0.0) * cell
    return bare


@compiled
def _fill_places(grid: SectionGrid) -> None:
    nx, ny = grid.places.shape
    about, around = np.empty(nx + 1, np.int64), np.empty(nx + 1, np.int64)
    for j in range(ny):
        y = grid.origin[1] + (j + 0.5) * grid.cell
        for i in range(nx + 1):
            about[i], around[i] = 0, 0
        for k in range(grid.starts[j], grid.starts[j + 1]):
            x0, y0, x1, y1 = grid.edges[k]
            if (y0 > y) != (y1 > y):
                x = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
                last = min(int(np.floor((x - grid.origin[0]) / grid.cell + 0.5)), nx)
                sense = 1 if y1 > y0 else -1
                about[last] += sense
                if grid.outer[k]:
                    around[last] += sense
        for i in range(nx - 1, -1, -1):
            about[i] += about[i + 1]
            around[i] += around[i + 1]
            grid.places[i, j] = _place_by_winding(about[i + 1], around[i + 1])


@compiled
def place(grid: SectionGrid, x: float, y: float) -> int:
    """Place of a point: INSIDE the section, in a VOID within its outer rings, or OUTSIDE."""
    j = int(np.floor((y - grid.origin[1]) / grid.cell))
    if j < 0 or j >= grid.room.shape[1]:
        return OUTSIDE
    about, around = 0, 0
    for k in range(grid.starts[j], grid.starts[j + 1]):
        x0, y0, x1, y1 = grid.edges[k]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            sense = 1 if y1 > y0 else -1
            about += sense
            if grid.outer[k]:
                around += sense
    return _place_by_winding(about, around)


@compiled
def contains(grid: SectionGrid, x: float, y: float) -> bool:
    """Whether a point lies in the section."""
    return place(grid, x, y) == INSIDE


@compiled
def _place_by_winding(about: int, around: int) -> int:
    """Place from the winding numbers of all rings, and of the outer rings."""
    if about != 0:
        return INSIDE
    return VOID if around != 0 else OUTSIDE


@compiled
def place_and_room(grid: SectionGrid, x: float, y: float) -> tuple[int, float]:
    """Place of a point, and the radius round it that is free of border; 0 close to the border.

    If the radius is 0, the place is that of the middle of the cell.
    """
    i = int(np.floor((x - grid.origin[0]) / grid.cell))
    j = int(np.floor((y - grid.origin[1]) / grid.cell))
    nx, ny = grid.room.shape
    if i < 0 or j < 0 or i >= nx or j >= ny:
        i, j = min(max(i, 0), nx - 1), min(max(j, 0), ny - 1)
    return grid.places[i, j], grid.room[i, j]
