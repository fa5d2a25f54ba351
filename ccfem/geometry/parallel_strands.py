"""Strands parallel to given curves, laid outwards from them, and strands in the rest."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import farthest_point, is_closed, line_length, straight_pieces
from ccfem.geometry.shapes import Region, bands, open_lines, strings
from ccfem.geometry.shells import concentric

_ARC = 16
"""Segments per quarter turn round an end or a corner of a curve."""
_LEAST_REST = 1.0
"""Smallest rest that is filled, in squares of the pitch."""
_SLIVER = 0.19
"""Half the width, in pitches, below which a strip is not filled."""
_OFF = 0.02
"""Error of the distance to the nearest curve, in pitches, up to which a piece of a border counts as
parallel to that curve."""
_REACH = 2.0
"""Maximum length, in pitches, by which the free end of a strand is extended."""
_ROUND = 1.5
"""Least radius, in pitches, of the convex corners of regions filled with concentric strands."""
_TOLERANCE = 2e-3
"""Deviation, in pitches, up to which points of a curve are left out."""


def grow(
    curves: Sequence[FloatArray],
    region: Region,
    pitch: float,
    closest: float,
    count: int | None = None,
    whole: bool = False,
    pair: bool = False,
) -> list[FloatArray]:
    """Fill a region with curves, strands parallel to them, and concentric strands in the rest.

    Parameters
    ----------
    curves : sequence of (k, 2) arrays, mm
        Closed ones repeat their first point; they may reach beyond the region.
    region : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Distance of neighbouring strands.
    closest : float
        Minimum distance of strands, in pitches.
    count : int, optional
        Number of parallel strands at each side; by default until the region is full.
    whole : bool, default False
        Whether strands go round the free ends of curves and continue from one curve to the next. By
        default each belongs to one curve, and nothing is laid beyond the ends of that curve.
    pair : bool, default False
        Whether strands lie half a pitch to both sides of the curves, and none on them.

    Returns
    -------
    list of (k, 2) arrays, mm
    """
    if shapely.is_empty(region):
        return []
    strings = [shapely.LineString(curve).simplify(_TOLERANCE * pitch) for curve in curves]
    slack = (closest - 0.5) * pitch
    room = shapely.buffer(region, -slack, join_style="mitre")
    inner = [] if pair else open_lines(shapely.intersection(strings, room))
    smooth = [shapely.get_coordinates(string) for string in strings]
    inner += _parallels(smooth, room, pitch, closest, count, whole, 0.5 if pair else 1.0)
    # The sides of a strand keep their distance to the border; its ends may reach it.
    lines = [
        line
        for part in inner
        for line in open_lines(
            shapely.intersection(
                shapely.LineString(lengthened(part, room, 1e-6 * pitch, 1.4 * slack)), region
            )
        )
        if line_length(line) >= pitch
    ]
    lines = _without_crossings(lines, 0.1 * pitch)
    lines, rest = extend_free_ends(lines, region, pitch, closest, _REACH * pitch)
    core = shapely.Polygon() if whole else _morphological_opening(rest, _ROUND * pitch)
    if shapely.is_empty(core):
        return lines + _fill_rest(rest, lines, pitch, closest)
    # Where one curve takes over from another the ends form steps: extend them to a smooth border.
    outside = shapely.difference(region, core)
    lines, rest = extend_free_ends(lines, outside, pitch, closest, _REACH * pitch)
    inner = _fill_rest(core, lines, pitch, closest)
    between = _kept_off(_fill_rest(rest, lines, pitch, closest), inner, 0.5 * pitch)
    return lines + inner + [line for line in between if line_length(line) >= pitch]


def _kept_off(
    lines: list[FloatArray], others: Sequence[FloatArray], distance: float
) -> list[FloatArray]:
    """Parts of lines that keep a distance from others."""
    if not lines or not others:
        return lines
    taken = shapely.union_all(bands(strings(others), distance))
    return open_lines(shapely.difference(strings(lines), taken))


def _morphological_opening(rest: Region, radius: float) -> Region:
    """Morphological opening: the part of a region that a disc reaches."""
    return shapely.buffer(shapely.buffer(rest, -radius), radius)


def _without_crossings(lines: list[FloatArray], gap: float) -> list[FloatArray]:
    """Lines, the shorter of two crossing ones cut back by a gap: ends that meet head on overlap."""
    curves = strings(lines)
    crossing = shapely.STRtree(curves).query(curves, predicate="crosses").T.tolist()
    # In the order of the curves, and equal lengths as equal: as the part turns, so do the strands.
    for k, j in sorted(crossing):
        if (round(curves[k].length, 6), k) < (round(curves[j].length, 6), j):
            curves[k] = shapely.difference(curves[k], shapely.buffer(curves[j], gap))
    opened = open_lines(curves)
    return [line for line in opened if line_length(line) >= gap]


def _parallels(
    curves: Sequence[FloatArray],
    region: Region,
    pitch: float,
    closest: float,
    count: int | None,
    whole: bool,
    first: float,
) -> list[FloatArray]:
    """Lines in a region at multiples of the pitch, from `first` pitches off the nearest curve on.

    They are borders of the buffers of all curves together, so lines of different distance are never
    nearer to each other than the pitch. Where two fronts of equal distance come nearer than
    `closest` pitches, neither is laid. Parameters as in `grow`.
    """
    if not len(curves):
        return []
    strings = np.array([shapely.LineString(curve) for curve in curves])
    sides = shapely.STRtree(shapely.linestrings(straight_pieces(curves)))
    owners = np.repeat(np.arange(len(curves)), [len(curve) - 1 for curve in curves])
    if whole:
        strings = np.array([shapely.multilinestrings(strings)])
        owners = np.zeros_like(owners)
    cap, half = "round" if whole else "flat", 0.5 * closest * pitch
    near = shapely.buffer(region, pitch)
    shapely.prepare(near)
    lines: list[FloatArray] = []
    level = idle = 0
    # After a channel closes, one distance may have no line and the next one some.
    while (count is None or level < count) and idle < 3:
        level += 1
        distance = (level - 1 + first) * pitch
        covered = shapely.union_all(bands(strings, distance, cap_style=cap, quad_segs=_ARC))
        # Channels that are too narrow are closed.
        covered = shapely.buffer(shapely.buffer(covered, half, quad_segs=4), -half, quad_segs=4)
        fronts = [
            shapely.get_coordinates(ring)
            for part in shapely.get_parts(covered)
            for ring in (part.exterior, *part.interiors)
        ]
        smoothed = [
            shapely.LineString(line)
            for ring, owner in zip(
                fronts, _owners(fronts, near, sides, owners, distance, pitch), strict=True
            )
            for line in _own_pieces(ring, owner, 3.0 * _OFF * pitch)
        ]
        smooth = shapely.simplify(np.array(smoothed, dtype=object), _TOLERANCE * pitch)
        inside = open_lines(shapely.intersection(smooth, region))
        idle = 0 if inside else idle + 1
        lines += inside
    return lines


def _owners(
    rings: Sequence[FloatArray],
    near: Region,
    sides: shapely.STRtree,
    owners: IntArray,
    distance: float,
    pitch: float,
) -> list[IntArray]:
    """Curve at whose distance each step of some rings lies; -1 if there is none.

    `sides` holds the straight pieces of all curves, `owners` the curve of each. Straight ends of
    buffers and rounded cusps have no owner, and neither has anything far from a region.
    """
    if not rings:
        return []
    steps = straight_pieces(rings)
    owner = np.full(len(steps), -1)
    # Steps whose ends are far from the region may still cross it.
    inside = np.flatnonzero(shapely.intersects(near, shapely.linestrings(steps)))
    middle = shapely.points(steps[inside].mean(axis=1))
    (_, side), gaps = sides.query_nearest(middle, return_distance=True, all_matches=False)
    owner[inside] = np.where(np.abs(gaps - distance) > _OFF * pitch, -1, owners[side])
    return np.split(owner, np.cumsum([len(ring) - 1 for ring in rings])[:-1])


def _own_pieces(ring: FloatArray, owner: IntArray, least: float) -> list[FloatArray]:
    """Pieces of a ring whose steps (n,) have an owner, split where that changes.

    Steps shorter than `least` at their ends are left out.
    """
    change = np.flatnonzero(np.diff(owner)) + 1
    if not len(change):
        first = farthest_point(ring)
        return [np.concatenate([ring[first:-1], ring[: first + 1]])] if owner[0] >= 0 else []
    # Start at a change, so that no piece is cut at the arbitrary start of the ring.
    ring = np.concatenate([ring[change[0] : -1], ring[: change[0] + 1]])
    owner = np.roll(owner, -change[0])
    cuts = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), len(owner)]
    pieces = [ring[a : b + 1] for a, b in pairwise(cuts) if owner[a] >= 0]
    return [_without_hooks(piece, least) for piece in pieces]


def _without_hooks(line: FloatArray, least: float) -> FloatArray:
    """Line without short steps, below `least`, at its ends: corners of buffers cause them."""
    long = np.flatnonzero(np.linalg.norm(np.diff(line, axis=0), axis=1) >= least)
    return line[long[0] : long[-1] + 2] if len(long) else line


def _fill_rest(
    rest: Region, lines: Sequence[FloatArray], pitch: float, closest: float
) -> list[FloatArray]:
    """Concentric strands where lines leave room, except in narrow strips and specks.

    The parts of the rest follow each other as the lines that they lie beside: their own order
    changes as the section turns.
    """
    rest = shapely.buffer(rest, -_SLIVER * pitch, join_style="mitre")
    rest = shapely.buffer(rest, _SLIVER * pitch, join_style="mitre")
    parts = shapely.get_parts(rest)
    parts = parts[shapely.area(parts) > _LEAST_REST * pitch**2]
    if not len(parts):
        return []
    line, part = shapely.STRtree(parts).query(strings(lines), "dwithin", distance=pitch)
    beside = np.full(len(parts), len(lines))
    np.minimum.at(beside, part, line)
    order = np.argsort(beside, kind="stable").tolist()
    return [line for k in order for line in concentric(parts[k], pitch, closest, walls=False)]


def lengthened(line: FloatArray, region: Region, near: float, length: float) -> FloatArray:
    """Extend an open line (m, 2) straight at ends no farther than `near` from the border, mm."""
    if is_closed(line):
        return line
    gap = shapely.distance(region.boundary, shapely.points(line[[0, -1]]))
    parts = [line]
    if gap[0] <= near:
        way = line[0] - line[1]
        parts.insert(0, line[:1] + length * way / np.linalg.norm(way))
    if gap[1] <= near:
        way = line[-1] - line[-2]
        parts.append(line[-1:] + length * way / np.linalg.norm(way))
    return np.concatenate(parts)


# Free ends of strands, extended straight to the strand or the border ahead of them.


_STEEPEST = 25.0
"""Least angle, degrees, at which an extended strand may meet what is ahead. A strip between strands
that run side by side gets another strand along its middle instead."""
_LEAST = 0.3
"""Minimum length, in pitches, by which an end is extended."""


def strips(lines: Sequence[FloatArray], pitch: float) -> Region:
    """Area of strands a pitch wide each, with ends cut square: a (Multi)Polygon, mm."""
    region = shapely.buffer(
        shapely.multilinestrings([shapely.LineString(line) for line in lines]),
        0.5 * pitch,
        cap_style="flat",
        join_style="mitre",
        mitre_limit=1.5,
    )
    if shapely.is_valid(region):
        return region
    # Mitred corners may leave a border that touches itself, for which differences would fail.
    parts = shapely.get_parts(shapely.make_valid(region))
    areas = parts[shapely.get_dimensions(parts) == 2]
    return shapely.union_all(areas)


def extend_free_ends(
    lines: Sequence[FloatArray], region: Region, pitch: float, closest: float, reach: float
) -> tuple[list[FloatArray], Region]:
    """Extend the free ends of strands straight to what lies ahead, if that is near.

    If two extensions compete for the same place, the longer strand goes first.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        Closed ones repeat their first point, and stay as they are.
    region : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Width that each strand takes.
    closest : float
        Minimum distance of the sides of strands, in pitches.
    reach : float, mm
        Maximum length by which an end is extended.

    Returns
    -------
    lines : list of (k, 2) arrays, mm
        In the order of those given.
    rest : shapely (Multi)Polygon, mm
        Region without the strips of the strands.
    """
    led = list(lines)
    rest = shapely.difference(region, strips(lines, pitch)) if led else region
    ends = _free_ends(lines, pitch)
    if not ends:
        return led, rest
    # Rays ahead of the ends, and the room that is as far from everything as sides have to be.
    here = np.array([lines[number][end] for number, end in ends])
    along = here - np.array([lines[number][1 if end == 0 else -2] for number, end in ends])
    along /= np.linalg.norm(along, axis=1)[:, None]
    slack = (closest - 0.5) * pitch
    room = shapely.buffer(rest, -slack, join_style="mitre")
    start = here + 1.01 * slack * along
    rays = shapely.linestrings(np.stack([start, here + reach * along], axis=1))
    ahead = _Obstacles.of(lines, region, pitch)
    ways: list[shapely.LineString] = []
    whole = _parts_round(rest, start)
    for k, space in _parts_round(room, start).items():
        free = whole.get(k, shapely.Polygon())
        rivals = [way for way in ways if way.distance(rays[k]) < (closest + 0.5) * pitch]
        if rivals:
            taken = shapely.buffer(shapely.union_all(rivals), 0.5 * pitch, cap_style="flat")
            free = shapely.difference(free, taken)
            space = shapely.buffer(free, -slack, join_style="mitre")
        stop = _first_exit(rays[k], space)
        if stop is not None:
            # The sides of a strand keep their distance; its end may reach what is ahead.
            tail = shapely.LineString([start[k], stop + 1.4 * slack * along[k]])
            stop = _first_exit(tail, free)
        if stop is None or np.linalg.norm(stop - here[k]) < _LEAST * pitch:
            continue
        number, end = ends[k]
        if ahead.angle(stop, along[k], number) >= np.radians(_STEEPEST):
            ways.append(shapely.LineString([here[k], stop]))
            led[number] = np.insert(led[number], 0 if end == 0 else len(led[number]), stop, axis=0)
    tails = [shapely.get_coordinates(way) for way in ways]
    return led, shapely.difference(rest, strips(tails, pitch)) if tails else rest


def _free_ends(lines: Sequence[FloatArray], pitch: float) -> list[tuple[int, int]]:
    """Line and index (0 or -1) of every end of the open lines, the longest line first."""
    size = np.array([line_length(line) for line in lines])
    order = np.argsort(-np.round(size / pitch, 3), kind="stable")
    return [(int(k), end) for k in order if not is_closed(lines[k]) for end in (0, -1)]


def _parts_round(area: Region, points: FloatArray) -> dict[int, shapely.Polygon]:
    """Part of an area round each of several points (k, 2) that has one."""
    parts = shapely.get_parts(area)
    point, part = shapely.STRtree(parts).query(shapely.points(points), predicate="within")
    return dict(zip(point.tolist(), parts[part], strict=True))


def _first_exit(ray: shapely.LineString, space: Region) -> FloatArray | None:
    """Point where a straight ray first leaves a region; None if it starts outside."""
    start = shapely.get_point(ray, 0)
    for part in shapely.get_parts(shapely.intersection(ray, space)):
        if part.geom_type == "LineString" and part.distance(start) < 1e-9:
            ends = shapely.get_coordinates(part)[[0, -1]]
            gap = np.linalg.norm(ends - shapely.get_coordinates(start), axis=1)
            return np.asarray(ends[np.argmax(gap)], dtype=np.float64)
    return None


@dataclass(frozen=True)
class _Obstacles:
    """Straight pieces of strands and of the border, with the strand of each, -1 for the border."""

    tree: shapely.STRtree
    along: FloatArray
    owner: IntArray
    half: float

    @classmethod
    def of(cls, lines: Sequence[FloatArray], region: Region, pitch: float) -> "_Obstacles":
        border = rings(region)
        curves = [*lines, *border]
        pairs = straight_pieces(curves)
        owner = np.concatenate([np.arange(len(lines)), np.full(len(border), -1)])
        along = pairs[:, 1] - pairs[:, 0]
        along = along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        sizes = [len(c) - 1 for c in curves]
        tree = shapely.STRtree(shapely.linestrings(pairs))
        return cls(tree, along, np.repeat(owner, sizes), 0.5 * pitch)

    def angle(self, point: FloatArray, way: FloatArray, strand: int) -> float:
        """Acute angle, radians, between a way and the nearest piece ahead; 0 where none is near."""
        here = shapely.Point(point)
        near = self.tree.query(here, predicate="dwithin", distance=1.2 * self.half)
        near = near[self.owner[near] != strand]
        if not len(near):
            return 0.0
        gap = shapely.distance(self.tree.geometries[near], here)
        # The border is the edge of a strand, half a pitch before its middle.
        gap = gap + np.where(self.owner[near] < 0, self.half, 0.0)
        x, y = self.along[near[np.argmin(gap)]]
        return float(abs(np.arcsin(np.clip(way[0] * y - way[1] * x, -1.0, 1.0))))
