"""Isocurves of a piecewise linear field on triangles, and the least distance between them."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, repeated
from ccfem.base.compiled import compiled
from ccfem.geometry.facets import unique_edges
from ccfem.geometry.locate import Buckets, bucket
from ccfem.geometry.polylines import starts_segment


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
    # A level exactly at a node would cross none or all of its edges.
    scaled = np.where(scaled == np.round(scaled), scaled + 1e-9, scaled)
    ends, of_triangle = triangle_edges(triangles) if edges is None else edges
    low = np.ceil(np.minimum(scaled[ends[:, 0]], scaled[ends[:, 1]])).astype(np.int64)
    high = np.floor(np.maximum(scaled[ends[:, 0]], scaled[ends[:, 1]])).astype(np.int64)
    start = np.concatenate([[0], np.cumsum(np.maximum(high - low + 1, 0))])
    edge, nth = repeated(np.diff(start))
    level, (before, after) = low[edge] + nth, scaled[ends[edge]].T
    weights = (level - before) / (after - before)
    link = np.full((start[-1], 2), -1)
    _link(of_triangle, low, high, start, link)
    line, offsets = chained(link)
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


@compiled
def _link(
    of_triangle: IntArray, low: IntArray, high: IntArray, start: IntArray, link: IntArray
) -> None:
    """Write the crossings before and after each crossing on its curve, as of `chained`."""
    # A level that crosses a triangle crosses two of its sides: link these two crossings.
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


def chained(link: IntArray) -> tuple[IntArray, IntArray]:
    """Curves through things that are linked to at most two others.

    Parameters
    ----------
    link : (n, 2) int array
        Neighbours of each thing, -1 for none; one that has a single neighbour has it first.

    Returns
    -------
    line : (p,) int array
        Things along the curves, first the open ones, end to end, then the closed ones, whose first
        thing is repeated at the end. Those without a neighbour are left out.
    offsets : (k + 1,) int array
        As in CSR.
    """
    count = len(link)
    line, offsets = np.empty(2 * count, dtype=np.int64), np.zeros(count + 1, dtype=np.int64)
    chains = _follow(link, np.zeros(count, dtype=bool), line, offsets)
    return line[: offsets[chains]], offsets[: chains + 1]


@compiled
def _follow(link: IntArray, used: BoolArray, line: IntArray, offsets: IntArray) -> int:
    """Write the curves of `chained`; returns their number."""
    count, chains, size = len(link), 0, 0
    # Follow the links, first from the things with one link, which are ends; the rest are rings.
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
            chains += 1
            offsets[chains] = size
    return chains


def least_distance(curves: Isocontours, reach: float, enough: float) -> float:
    """Smallest distance between isocurves of neighbouring levels, mm, at most `reach`.

    The search stops at the first distance below `enough`.
    """
    start = np.flatnonzero(starts_segment(curves.offsets))
    if not len(start):
        return reach
    a, b = curves.points[start], curves.points[start + 1]
    # Each point then has all pieces within reach in its own cell.
    grid = bucket(np.minimum(a, b) - reach, np.maximum(a, b) + reach, reach)
    level = np.repeat(curves.level, np.diff(curves.offsets))
    return float(_least_distance(grid, start, curves.points, level, reach, enough))


@compiled
def _least_distance(
    grid: Buckets, start: IntArray, points: FloatArray, level: IntArray, reach: float, enough: float
) -> float:
    least = reach * reach
    for p in range(len(points)):
        i = int((points[p, 0] - grid.origin[0]) / grid.cell)
        j = int((points[p, 1] - grid.origin[1]) / grid.cell)
        box = i * grid.shape[1] + j
        for item in range(grid.starts[box], grid.starts[box + 1]):
            s = start[grid.items[item]]
            if abs(level[s] - level[p]) != 1:
                continue
            dx, dy = points[s + 1, 0] - points[s, 0], points[s + 1, 1] - points[s, 1]
            px, py = points[p, 0] - points[s, 0], points[p, 1] - points[s, 1]
            length = dx * dx + dy * dy
            w = 0.0
            if length > 0.0:
                w = min(max((px * dx + py * dy) / length, 0.0), 1.0)
            least = min(least, (px - w * dx) ** 2 + (py - w * dy) ** 2)
        if least < enough * enough:
            break
    return np.sqrt(least)
