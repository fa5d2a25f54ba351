"""Where points and steps lie: in a section, over a void of it, or outside."""

from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.shapes import Region

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
    """Cut straight steps at the boundary of a section.

    Parameters
    ----------
    starts, ends : (s, 2) arrays, mm
    section, tolerance
        As in `section_places`.
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
