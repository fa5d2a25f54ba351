"""How much of some surfaces lies in each of the tetrahedra that they run through."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.locate import Buckets, barycentric_maps, bucket, locate

_ROUNDING = 1e-9
"""Distance from a face up to which a triangle lies in it, in the largest coordinate."""


class _Cells(NamedTuple):
    """Tetrahedra by their boxes and barycentric coordinates.

    Attributes
    ----------
    low, high : (m, 3) arrays, mm
    origins : (m, 3) array, mm
        First corners.
    gradients : (m, 4, 3) array, 1/mm
    heights : (m, 4) array, mm
        Over the face opposite to each corner; 0 in a flat cell.
    across : (m, 4) int array
        Cell across that face, -1 for none.
    """

    low: FloatArray
    high: FloatArray
    origins: FloatArray
    gradients: FloatArray
    heights: FloatArray
    across: IntArray


def areas_in_cells(
    points: FloatArray, cells: IntArray, across: IntArray, surfaces: Iterable[FloatArray]
) -> FloatArray:
    """Area of some surfaces in each tetrahedron, (m,), mm^2.

    Triangles are clipped by the faces of the cells. Two cells on both sides of a face in a surface
    share its area. What lies outside all cells counts to the one nearest to the middle of its
    triangle, so that the sum is the area of the surfaces.

    Parameters
    ----------
    points : (n, 3) array, mm
    cells : (m, 4) int array
    across : (m, 4) int array
        Cell across the face opposite to each corner, -1 for none.
    surfaces : iterable of (t, 3, 3) arrays, mm
        Corners of their triangles, of any size.
    """
    corners = points[cells]
    rounding = _ROUNDING * float(np.abs(corners).max())
    low, high = corners.min(axis=1) - rounding, corners.max(axis=1) + rounding
    tetrahedra = _Cells(low, high, *barycentric_maps(corners), np.ascontiguousarray(across))
    grid, areas = bucket(low, high), np.zeros(len(cells))
    for surface in surfaces:
        a, b, c = np.moveaxis(surface, 1, 0)
        size = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        rest = _clip_all(grid, tetrahedra, surface, size, rounding, areas)
        outside = np.flatnonzero(rest > _ROUNDING * size)
        nearest, _ = locate(points, cells, surface[outside].mean(axis=1), float(np.ptp(corners)))
        areas += np.bincount(nearest, rest[outside], len(cells))
    return areas


@njit(cache=True, nogil=True)
def _clip_all(
    grid: Buckets,
    cells: _Cells,
    surface: FloatArray,
    size: FloatArray,
    rounding: float,
    areas: FloatArray,
) -> FloatArray:
    """Area of each triangle that is in no cell; those in cells are added to `areas`."""
    rest = size.copy()
    seen = np.full(len(areas), -1, np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    least, most = np.empty(3), np.empty(3)
    away = np.empty((4, 3))
    polygon, clipped = np.empty((16, 2)), np.empty((16, 2))
    for t in range(len(surface)):
        for d in range(3):
            least[d] = min(surface[t, 0, d], surface[t, 1, d], surface[t, 2, d])
            most[d] = max(surface[t, 0, d], surface[t, 1, d], surface[t, 2, d])
            start = int(np.floor((least[d] - grid.origin[d]) / grid.cell))
            stop = int(np.floor((most[d] - grid.origin[d]) / grid.cell))
            first[d], last[d] = max(start, 0), min(stop, grid.shape[d] - 1)
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    box = (i * grid.shape[1] + j) * grid.shape[2] + k
                    for item in range(grid.starts[box], grid.starts[box + 1]):
                        m = grid.items[item]
                        if seen[m] == t:
                            continue
                        seen[m] = t
                        apart = cells.heights[m, 0] == 0.0
                        for d in range(3):
                            apart = apart or cells.low[m, d] > most[d]
                            apart = apart or cells.high[m, d] < least[d]
                        if apart:
                            continue
                        share = _distances(cells, m, surface[t], rounding, away)
                        if share > 0.0:
                            share *= _clipped(away, rounding, polygon, clipped)
                        areas[m] += share * size[t]
                        rest[t] -= share * size[t]
    return rest


@njit(cache=True, nogil=True)
def _distances(
    cells: _Cells, m: int, corners: FloatArray, rounding: float, away: FloatArray
) -> float:
    """Distances (4, 3) of three corners from the faces of a cell, inwards; written.

    What is returned is 0 where the triangle is outside one, a half where it lies in one that a
    second cell has too, else 1.
    """
    for c in range(3):
        rest = 1.0
        for face in range(1, 4):
            value = 0.0
            for d in range(3):
                value += cells.gradients[m, face, d] * (corners[c, d] - cells.origins[m, d])
            rest -= value
            away[face, c] = value * cells.heights[m, face]
        away[0, c] = rest * cells.heights[m, 0]
    share = 1.0
    for face in range(4):
        if max(away[face, 0], away[face, 1], away[face, 2]) <= rounding:
            if min(away[face, 0], away[face, 1], away[face, 2]) < -rounding:
                return 0.0
            share = 0.5 if cells.across[m, face] >= 0 else 1.0
            # All of it is inside this face.
            for c in range(3):
                away[face, c] = 0.0
    return share


@njit(cache=True, nogil=True)
def _clipped(away: FloatArray, rounding: float, polygon: FloatArray, clipped: FloatArray) -> float:
    """Share of a triangle inside four faces, from the distances of its corners (4, 3).

    Sutherland and Hodgman 1974, in coordinates (u, v) that are (0, 0), (1, 0) and (0, 1) at the
    corners. Two polygons are overwritten.
    """
    polygon[0, 0], polygon[0, 1] = 0.0, 0.0
    polygon[1, 0], polygon[1, 1] = 1.0, 0.0
    polygon[2, 0], polygon[2, 1] = 0.0, 1.0
    count = 3
    for face in range(4):
        base, along, across = away[face, 0], away[face, 1], away[face, 2]
        if min(base, along, across) >= -rounding:
            continue
        along, across = along - base, across - base
        kept = 0
        for c in range(count):
            u, v = polygon[c]
            p, q = polygon[(c + 1) % count]
            here, there = base + along * u + across * v, base + along * p + across * q
            if here >= 0.0:
                clipped[kept, 0], clipped[kept, 1] = u, v
                kept += 1
            if (here >= 0.0) != (there >= 0.0):
                w = here / (here - there)
                clipped[kept, 0], clipped[kept, 1] = u + w * (p - u), v + w * (q - v)
                kept += 1
        count = kept
        for c in range(count):
            polygon[c, 0], polygon[c, 1] = clipped[c, 0], clipped[c, 1]
    total = 0.0
    for c in range(count):
        u, v = polygon[c]
        p, q = polygon[(c + 1) % count]
        total += u * q - p * v
    return total
