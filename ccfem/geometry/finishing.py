"""From curves to paths that can be printed: kept off the border, linked, short ones dropped."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.geometry.joining import link_ends
from ccfem.geometry.rings import close_short_ring

__all__ = ["keep_off_border", "linked_paths"]


def keep_off_border(lines: Sequence[FloatArray], section: Any, inset: float) -> list[FloatArray]:
    """Parts of lines that keep a distance from the border of a section.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : Polygon or MultiPolygon
    inset : float >= 0, mm
        0 leaves the lines as they are, even those outside.

    Returns
    -------
    list of (n_i, 2) arrays
        A closed line stays closed only where all of it is kept.
    """
    if inset == 0.0:
        return list(lines)
    room = shapely.buffer(section, -inset)
    shapely.prepare(room)
    kept = []
    for line in lines:
        string = shapely.linestrings(line)
        if shapely.covers(room, string):
            kept.append(line)
            continue
        inside = shapely.intersection(string, room)
        if inside.geom_type == "MultiLineString":
            inside = shapely.line_merge(inside)
        parts = shapely.get_parts(inside)
        strings = parts[shapely.get_type_id(parts) == 1]
        kept += [shapely.get_coordinates(part) for part in strings if part.length > 0.0]
    return kept


def linked_paths(
    lines: list[FloatArray],
    section: Any,
    width: float,
    link_limit: float,
    least_length: float,
    along_boundary: bool = True,
) -> list[FloatArray]:
    """Link the ends of strands, close short rings, and drop what is too short to be cut.

    Parameters
    ----------
    lines : list of (n_i, 2) arrays, mm
        Strands about a width apart.
    section : Polygon or MultiPolygon
    width : float, mm
        Of a strand.
    link_limit : float, mm
        Longest link.
    least_length : float, mm
        Of a path (`Machine.minimum_length`).
    along_boundary : bool, default True
        Whether links may follow the boundary; otherwise all are straight.
    """
    lines = link_ends(lines, section, link_limit, width, along_boundary=along_boundary)
    lines = [close_short_ring(line, least_length) for line in lines]
    return [line for line in lines if _length(line) >= least_length]


def _length(line: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
