"""Outlines without the shortest edges, which would make cells a thousand times as long as high.

They come about where the outline of a design meets the border of the whole part.
"""

from typing import Any

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray

_ON = 1e-7
"""Distance, mm, from a border or a point up to which a vertex lies on it."""


def without_short_edges(outline: Any, whole: Any, keep: FloatArray, least: float) -> Any:
    """Leave out vertices of an outline until no edge is shorter than a length, where that can be.

    Of the two ends of such an edge, one that is to be kept stays, then one on the border of the
    whole part, whose walls stay where they are; of two alike the one at the sharper corner.

    Parameters
    ----------
    outline : shapely Polygon, mm
    whole : shapely Polygon, mm
        Whose border the outline follows in places.
    keep : (k, 2) array, mm
        Points that stay.
    least : float, mm

    Returns
    -------
    shapely Polygon
        The outline itself where what is left would not be valid.
    """
    border, points = shapely.boundary(whole), shapely.multipoints(keep)
    rings = []
    for ring in (outline.exterior, *outline.interiors):
        vertices = shapely.get_coordinates(ring)[:-1]
        places = shapely.points(vertices)
        rank = np.where(shapely.distance(places, border) <= _ON, 1, 0)
        if len(keep):
            rank[shapely.distance(places, points) <= _ON] = 2
        rings.append(_shortened(vertices, rank, least))
    found = shapely.Polygon(rings[0], rings[1:])
    return found if found.is_valid else outline


def _shortened(vertices: FloatArray, rank: IntArray, least: float) -> FloatArray:
    """Ring of vertices (n, 2), not closed, without those that its short edges do not need."""
    while len(vertices) > 3:
        step = np.roll(vertices, -1, axis=0) - vertices
        size = np.hypot(*step.T)
        after = np.roll(np.arange(len(vertices)), -1)
        loose = np.minimum(rank, rank[after]) < 2
        k = int(np.argmin(np.where(loose, size, np.inf)))
        if not loose[k] or size[k] >= least:
            break
        before = np.roll(step, 1, axis=0)
        cross = before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0]
        turn = np.abs(np.arctan2(cross, (before * step).sum(axis=1)))
        ends = (k, int(after[k]))
        left_out = min(ends, key=lambda n: (rank[n], turn[n]))
        vertices, rank = np.delete(vertices, left_out, axis=0), np.delete(rank, left_out)
    return vertices
