"""Strands moved aside by less than a width, so that they keep their distance and stay inside.

Where strands are nearer to each other than their width, or to the border than half of it, cutting
them would break the strands that carry most. They are pushed apart instead, a little in each of
many sweeps, as particles of a granular flow are.
"""

import itertools
from collections.abc import Sequence

import numpy as np
import shapely
from numba import njit

from ccfem.arrays import FloatArray
from ccfem.geometry.polylines import along_line, is_closed, pack, resample
from ccfem.geometry.shapes import Region

__all__ = ["spread"]

_STEP = 0.7
"""Distance of the points of a strand while it moves, in widths."""
_SWEEPS = (40, 20)
"""Sweeps that move strands smoothly, and then almost point by point."""
_PASSES = (12, 2)
"""Averages over neighbours that the moves of such a sweep get."""
_AIM = 1.002
"""Distance that strands are pushed to, in widths."""
_OVER = 1.2
"""Share of what is missing by which two strands together are pushed apart in one sweep."""
_OWN = 5.0
"""Arc length, in widths, from which on a strand keeps a distance from itself."""
_STEEP = 3.0
"""Length, in widths, of ends outside the room that are cut off: others lie along its border."""
_SNAP = 1e-4
"""Depth, in widths, to which what is outside is put inside."""


def spread(
    lines: Sequence[FloatArray], room: Region, width: float, radius: float
) -> list[FloatArray]:
    """Move strands aside until they are a width apart and inside a region, as far as that goes.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        A closed one stays closed.
    room : Polygon or MultiPolygon
        Where strands may lie.
    width : float, mm
        Least distance of strands.
    radius : float, mm
        Least radius: sharper bends are smoothed on the way.

    Returns
    -------
    list of (m_i, 2) arrays, mm
        In steps of about 0.7 widths, in the order of those given, without ends that lead straight
        out of the region. Where strands are too many for
        the room they stay too near to each other.
    """
    if not lines or shapely.is_empty(room):
        return []
    room = shapely.buffer(room, -_SNAP * width)
    shapely.prepare(room)
    points, offsets = resample(*pack(lines), _STEP * width)
    cut = [
        _without_steep_ends(points[a:b], room, _STEEP * width)
        for a, b in itertools.pairwise(offsets)
    ]
    cut = [line for line in cut if len(line) > 1]
    if not cut:
        return []
    closed = np.array([is_closed(line) for line in cut])
    points, offsets = pack(cut)
    edge = shapely.boundary(room)
    points = _inside(points, room, edge)
    for sweeps, passes in zip(_SWEEPS, _PASSES, strict=True):
        for _ in range(sweeps):
            points = points + _pushes(points, offsets, closed, width, passes)
            points = _inside(_eased(points, offsets, closed, radius), room, edge)
    return [points[a:b] for a, b in itertools.pairwise(offsets)]


def _without_steep_ends(line: FloatArray, room: Region, reach: float) -> FloatArray:
    """Open line without ends that leave the room for good within a reach, mm."""
    within = np.flatnonzero(shapely.contains_xy(room, line))
    if is_closed(line) or not len(within):
        return line
    along = along_line(line)
    first, last = within[0], within[-1]
    start = first if along[first] <= reach else 0
    end = last if along[-1] - along[last] <= reach else len(line) - 1
    return line[start : end + 1]


def _inside(points: FloatArray, room: Region, edge: shapely.Geometry) -> FloatArray:
    """Points (n, 2), those outside a region moved to the nearest place on its border."""
    out = np.flatnonzero(~shapely.contains_xy(room, points))
    if len(out):
        ways = shapely.shortest_line(edge, shapely.points(points[out]))
        points = points.copy()
        points[out] = shapely.get_coordinates(ways)[::2]
    return points


@njit(cache=True, nogil=True)
def _neighbours(offsets, closed):  # type: ignore[no-untyped-def]
    """Points before and after each point (n,) of its line; at an end the point itself."""
    before, after = np.arange(offsets[-1]) - 1, np.arange(offsets[-1]) + 1
    for k in range(len(offsets) - 1):
        first, last = offsets[k], offsets[k + 1] - 1
        before[first] = last - 1 if closed[k] else first
        after[last] = first + 1 if closed[k] else last
    return before, after


@njit(cache=True, nogil=True)
def _pushes(points, offsets, closed, width, passes):  # type: ignore[no-untyped-def]
    """Way (n, 2) of every point, across its line, off the nearest strands on both sides."""
    count, apart = len(points), _AIM * width
    before, after = _neighbours(offsets, closed)
    line, along = np.empty(count, np.int64), np.zeros(count)
    for k in range(len(offsets) - 1):
        line[offsets[k] : offsets[k + 1]] = k
        for p in range(offsets[k] + 1, offsets[k + 1]):
            along[p] = along[p - 1] + np.sqrt(((points[p] - points[p - 1]) ** 2).sum())
    # Points by cells that no step and no distance of interest is longer than.
    cell = apart + width
    x0, y0 = points[:, 0].min(), points[:, 1].min()
    nx = int((points[:, 0].max() - x0) / cell) + 1
    ny = int((points[:, 1].max() - y0) / cell) + 1
    head, following = np.full((nx, ny), -1), np.full(count, -1)
    for p in range(count):
        i, j = int((points[p, 0] - x0) / cell), int((points[p, 1] - y0) / cell)
        following[p] = head[i, j]
        head[i, j] = p
    push = np.zeros((count, 2))
    for p in range(count):
        x, y = points[p]
        tangent = points[after[p]] - points[before[p]]
        size = np.sqrt((tangent**2).sum())
        if size == 0.0:
            continue
        across_x, across_y = -tangent[1] / size, tangent[0] / size
        whole = along[offsets[line[p] + 1] - 1]
        left = right = 0.0  # what is missing on either side
        i, j = int((x - x0) / cell), int((y - y0) / cell)
        for a in range(max(i - 1, 0), min(i + 2, nx)):
            for b in range(max(j - 1, 0), min(j + 2, ny)):
                q = head[a, b]
                while q >= 0:
                    arc = abs(along[p] - along[q])
                    if closed[line[p]]:
                        arc = min(arc, whole - arc)
                    if after[q] != q and (line[q] != line[p] or arc > _OWN * width):
                        dx, dy = points[after[q]] - points[q]
                        squared = max(dx * dx + dy * dy, 1e-300)
                        ex, ey = x - points[q, 0], y - points[q, 1]
                        share = min(max((ex * dx + ey * dy) / squared, 0.0), 1.0)
                        ex, ey = ex - share * dx, ey - share * dy
                        distance = max(np.sqrt(ex * ex + ey * ey), 1e-9)
                        side = (ex * across_x + ey * across_y) / distance
                        missing = max(apart - distance, 0.0) * abs(side)
                        if side > 0.0:
                            right = max(right, missing)
                        else:
                            left = max(left, missing)
                    q = following[q]
        way = 0.5 * _OVER * (right - left)
        push[p, 0], push[p, 1] = way * across_x, way * across_y
    for _ in range(passes):
        push = 0.5 * push + 0.25 * (push[before] + push[after])
    for k in range(len(closed)):
        if closed[k]:
            push[offsets[k + 1] - 1] = push[offsets[k]]
    return push


@njit(cache=True, nogil=True)
def _eased(points, offsets, closed, radius):  # type: ignore[no-untyped-def]
    """Points (n, 2), those at bends sharper than a radius moved half way to where they keep it."""
    before, after = _neighbours(offsets, closed)
    result = points.copy()
    for p in range(len(points)):
        q, r = before[p], after[p]
        if q == p or r == p:
            continue
        middle = 0.5 * (points[q] + points[r])
        sag = np.sqrt(((points[p] - middle) ** 2).sum())
        most = 0.125 * ((points[r] - points[q]) ** 2).sum() / radius
        if sag > most:
            result[p] = middle + (points[p] - middle) * (0.5 + 0.5 * most / sag)
    for k in range(len(closed)):
        if closed[k]:
            result[offsets[k + 1] - 1] = result[offsets[k]]
    return result
