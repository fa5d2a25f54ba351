"""Shapely geometry: types, and conversion from and to polylines."""

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import pack

Region = shapely.Polygon | shapely.MultiPolygon
"""An area in a plane, mm: the section of a layer or a part of it; it may be empty."""

Shapes = NDArray[np.object_]
"""An array of shapely geometries."""


def strings(lines: Sequence[FloatArray]) -> Shapes:
    """LineStrings (k,) of some (n_i, 2) polylines."""
    points, offsets = pack(lines)
    return shapely.linestrings(points, indices=np.repeat(np.arange(len(lines)), np.diff(offsets)))


def open_lines(shapes: shapely.Geometry | Shapes) -> list[FloatArray]:
    """Lines of geometries as (k, 2) arrays; pieces that touch end to end are joined."""
    lines = []
    for shape in np.atleast_1d(shapes):
        merged = shape if shape.geom_type == "LineString" else shapely.line_merge(shape)
        lines += [
            shapely.get_coordinates(part)
            for part in shapely.get_parts(merged)
            if part.geom_type == "LineString" and part.length > 0.0
        ]
    return lines
