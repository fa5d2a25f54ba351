"""Strands that end at the wall of a hole, led round it and away on the other side.

Levels of a field end where they meet the wall of a hole. Two that reach it from both sides, each
along the wall, are one strand that the wall interrupts. They are joined by an arc of the wall. The
strands that lie there already keep their order: the arcs are drawn inside the hole, a width below
each other, and whoever slides strands off the border (`stream_paths.slid_in`) moves them all out.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import (
    along_line,
    between,
    is_closed,
    line_length,
    points_along,
    resample,
)
from ccfem.geometry.shapes import Region, Shapes, strings
from ccfem.paths.linking.joining import Joint, join
from ccfem.paths.linking.possible_links import ring_arc

_REACH = 1.3
"""Distance from the wall, in widths, up to which an end has met it."""

_HEADING = 2.0
"""Length, in widths, over which the heading of a strand is measured at its end."""

_ALONG = 0.5
"""Least cosine of the angle between strand and wall."""

_LONGEST = 0.6
"""Longest arc over the circumference of the hole."""

_LARGEST = 80.0
"""Largest circumference of a hole, in widths, round which strands are led."""

LEVELS = 3
"""Most strands that are led round one side of a hole."""

_CUT = 1.5
"""Length, in widths, that an end is cut back by, and that the arc starts ahead of it."""

_NEAR = 0.9
"""Distance, in widths, below which a strand at the wall is in the way of an arc."""


class _Pair(NamedTuple):
    """Two ends of strands at the wall of a hole, numbered as in `Joint`.

    Anticlockwise round the hole the arc leads from the first to the second. `within` is the number
    of pairs whose arcs lie between this one and the strands outside.
    """

    first: int
    second: int
    within: int


class _Meeting(NamedTuple):
    """End of a strand at the wall: its place by arc length, and whether it heads anticlockwise."""

    place: float
    end: int
    forwards: bool


def led_round_holes(
    lines: Sequence[FloatArray], section: Region, width: float, radius: float, levels: int = LEVELS
) -> list[FloatArray]:
    """Join strands that the wall of a hole interrupts.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    width : float, mm
        Of a strand.
    radius : float, mm
        Least radius of a turn.
    levels : int, default 3
        Most strands that are led round one side of a hole.

    Returns
    -------
    list of (n, 2) arrays
        Arcs may lie inside the hole: slide them off its wall.
    """
    if not lines:
        return []
    joints: list[Joint] = []
    cut, strands = list(lines), strings(lines)
    for part in shapely.get_parts(section):
        for ring in part.interiors:
            room = ring.length + np.pi * width >= 2.0 * np.pi * radius
            if not room or ring.length > _LARGEST * width:
                continue
            hole = shapely.orient_polygons(shapely.Polygon(ring))
            for pair in _pairs(_meetings(lines, hole, width), hole.exterior.length):
                if pair.within >= levels or pair.first // 2 == pair.second // 2:
                    continue
                heads = [_cut_back(cut, end, width) for end in pair[:2]]
                if min(len(head) for head in heads) < 2:
                    continue
                others = np.delete(strands, [pair.first // 2, pair.second // 2])
                between_tips = _arc(heads[0][-1], heads[1][-1], hole, others, pair.within, width)
                if between_tips is None:
                    continue
                for end, head in zip(pair[:2], heads, strict=True):
                    cut[end // 2] = head if end % 2 else head[::-1]
                joints.append(Joint(pair.first, pair.second, between_tips))
    return join(cut, joints).lines


def _meetings(lines: Sequence[FloatArray], hole: shapely.Polygon, width: float) -> list[_Meeting]:
    """Find ends of strands that run along the wall of a hole, in their order round it."""
    opened = [k for k, line in enumerate(lines) if not is_closed(line)]
    ends = [2 * k + side for k in opened for side in (0, 1)]
    wall, meetings = hole.exterior, []
    for end in ends:
        head = lines[end // 2] if end % 2 else lines[end // 2][::-1]
        tip = shapely.Point(head[-1])
        if shapely.distance(hole, tip) > _REACH * width:
            continue
        place, along = float(shapely.line_locate_point(wall, tip)), along_line(head)
        beside = (place + 0.5 * width * np.array([-1.0, 1.0])) % wall.length
        before, after = shapely.get_coordinates(shapely.line_interpolate_point(wall, beside))
        start = points_along(head, along, np.maximum(along[-1:] - _HEADING * width, 0.0))[0]
        heading, tangent = head[-1] - start, after - before
        size = float(np.linalg.norm(heading) * np.linalg.norm(tangent))
        cosine = float(heading @ tangent) / max(size, 1e-12)
        if abs(cosine) >= _ALONG:
            meetings.append(_Meeting(place, end, cosine > 0.0))
    return sorted(meetings)


def _pairs(meetings: Sequence[_Meeting], around: float) -> list[_Pair]:
    """Pair ends like brackets; `around` is the circumference.

    An end that heads anticlockwise opens a pair, and the next one that comes towards it closes it.
    The arcs of pairs within a pair lie farther from the wall.
    """
    arcs: list[tuple[float, float, int, int]] = []  # length, start, and both ends
    opened: list[_Meeting] = []
    paired: set[int] = set()
    for turn in (0.0, around):  # a second time, for pairs across the start of the wall
        for place, end, forwards in meetings:
            if end in paired:
                continue
            if forwards:
                opened = [meeting for meeting in opened if meeting.end != end]
                opened.append(_Meeting(place + turn, end, True))
            elif opened:
                start, other, _ = opened.pop()
                length = place + turn - start
                if length > _LONGEST * around:
                    opened.clear()
                    continue
                paired |= {end, other}
                arcs.append((length, start, other, end))
    pairs: list[_Pair] = []
    arcs.sort()
    for k, (length, start, first, second) in enumerate(arcs):
        inner = [
            pairs[j].within + 1
            for j in range(k)
            if (arcs[j][1] - start) % around + arcs[j][0] <= length
        ]
        pairs.append(_Pair(first, second, max(inner, default=0)))
    return pairs


def _cut_back(lines: Sequence[FloatArray], end: int, width: float) -> FloatArray:
    """Strand, its given end last, without the last bit before the wall; empty if it is short."""
    head = lines[end // 2] if end % 2 else lines[end // 2][::-1]
    left = line_length(head) - _CUT * width
    return between(head, 0.0, left) if left > 2.0 * _CUT * width else head[:0]


def _arc(
    start: FloatArray,
    stop: FloatArray,
    hole: shapely.Polygon,
    others: Shapes,
    within: int,
    width: float,
) -> FloatArray | None:
    """Points (n, 2) between two tips, anticlockwise along the wall; None if they are too near.

    The arc lies half a width outside the wall where that is free, else a width farther in for each
    strand that is there.
    """
    wall = hole.exterior
    at = shapely.line_locate_point(wall, shapely.points(np.stack([start, stop])))
    gap, ahead = float((at[1] - at[0]) % wall.length) / wall.length, _CUT * width

    def parallel(distance: float) -> FloatArray | None:
        grown = shapely.buffer(hole, distance)
        if grown.is_empty or grown.geom_type != "Polygon":
            return None
        ring = shapely.orient_polygons(grown).exterior
        length = gap * ring.length - 2.0 * ahead
        if length <= 0.5 * ahead:
            return None
        begin = float(shapely.line_locate_point(ring, shapely.Point(start)))
        return ring_arc(ring, (begin + ahead) % ring.length, length)

    free = parallel(0.5 * width)
    if free is None:
        return None
    near = shapely.dwithin(shapely.linestrings(free), others, _NEAR * width)
    arc = parallel((0.5 - within - bool(near.any())) * width)
    if arc is None:
        return None
    whole = np.concatenate([start[None], arc, stop[None]])
    points, _ = resample(whole, np.array([0, len(whole)]), 0.5 * width)
    return points[1:-1]
