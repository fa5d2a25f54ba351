"""From curves to printable paths: kept off the border, linked, and without short ones."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.polylines import along_line, is_closed, line_length, pack, points_along, runs
from ccfem.geometry.shapes import Region, open_lines, strings
from ccfem.paths.linking.joining import Joined, Joint, join, link_ends
from ccfem.paths.linking.possible_links import ring_arc

_OVERLAP = 0.1
"""Largest share of a ring's length that is laid twice [Chen et al. 2021: the ring round a hole of
10.9 mm is 40.8 mm long, against a minimum of 42 mm]."""


def keep_off_border(lines: Sequence[FloatArray], section: Region, inset: float) -> list[FloatArray]:
    """Parts of lines that keep a given distance from the border of a section.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    inset : float >= 0, mm
        0 leaves the lines as they are, even those outside.

    Returns
    -------
    list of (n_i, 2) arrays
        A closed line stays closed only where all of it is kept.
    """
    if inset == 0.0:
        return list(lines)
    return parts_inside(lines, shapely.buffer(section, -inset))


def parts_inside(lines: Sequence[FloatArray], room: Region) -> list[FloatArray]:
    """Parts (n_i, 2) of lines inside a region; those that it covers are kept as they are."""
    shapely.prepare(room)
    paths, kept = strings(lines), list[FloatArray]()
    for line, path, whole in zip(lines, paths, shapely.covers(room, paths), strict=True):
        kept += [line] if whole else open_lines(shapely.intersection(path, room))
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
    """Close short rings, and drop paths below a least length, mm, which are too short to be cut."""
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


# Curves that run along a chosen boundary, and isocurves led into them [Chen et al. 2021, 4.4].


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
    """Cut lines (n_i, 2), mm, back to a distance from a boundary and join the cut ends along it.

    The ends lie on the curve at `distance`. Neighbouring ends are joined in pairs along that curve,
    where it is in the section; of the possible pairings the one of smallest total length is taken.
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


# Strands kept apart: parts closer than a strand's width to a longer strand are cut away.


def trim_to_clearance(
    lines: Sequence[FloatArray], clearance: float, least_length: float, first: int = 0
) -> list[FloatArray]:
    """Cut strands so that no two are closer than a clearance, the longest first.

    Each strand keeps only the stretches at the clearance from strands laid before, and from earlier
    parts of itself. Stretches shorter than `least_length` are dropped.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        Their steps should not be much longer than half the clearance.
    clearance : float, mm
    least_length : float, mm
    first : int, default 0
        Number of strands at the start of `lines` that are laid before all others.

    Returns
    -------
    list of (n, 2) arrays
        From the longest strand to the shortest; an untouched closed strand stays closed.
    """
    if not lines:
        return []
    length = np.array([line_length(line) for line in lines])
    order = np.lexsort((-length, np.arange(len(lines)) >= first))
    ordered = [lines[k] for k in order]
    points, offsets = pack(ordered)
    low = points.min(axis=0)
    shape = ((points.max(axis=0) - low) / clearance).astype(np.int64) + 1
    keep = np.ones(len(points), dtype=bool)
    head, following = np.full(int(shape.prod()), -1), np.empty(len(points), dtype=np.int64)
    grid = _Grid(low, shape, float(clearance), head, following)
    along, line_of_point = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    _drop_near(points, offsets, grid, float(least_length), keep, along, line_of_point)
    masks = np.split(keep, offsets[1:-1])
    kept: list[FloatArray] = []
    for line, mask in zip(ordered, masks, strict=True):
        if mask.all():
            kept.append(line)
            continue
        pieces = [line[a:b] for a, b in runs(mask) if b - a > 1]
        if is_closed(line) and len(pieces) > 1 and mask[0] and mask[-1]:
            pieces = [np.concatenate([pieces[-1], pieces[0][1:]]), *pieces[1:-1]]
        kept += pieces
    return [line for line in kept if line_length(line) >= least_length]


class _Grid(NamedTuple):
    """Points in cells as wide as the clearance, `low` (2,) the corner of the first, mm.

    `shape` (2,) cells along each axis; `head` (c,) the last point in each cell, -1 for none, and
    `following` (p,) the one before each point in its cell.
    """

    low: FloatArray
    shape: IntArray
    clearance: float
    head: IntArray
    following: IntArray


@compiled
def _drop_near(
    points: FloatArray,
    offsets: IntArray,
    grid: _Grid,
    least_length: float,
    keep: BoolArray,
    along: FloatArray,
    line: IntArray,
) -> None:
    """Clear `keep` (p,) for points that are too near to others.

    Writes the arc length `along` (p,) at each point, and the `line` (p,) that it is of.
    """
    low, shape, clearance, head, following = grid
    for k in range(len(offsets) - 1):
        first, last = offsets[k], offsets[k + 1]
        for p in range(first, last):
            line[p] = k
            if p > first:
                dx, dy = points[p, 0] - points[p - 1, 0], points[p, 1] - points[p - 1, 1]
                along[p] = along[p - 1] + np.sqrt(dx * dx + dy * dy)
        closed = points[first, 0] == points[last - 1, 0] and points[first, 1] == points[last - 1, 1]
        whole = along[last - 1]
        # Points enter the grid only once the line has moved on by two clearances: otherwise a line
        # would be too near to itself.
        waiting = first
        for p in range(first, last):
            i, j = (
                int((points[p, 0] - low[0]) / clearance),
                int((points[p, 1] - low[1]) / clearance),
            )
            for cell in range(9):
                a, b = i + cell // 3 - 1, j + cell % 3 - 1
                if a < 0 or b < 0 or a >= shape[0] or b >= shape[1]:
                    continue
                q = head[a * shape[1] + b]
                while q >= 0 and keep[p]:
                    apart = along[p] - along[q]
                    if closed:
                        apart = min(apart, whole - apart)
                    same = line[q] == k
                    if not (same and apart < 3.0 * clearance):
                        dx, dy = points[p, 0] - points[q, 0], points[p, 1] - points[q, 1]
                        if dx * dx + dy * dy < clearance * clearance:
                            keep[p] = False
                    q = following[q]
            while waiting < p and along[waiting] < along[p] - 2.0 * clearance:
                _enter(points, keep, waiting, grid)
                waiting += 1
        # Stretches too short to print must not displace others.
        _drop_short(keep, along, first, last, least_length, closed)
        for q in range(waiting, last):
            _enter(points, keep, q, grid)


@compiled
def _enter(points: FloatArray, keep: BoolArray, p: int, grid: _Grid) -> None:
    """Put a point into its cell if it is kept."""
    if keep[p]:
        size = grid.clearance
        i, j = int((points[p, 0] - grid.low[0]) / size), int((points[p, 1] - grid.low[1]) / size)
        cell = i * grid.shape[1] + j
        grid.following[p] = grid.head[cell]
        grid.head[cell] = p


@compiled
def _drop_short(
    keep: BoolArray, along: FloatArray, first: int, last: int, least_length: float, closed: bool
) -> None:
    """Drop stretches of a line shorter than a length; round a closed one they may go on."""
    start = -1
    for p in range(first, last + 1):
        if p < last and keep[p]:
            if start < 0:
                start = p
        elif start >= 0:
            joins_round = closed and (start == first or p == last)
            if along[p - 1] - along[start] < least_length and not joins_round:
                for q in range(start, p):
                    keep[q] = False
            start = -1
