"""Isocurves of a piecewise linear field on triangles, and the search for their number."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ccfem.arrays import FloatArray, IntArray, repeated
from ccfem.mesh.facets import unique_edges

__all__ = ["Isocontours", "isocontours", "least_distance", "steepest_spacing", "triangle_edges"]


@dataclass(frozen=True)
class Isocontours:
    """Isocurves at equal steps of a field.

    Attributes
    ----------
    points : (P, 2) array, mm
    offsets : (K + 1,) int array
        Curve k holds ``points[offsets[k]:offsets[k + 1]]``; a closed one repeats its first point.
    level : (K,) int array
        Number of the level that each curve lies on.
    edges : (P, 2) int array
        Ends of the triangle edge that each point lies on.
    weights : (P,) array in [0, 1]
        ``points = (1 - weights) * nodes[edges[:, 0]] + weights * nodes[edges[:, 1]]``.
    """

    points: FloatArray
    offsets: IntArray
    level: IntArray
    edges: IntArray
    weights: FloatArray

    def interpolate(self, values: FloatArray) -> FloatArray:
        """Values (P,) at the points of the curves of a field (n,) given at the nodes."""
        a, b = self.edges.T
        return (1.0 - self.weights) * values[a] + self.weights * values[b]

    def lines(self) -> list[FloatArray]:
        """Return the curves as (n_i, 2) arrays."""
        return np.split(self.points, self.offsets[1:-1]) if len(self.level) else []


def isocontours(
    points: FloatArray,
    triangles: IntArray,
    values: FloatArray,
    first: float,
    step: float,
    edges: tuple[IntArray, IntArray] | None = None,
) -> Isocontours:
    """Extract the isocurves at ``first + i * step`` for all whole i that the field reaches.

    Crossings of levels with mesh edges are numbered edge by edge, so that joining the pieces of
    neighbouring triangles needs no search.

    Parameters
    ----------
    points : (n, 2) array, mm
    triangles : (t, 3) int array
    values : (n,) array
        The field; taken as linear on each triangle.
    first, step : float
        A level, and the distance (> 0) to the next.
    edges : tuple of arrays, optional
        `triangle_edges` of the triangles, where they are known already.

    Returns
    -------
    Isocontours
        Sorted by level. Open curves end on the boundary.
    """
    scaled = (values - first) / step
    # A level exactly through a node would cross none or all of its edges.
    scaled = np.where(scaled == np.round(scaled), scaled + 1e-9, scaled)
    ends, of_triangle = triangle_edges(triangles) if edges is None else edges
    low = np.ceil(np.minimum(scaled[ends[:, 0]], scaled[ends[:, 1]])).astype(np.int64)
    high = np.floor(np.maximum(scaled[ends[:, 0]], scaled[ends[:, 1]])).astype(np.int64)
    start = np.concatenate([[0], np.cumsum(np.maximum(high - low + 1, 0))])
    edge, level, weights = _crossings(scaled, ends, low, start)
    line, offsets = _chain(of_triangle, low, high, start)
    order = np.argsort(level[line[offsets[:-1]]], kind="stable")
    sizes = np.diff(offsets)[order]
    nth, number = repeated(sizes)
    taken = line[offsets[:-1][order][nth] + number]
    new_offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    on, w = ends[edge[taken]], weights[taken]
    curve = (1.0 - w)[:, None] * points[on[:, 0]] + w[:, None] * points[on[:, 1]]
    return Isocontours(curve, new_offsets, level[taken[new_offsets[:-1]]], on, w)


def triangle_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return unique edges (e, 2) and the edges (t, 3) opposite to the corners of each triangle."""
    edges, edge = unique_edges(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2))
    return edges, edge.reshape(-1, 3)


@njit(cache=True, nogil=True)
def _crossings(scaled, edges, low, start):  # type: ignore[no-untyped-def]
    edge = np.empty(start[-1], np.int64)
    level = np.empty(start[-1], np.int64)
    weights = np.empty(start[-1])
    for e in range(len(edges)):
        a, b = edges[e]
        for k in range(start[e], start[e + 1]):
            edge[k] = e
            level[k] = low[e] + k - start[e]
            weights[k] = (level[k] - scaled[a]) / (scaled[b] - scaled[a])
    return edge, level, weights


@njit(cache=True, nogil=True)
def _chain(of_triangle, low, high, start):  # type: ignore[no-untyped-def]
    """Curves as crossing numbers with offsets; open ones first end to end, then the closed."""
    count = start[-1]
    link = np.full((count, 2), -1)
    for t in range(len(of_triangle)):
        bottom = min(low[of_triangle[t, 0]], low[of_triangle[t, 1]], low[of_triangle[t, 2]])
        top = max(high[of_triangle[t, 0]], high[of_triangle[t, 1]], high[of_triangle[t, 2]])
        for value in range(bottom, top + 1):
            first = -1
            for side in range(3):
                e = of_triangle[t, side]
                if low[e] <= value <= high[e]:
                    k = start[e] + value - low[e]
                    if first < 0:
                        first = k
                    else:
                        link[first, 1 if link[first, 0] >= 0 else 0] = k
                        link[k, 1 if link[k, 0] >= 0 else 0] = first
    line = np.empty(2 * count, np.int64)
    offsets = np.zeros(count + 1, np.int64)
    used = np.zeros(count, np.bool_)
    found = 0
    size = 0
    for closed in range(2):
        for seed in range(count):
            if used[seed] or link[seed, 0] < 0 or (closed == 0 and link[seed, 1] >= 0):
                continue
            before = -1
            k = seed
            while k >= 0 and not used[k]:
                used[k] = True
                line[size] = k
                size += 1
                following = link[k, 0] if link[k, 0] != before else link[k, 1]
                before = k
                k = following
            if closed == 1:
                line[size] = seed
                size += 1
            found += 1
            offsets[found] = size
    return line[:size], offsets[: found + 1]


@njit(cache=True, nogil=True)
def steepest_spacing(areas, gradient, triangles, values, first, step):  # type: ignore[no-untyped-def]
    """Smallest distance of two neighbouring isocurves that cross the same triangle, mm.

    Infinity where no triangle holds two levels. Cheap, so that a search may reject a number of
    levels before it measures all distances.

    Parameters
    ----------
    areas : (t,) array, mm^2
        Triangles of zero area are passed over.
    gradient : (t, 2) array
        Gradient of the field.
    triangles : (t, 3) int array
    values : (n,) array
    first, step : float
        As in `isocontours`.
    """
    least = np.inf
    for t in range(len(triangles)):
        a, b, c = values[triangles[t, 0]], values[triangles[t, 1]], values[triangles[t, 2]]
        low = np.ceil((min(a, b, c) - first) / step)
        high = np.floor((max(a, b, c) - first) / step)
        if high > low and areas[t] > 0.0:
            steep = np.hypot(gradient[t, 0], gradient[t, 1])
            if steep > 0.0:
                least = min(least, step / steep)
    return least


@njit(cache=True, nogil=True)
def least_distance(points, offsets, level, reach, enough):  # type: ignore[no-untyped-def]
    """Smallest distance between isocurves of neighbouring levels, mm, as far as `reach`.

    Parameters
    ----------
    points, offsets, level
        As in `Isocontours`.
    reach : float, mm
        Distances above this are not looked at; the result is at most `reach`.
    enough : float, mm
        Stop as soon as a distance below this is found.

    Returns
    -------
    float, mm
    """
    count = len(points)
    if count == 0:
        return reach
    x0, y0 = points[:, 0].min(), points[:, 1].min()
    nx = int((points[:, 0].max() - x0) / reach) + 1
    ny = int((points[:, 1].max() - y0) / reach) + 1
    # Each piece goes into every grid cell that its bounding box touches.
    of_piece = np.full(count, -1)
    for k in range(len(level)):
        of_piece[offsets[k] : offsets[k + 1] - 1] = level[k]
    start = np.zeros(nx * ny + 1, np.int64)
    members = np.zeros(0, np.int64)
    for fill in range(2):
        if fill == 1:
            start[1:] = np.cumsum(start[1:])
            members = np.empty(start[-1], np.int64)
            position = start[:-1].copy()
        for s in range(count - 1):
            if of_piece[s] < 0:
                continue
            i0 = int((min(points[s, 0], points[s + 1, 0]) - x0) / reach)
            i1 = int((max(points[s, 0], points[s + 1, 0]) - x0) / reach)
            j0 = int((min(points[s, 1], points[s + 1, 1]) - y0) / reach)
            j1 = int((max(points[s, 1], points[s + 1, 1]) - y0) / reach)
            for i in range(i0, i1 + 1):
                for j in range(j0, j1 + 1):
                    if fill == 0:
                        start[i * ny + j + 1] += 1
                    else:
                        members[position[i * ny + j]] = s
                        position[i * ny + j] += 1
    least = reach * reach
    for k in range(len(level)):
        for p in range(offsets[k], offsets[k + 1]):
            i0 = int((points[p, 0] - x0) / reach)
            j0 = int((points[p, 1] - y0) / reach)
            for i in range(max(i0 - 1, 0), min(i0 + 2, nx)):
                for j in range(max(j0 - 1, 0), min(j0 + 2, ny)):
                    for m in range(start[i * ny + j], start[i * ny + j + 1]):
                        s = members[m]
                        if abs(of_piece[s] - level[k]) != 1:
                            continue
                        dx = points[s + 1, 0] - points[s, 0]
                        dy = points[s + 1, 1] - points[s, 1]
                        px = points[p, 0] - points[s, 0]
                        py = points[p, 1] - points[s, 1]
                        length = dx * dx + dy * dy
                        w = 0.0
                        if length > 0.0:
                            w = min(max((px * dx + py * dy) / length, 0.0), 1.0)
                        distance = (px - w * dx) ** 2 + (py - w * dy) ** 2
                        if distance < least:
                            least = distance
                            if least < enough * enough:
                                return np.sqrt(least)
    return np.sqrt(least)
