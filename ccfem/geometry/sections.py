"""Sections reduced to their corners, so that equal layers of a part are exactly equal."""

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import Region

_STRAIGHT = 1e-6
"""Turn of the border, radians, below which a point lies on a straight side."""
_DECIMALS = 11
"""Decimals of coordinates, mm: above the errors of slicing, below what any pattern resolves."""


def corners_only(section: Region) -> Region:
    """Section without the points on its straight sides, which slicing leaves where edges cross.

    Layers of an extruded part become equal, so that everything that depends only on the section can
    be planned once for all of them.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm

    Returns
    -------
    shapely (Multi)Polygon, mm
        Each ring starts at its lowest corner in x, then y; coordinates are rounded to 1e-11 mm.
    """
    parts = []
    for part in shapely.get_parts(section):
        rings = [_ring_corners(shapely.get_coordinates(ring)) for ring in shapely.get_rings(part)]
        if rings and len(rings[0]) > 2:
            inner = sorted((ring for ring in rings[1:] if len(ring) > 2), key=lambda x: tuple(x[0]))
            parts.append(shapely.Polygon(rings[0], inner))
    parts.sort(key=lambda part: part.bounds)
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def _ring_corners(ring: FloatArray) -> FloatArray:
    """Points of a closed ring where it turns, the first one not repeated."""
    points = ring[:-1]
    while len(points) > 2:
        before = points - np.roll(points, 1, axis=0)
        after = np.roll(before, -1, axis=0)
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        along = np.einsum("ij,ij->i", before, after)
        turns = np.abs(cross) > _STRAIGHT * np.abs(along)
        turns |= along < 0.0
        if turns.all():
            break
        points = points[turns]
    points = np.round(points, _DECIMALS) + 0.0
    return np.roll(points, -np.lexsort(points.T[::-1])[0], axis=0) if len(points) else points
