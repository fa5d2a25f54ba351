"""From curves to printable paths: kept off the border, linked, and without short ones."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import along_line, is_closed, line_length, points_along
from ccfem.geometry.shapes import Region, open_lines
from ccfem.paths.linking.joining import Joined, link_ends

_OVERLAP = 0.1
"""Largest share of a ring's length that is laid twice [Chen et al. 2021: the ring round a hole of
10.9 mm is 40.8 mm long, against a minimum of 42 mm]."""


def keep_off_border(lines: Sequence[FloatArray], section: Region, inset: float) -> list[FloatArray]:
    """Parts of lines that keep a given distance from the border of a section.

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
        kept += open_lines(shapely.intersection(string, room))
    return kept


def linked_paths(
    lines: list[FloatArray],
    section: Region,
    width: float,
    link_limit: float,
    least_length: float,
    along_boundary: bool = True,
    radius: float = 0.0,
) -> Joined:
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
    radius : float, mm, default 0
        Least radius of a turn; 0 for any. Above 0, links with corners join only strands too short
        to be cut alone, and are marked.
    """
    joined = link_ends(lines, section, link_limit, width, 1.0, along_boundary, radius, least_length)
    return long_enough(joined, least_length)


def long_enough(joined: Joined, least_length: float) -> Joined:
    """Close short rings, and drop what is too short to be cut.

    Parameters
    ----------
    least_length : float, mm
        Of a path.
    """
    kept = Joined([], [])
    for line, link in zip(*joined, strict=True):
        closed = close_short_ring(line, least_length)
        if line_length(closed) >= least_length:
            again = len(closed) - len(line)
            kept.lines.append(closed)
            kept.link.append(_run_on(link, again) if again else link)
    return kept


def _run_on(link: BoolArray, again: int) -> BoolArray:
    """Mark the steps of a ring that is continued over its first `again` steps."""
    longer = np.concatenate([link[:-1], link[: again + 1]])
    longer[-1] = False  # no step leaves the last point
    return longer


def close_short_ring(line: FloatArray, least_length: float) -> FloatArray:
    """Continue a closed line that is up to a tenth too short over its own start.

    Parameters
    ----------
    line : (n, 2) array, mm
        Returned unchanged if it is open, long enough, or even shorter.
    least_length : float, mm

    Returns
    -------
    (n, 2) array
        The line, open and exactly `least_length` long where it was lengthened.
    """
    length = line_length(line)
    missing = least_length - length
    if not is_closed(line) or not 0.0 < missing <= _OVERLAP * length:
        return line
    along = along_line(line)
    again = along[(along > 0.0) & (along < missing)]
    again = np.concatenate([again, [missing * (1.0 + 1e-12)]])
    return np.concatenate([line, points_along(line, along, again)])
