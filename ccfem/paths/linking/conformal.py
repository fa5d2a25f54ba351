"""Curves that run along a chosen boundary, and isocurves led into them [Chen et al. 2021, 4.4]."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import is_closed
from ccfem.geometry.shapes import Region, open_lines
from ccfem.paths.linking.joining import Joint, join
from ccfem.paths.linking.possible_links import ring_arc


def parallel_curve(boundary: shapely.Polygon, distance: float, section: Region) -> list[FloatArray]:
    """Curve at a distance from a closed boundary, inside the section.

    Parameters
    ----------
    boundary : shapely Polygon
        The hole (or island) whose outline is followed.
    distance : float, mm
    section : shapely (Multi)Polygon

    Returns
    -------
    list of (n, 2) arrays
        One closed polyline, or several open ones where another boundary cuts the curve.
    """
    ring = shapely.buffer(boundary, distance, quad_segs=32).exterior
    if shapely.covers(section, ring):
        return [shapely.get_coordinates(ring)]
    return open_lines(shapely.intersection(ring, section))


def lead_into(
    lines: Sequence[FloatArray], boundary: shapely.Polygon, distance: float, section: Region
) -> list[FloatArray]:
    """Cut lines back to a distance from a boundary and join the cut ends along it.

    The ends lie on the curve at `distance`. Neighbouring ends are joined in pairs along that curve;
    of the possible pairings the one of smallest total length is taken.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    distance : float, mm
    section : shapely (Multi)Polygon
        Pieces of the curve outside it join nothing.

    Returns
    -------
    list of (n, 2) arrays
    """
    zone = shapely.buffer(boundary, distance, quad_segs=32)
    ring = zone.exterior
    shapely.prepare(zone)
    pieces: list[FloatArray] = []
    for line in lines:
        string = shapely.linestrings(line)
        cut = shapely.intersects(zone, string)
        pieces += open_lines(shapely.difference(string, zone)) if cut else [line]
    ends = [
        (float(shapely.line_locate_point(ring, shapely.points(point))), 2 * k + side)
        for k, piece in enumerate(pieces)
        for side, point in ((0, piece[0]), (1, piece[-1]))
        if shapely.distance(ring, shapely.points(point)) < 1e-6 and not is_closed(piece)
    ]
    return join(pieces, _pairing(sorted(ends), ring, section)).lines


def _pairing(
    ends: list[tuple[float, int]], ring: shapely.LinearRing, section: Region
) -> list[Joint]:
    """Joints of consecutive ends along the ring, of the smallest total length."""
    count = len(ends)
    if count < 2:
        return []
    position = np.array([p for p, _ in ends])
    gap = np.mod(np.roll(position, -1) - position, ring.length)
    # An even number can be paired in two ways. With an odd one, each of `count` ends may stay free.
    starts = range(2) if count % 2 == 0 else range(count)
    ways = [[(s + 2 * k) % count for k in range(count // 2)] for s in starts]
    best = min(ways, key=lambda way: float(gap[way].sum()))
    joints = []
    for k in best:
        arc = ring_arc(ring, position[k], gap[k])
        if shapely.covers(section, shapely.linestrings(arc)):
            joints.append(Joint(ends[k][1], ends[(k + 1) % count][1], arc[1:-1]))
    return joints
