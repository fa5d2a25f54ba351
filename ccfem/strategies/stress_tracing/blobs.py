"""Spirals in the wide places of a section that the tracks of all main paths leave open."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.offsets import join_rings, offset_rings
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region

_STEP = 0.5
"""Distance of the points of a spiral, mm."""


def rest_of(section: Region, lines: Sequence[FloatArray], width: float, reach: float) -> Region:
    """Part of a section that a disc can reach between strands.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
    width : float, mm
        Of a strand.
    reach : float, mm
        Radius of the disc.
    """
    laid = [shapely.LineString(line) for line in lines if len(line) > 1]
    covered = shapely.union_all(shapely.buffer(laid, 0.5 * width, cap_style="flat"))
    rest = shapely.buffer(shapely.difference(section, covered), -reach)
    return shapely.buffer(rest, reach)


def blobs(
    section: Region,
    lines: Sequence[FloatArray],
    width: float,
    spacing: float,
    least: float,
) -> list[list[FloatArray]]:
    """Fill places that strands leave open with concentric rings, joined to spirals.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    lines : sequence of (n, 2) arrays, mm
        Strands that are laid already.
    width, spacing : float, mm
        Width of a strand, and distance of neighbouring ones.
    least : float, mm
        Shorter spirals are left out.

    Returns
    -------
    list of lists of (n, 2) arrays, mm
        The spirals of each open place, largest place first. They start at the border of the section
        where they touch it.
    """
    rest = rest_of(section, lines, width, 0.5 * width)
    places = [part for part in shapely.get_parts(rest) if part.area >= least * spacing]
    border = shapely.boundary(section)
    found = []
    for place in sorted(places, key=lambda part: -part.area):
        levels = offset_rings(place, 0.5 * width, spacing, width)
        if not levels:
            continue
        nearest = shapely.shortest_line(border, shapely.centroid(place))
        start = shapely.get_coordinates(nearest)[0]
        spirals = [_even(line) for line in join_rings(levels, start, spacing, width)]
        spirals = [line for line in spirals if line_length(line) >= least]
        if spirals:
            found.append(spirals)
    return found


def _even(line: FloatArray) -> FloatArray:
    """Line in even steps; a ring is opened where it begins."""
    curve = shapely.LineString(line)
    at = np.linspace(0.0, curve.length, max(4, round(curve.length / _STEP)) + 1)
    points = shapely.get_coordinates(shapely.line_interpolate_point(curve, at))
    return points[:-2] if np.array_equal(line[0], line[-1]) else points
