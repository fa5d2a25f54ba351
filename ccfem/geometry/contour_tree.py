"""Contours of the distance to the border of a section, and the tree of which lie side by side.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998, measure the distance along the surface. In
the plane, or in a chart of the layer, the contours are offsets of the border, which are exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.geometry.offsets import ring_from, rings
from ccfem.geometry.polylines import line_length, resample
from ccfem.geometry.shapes import Region

SAMPLES = 3
"""Samples of a contour per spacing of length."""
_QUARTER = 16
"""Segments per quarter turn round a re-entrant corner."""
_SHORTEST = 2.2
"""Length of the shortest contour that is kept, in spacings."""
_NEXT, _RIDGE = 1.8, 2.1
"""Distance, in spacings, up to which contours lie side by side: of neighbouring levels, and of one
level on both sides of a ridge. Where contours end early, the ridge is that much wider."""
_RIDGE_COST = 3.0
"""Extra weight of a link across a ridge, in spacings."""
_LONGER = 1e-3
"""Weight, in spacings, that prefers long contours among those at the same distance."""


@dataclass(frozen=True)
class ContourTree:
    """Contours of one connected piece of a section.

    Attributes
    ----------
    contours : tuple of (n, 2) arrays, mm
        Closed rings, evenly sampled, with `SAMPLES` points or slightly fewer a spacing; the first
        point is not repeated.
    level : (k,) int array
        Distance of each contour inside the outermost one, in spacings.
    parent : (k,) int array
        The contour that each is attached to; -1 for the outermost one, which is the first.
    """

    contours: tuple[FloatArray, ...]
    level: IntArray
    parent: IntArray


def contour_trees(
    section: Region, spacing: float, start: FloatArray, closest: float, radius: float = 0.0
) -> list[ContourTree]:
    """Trees of the contours at half a spacing from the border and at every further spacing inwards.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    spacing : float, mm
    start : (2,) array, mm
        Every contour begins at its point nearest to this.
    closest : float
        Least distance between opposite sides of a contour, in spacings, from 0 to 1. A contour ends
        where it is narrower, and splits at a neck.
    radius : float, mm, default 0
        Least radius of the inner corners of contours. The contours stay a spacing apart, so the
        corners of the section stay open.

    Returns
    -------
    list of ContourTree
        One for each connected piece that is wide enough, and long enough for a contour.
    """
    narrow = 0.4995 * closest * spacing
    trees = []
    for piece in shapely.get_parts(_level(section, 0.5 * spacing, narrow, radius)):
        found: list[FloatArray] = []
        level: list[int] = []
        here = rings(piece)
        while here:
            long = [ring for ring in here if line_length(ring) >= _SHORTEST * spacing]
            depth = level[-1] + 1 if level else 0
            if not long:
                break
            found += [_sampled(ring_from(ring, start), spacing) for ring in long]
            level += [depth] * len(long)
            deeper = shapely.get_parts(_level(section, (1.5 + depth) * spacing, narrow, radius))
            here = rings(shapely.multipolygons(deeper[shapely.intersects(deeper, piece)]))
        if found:
            trees += _grown(found, np.array(level), spacing, _RIDGE + closest)
    return trees


def _level(section: Region, distance: float, narrow: float, radius: float) -> Region:
    """Return the region at a distance from the border, with rounded corners, that is wide enough.

    All in mm. A border is rounded by the discs of the radius that fit on the material's side,
    regardless of other borders. So a border rounded further in lies further in by that distance.
    """
    inner = shapely.buffer(section, -distance, quad_segs=_QUARTER)
    if radius > 0.0:
        parts = shapely.get_parts(inner)
        outer = _opened(shapely.polygons(shapely.get_exterior_ring(parts)), radius)
        holes = [shapely.Polygon(ring) for part in parts for ring in part.interiors]
        inner = shapely.union_all(outer)
        if holes:
            inner = shapely.difference(inner, shapely.union_all(_opened(holes, -radius)))
    return _opened(inner, narrow)


def _opened(region: Any, radius: float) -> Any:
    """Return what discs of a radius, mm, reach inside; if negative, what they miss outside."""
    if radius == 0.0:
        return region
    inner = shapely.buffer(region, -radius, quad_segs=_QUARTER)
    return shapely.buffer(inner, radius, quad_segs=_QUARTER)


def _sampled(ring: FloatArray, spacing: float) -> FloatArray:
    """Ring in even steps of at least a third of a spacing, without repeating its first point."""
    count = max(int(line_length(ring) * SAMPLES / spacing), 4)
    points, _ = resample(ring, np.array([0, len(ring)]), line_length(ring) / count * (1.0 + 1e-9))
    return points[:-1]


def _grown(
    found: Sequence[FloatArray], level: IntArray, spacing: float, reach: float
) -> list[ContourTree]:
    """Trees of contours: minimum spanning trees over those that lie side by side."""
    lines = np.array([shapely.linearrings(ring) for ring in found])
    one, other = shapely.STRtree(lines).query(lines, "dwithin", reach * spacing)
    kept = (one < other) & (np.abs(level[one] - level[other]) <= 1)
    one, other = one[kept], other[kept]
    apart = shapely.distance(lines[one], lines[other]) / spacing
    ridge = level[one] == level[other]
    links = shapely.shortest_line(lines[one], lines[other])
    link, met = shapely.STRtree(lines).query(links, "intersects")
    over = (met != one[link]) & (met != other[link])
    kept = ridge | (apart < _NEXT)
    kept[link[over]] = False  # with another contour between them
    one, other, apart, ridge = one[kept], other[kept], apart[kept], ridge[kept]
    size = shapely.length(lines) / shapely.length(lines).max()
    weight = np.round(apart, 3) + _RIDGE_COST * ridge + _LONGER * (2.0 - size[one] - size[other])
    count = len(found)
    forest = minimum_spanning_tree(coo_array((weight, (one, other)), shape=(count, count)).tocsr())
    trees = []
    left = np.ones(count, dtype=bool)
    while left.any():
        outer = np.flatnonzero(left & (level == level[left].min()))
        root = int(outer[np.argmax(size[outer])])
        order, before = breadth_first_order(forest, root, directed=False)
        left[order] = False
        number = np.empty(count, dtype=np.int64)
        number[order] = np.arange(len(order))
        parent = np.append(-1, number[before[order[1:]]])
        trees.append(
            ContourTree(
                tuple(read_only(found[k], float) for k in order.tolist()),
                read_only(level[order], int),
                read_only(parent, int),
            )
        )
    return trees
