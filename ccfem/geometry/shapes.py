"""Shapely geometry: types, lines from and to polylines, sections reduced to their corners."""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray, IntArray, repeated
from ccfem.geometry.polylines import pack

Region: TypeAlias = shapely.Polygon | shapely.MultiPolygon
"""An area in a plane, mm: the section of a layer or a part of it; it may be empty."""

Shapes = NDArray[np.object_]
"""An array of shapely geometries."""


def strings(lines: Sequence[FloatArray]) -> Shapes:
    """LineStrings (k,) of some (n_i, 2) polylines."""
    points, offsets = pack(lines)
    return shapely.linestrings(points, indices=np.repeat(np.arange(len(lines)), np.diff(offsets)))


_HAIR = 1e-6
"""Share by which a band is wider where its rows touch along their length."""


def bands(lines: Shapes | Sequence[shapely.Geometry], reach: float, **style: Any) -> Shapes:
    """Area within a distance, mm, of each of some lines, valid whatever the lines do.

    GEOS's buffer of rows that lie side by side, so that their borders coincide, crosses itself now
    and then. What is made valid afterwards may lack area, or stay invalid; rows that overlap by a
    hair do not come to that. `style` goes to `shapely.buffer`.
    """
    lines = np.asarray(lines, dtype=object)
    areas = np.asarray(shapely.buffer(lines, reach, **style), dtype=object)
    crossed = ~shapely.is_valid(areas)
    areas[crossed] = shapely.buffer(lines[crossed], (1.0 + _HAIR) * reach, **style)
    return areas


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


def bends(line: FloatArray, kept: IntArray, tolerance: float) -> IntArray:
    """Points (m,) of a polyline (n, 2), n > 1, between which it is straight to a tolerance, mm.

    The inner points `kept` (k,), in their order, stay whatever the line does there.
    """
    first, last = np.append(0, kept), np.append(kept, len(line) - 1)
    piece, number = repeated(last - first + 1)
    index = first[piece] + number
    # The index of a point rides along as its third coordinate.
    drawn = shapely.linestrings(np.column_stack([line[index], index]), indices=piece)
    simple = shapely.simplify(drawn, tolerance, preserve_topology=False)
    return np.unique(shapely.get_coordinates(simple, include_z=True)[:, 2].astype(np.int64))


# Sections reduced to their corners, so that equal layers of a part are exactly equal.


_STRAIGHT = 1e-6
"""Turn of the border, radians, below which a point lies on a straight side."""


def areas(shape: shapely.Geometry) -> shapely.MultiPolygon:
    """Parts of a shape that have an area.

    Unions and differences leave lines where areas touch, or a collection of nothing; further
    operations refuse both.
    """
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.multipolygons(parts[shapely.get_dimensions(parts) == 2])


_DECIMALS = 11
"""Decimals of coordinates, mm: above the errors of slicing, below what any pattern resolves."""


def corners_only(section: Region) -> Region:
    """Section without the points on its straight sides, which slicing leaves where edges cross.

    Layers of an extruded part become equal, so that everything that depends only on the section can
    be planned once for all of them. Each ring starts at its lowest corner in x, then y; coordinates
    are rounded to 1e-11 mm.
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


# Where points and steps lie: in a section, over a void of it, or outside.


INSIDE, VOID, OUTSIDE = range(3)
"""In the section; in a hole of it, or anywhere else within its outer rings; beyond those."""

TOLERANCE = 1e-4
"""Distance, mm, from the section up to which points count as inside, for rounded coordinates."""


class Pieces(NamedTuple):
    """Steps cut where they cross the boundary of a section, in their order.

    Attributes
    ----------
    step : (q,) int array
        Step that each piece belongs to.
    begin, end : (q,) arrays in [0, 1]
        Shares of the step at which the piece begins and ends; the pieces of a step fill it.
    place : (q,) int array
        INSIDE, VOID or OUTSIDE.
    """

    step: IntArray
    begin: FloatArray
    end: FloatArray
    place: IntArray


def section_places(points: FloatArray, section: Region) -> IntArray:
    """Places of points relative to a section; points up to `TOLERANCE` from it are inside.

    INSIDE, VOID or OUTSIDE for each of the points (n, 2), mm: an (n,) int array.
    """
    return _places(points, shapely.buffer(section, TOLERANCE, quad_segs=2))


def _places(points: FloatArray, section: Region) -> IntArray:
    rings = shapely.get_exterior_ring(shapely.get_parts(section))
    filled = shapely.union_all(shapely.polygons(rings))
    shapely.prepare([section, filled])
    x, y = np.ascontiguousarray(points.T)
    around = np.where(shapely.intersects_xy(filled, x, y), VOID, OUTSIDE)
    return np.where(shapely.intersects_xy(section, x, y), INSIDE, around)


def cut_at_section(
    starts: FloatArray, ends: FloatArray, section: Region, tolerance: float = TOLERANCE
) -> Pieces:
    """Cut straight steps (s, 2), mm, at the boundary of a section.

    What counts as inside, and the tolerance, are as of `section_places`.
    """
    grown = shapely.buffer(section, tolerance, quad_segs=2)
    boundary = shapely.boundary(grown)
    shapely.prepare(boundary)
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    met = np.flatnonzero(shapely.intersects(boundary, lines))
    # If a step runs along the boundary, the ends of that stretch.
    at, number = shapely.get_coordinates(
        shapely.intersection(lines[met], boundary), return_index=True
    )
    number = met[number]
    along = ends - starts
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    share = np.einsum("ij,ij->i", at - starts[number], along[number]) / square[number]
    every = np.arange(len(starts))
    step = np.concatenate([every, every, number])
    share = np.concatenate([0.0 * every, 0.0 * every + 1.0, np.clip(share, 0.0, 1.0)])
    order = np.lexsort((share, step))
    step, share = step[order], share[order]
    piece = np.flatnonzero((step[1:] == step[:-1]) & (share[1:] > share[:-1]))
    step, begin, end = step[piece], share[piece], share[piece + 1]
    middle = starts[step] + 0.5 * (begin + end)[:, None] * along[step]
    return Pieces(step, begin, end, _places(middle, grown))
