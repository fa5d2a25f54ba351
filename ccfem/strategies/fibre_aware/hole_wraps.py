"""Strands that end at the wall of a hole, led round it and away on the other side.

Levels of a field end where they meet the wall of a hole. Two that reach it from both sides, each
along the wall, are one strand that the wall interrupts. They are joined by an arc of the wall. The
strands that lie there already keep their order: the arcs are drawn inside the hole, a width below
each other, and whoever slides strands off the border (`stream_paths.slid_in`) moves them all out.
"""

from collections.abc import Sequence

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
from ccfem.geometry.shapes import Region, strings
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


def led_round_holes(
    lines: Sequence[FloatArray],
    section: Region,
    width: float,
    radius: float,
    levels: int = LEVELS,
) -> list[FloatArray]:
    """Join strands that the wall of a hole interrupts.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : Polygon or MultiPolygon
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
    joints: list[Joint] = []
    cut = list(lines)
    strands = strings(lines) if len(lines) else np.zeros(0, dtype=object)
    for part in shapely.get_parts(section):
        for ring in part.interiors:
            room = ring.length + np.pi * width >= 2.0 * np.pi * radius
            if room and ring.length <= _LARGEST * width:
                hole = shapely.orient_polygons(shapely.Polygon(ring))
                for first, second, level in _pairs(lines, hole, width):
                    if level < levels:
                        _lead(cut, joints, hole, strands, (first, second, level), width)
    return join(cut, joints).lines


def _pairs(
    lines: Sequence[FloatArray], hole: shapely.Polygon, width: float
) -> list[tuple[int, int, int]]:
    """Find ends of strands that run along a wall to each other, and how many pairs lie outside.

    Ends are numbered as in `ccfem.paths.linking.joining.Joint`; the arc runs anticlockwise from
    the first to the second.
    """
    wall = hole.exterior
    ends = np.array([2 * k + side for k, x in enumerate(lines) if not is_closed(x)
                     for side in (0, 1)], dtype=np.int64)  # fmt: skip
    if not len(ends):
        return []
    tips = np.array([lines[end // 2][-(end % 2)] for end in ends])
    met = shapely.distance(hole, shapely.points(tips)) <= _REACH * width
    ends, tips = ends[met], tips[met]
    place = np.atleast_1d(shapely.line_locate_point(wall, shapely.points(tips)))
    order = np.argsort(place, kind="stable")
    around = []
    for k in order.tolist():
        line = lines[ends[k] // 2][:: -1 if ends[k] % 2 == 0 else 1]
        along = along_line(line)
        step = np.array([-1.0, 1.0]) * 0.5 * width + place[k]
        before, after = shapely.get_coordinates(
            shapely.line_interpolate_point(wall, step % wall.length)
        )
        heading = line[-1] - points_along(
            line, along, np.array([max(along[-1] - _HEADING * width, 0.0)])
        )[0]  # fmt: skip
        size = np.linalg.norm(heading) * np.linalg.norm(after - before)
        cosine = float(heading @ (after - before) / max(size, 1e-12))
        if abs(cosine) >= _ALONG:
            around.append((float(place[k]), int(ends[k]), cosine > 0.0))
    # Like brackets: an end that runs forwards opens a pair, the next one that comes towards it
    # closes it. Pairs within a pair lie farther from the wall.
    found: list[tuple[int, int, int]] = []
    opened: list[tuple[float, int, int]] = []
    used: set[int] = set()
    for turn in (0.0, wall.length):
        for at, end, forwards in around:
            if end in used:
                continue
            if forwards:
                opened = [one for one in opened if one[1] != end]
                opened.append((at + turn, end, 0))
            elif opened:
                start, other, level = opened.pop()
                if other == end or at + turn - start > _LONGEST * wall.length:
                    opened.clear()
                    continue
                used |= {end, other}
                found.append((other, end, level))
                if opened:
                    start, other, outer = opened[-1]
                    opened[-1] = (start, other, max(outer, level + 1))
    return found


def _lead(
    cut: list[FloatArray],
    joints: list[Joint],
    hole: shapely.Polygon,
    strands: "np.typing.NDArray[np.object_]",
    pair: tuple[int, int, int],
    width: float,
) -> None:
    """Cut two ends back, and add the arc between them."""
    first, second, level = pair
    trimmed = {}
    for end in (first, second):
        line = cut[end // 2]
        size = line_length(line)
        if size < 3.0 * _CUT * width:
            return
        span = (_CUT * width, size) if end % 2 == 0 else (0.0, size - _CUT * width)
        trimmed[end] = between(line, *span)
    if first // 2 == second // 2:
        return
    wall = hole.exterior
    tips = [trimmed[end][-(end % 2)] for end in (first, second)]
    at = shapely.line_locate_point(wall, shapely.points(np.array(tips)))
    gap = float((at[1] - at[0]) % wall.length)

    def arc(offset: float) -> FloatArray | None:
        """Arc at a distance from the wall, below 0 inside the hole."""
        ring = shapely.buffer(hole, offset)
        if ring.is_empty or ring.geom_type != "Polygon":
            return None
        ring = shapely.orient_polygons(ring).exterior
        scale = ring.length / wall.length
        start = float(shapely.line_locate_point(ring, shapely.points(tips[0])))
        length, ahead = gap * scale, _CUT * width
        if length <= 2.5 * ahead:
            return None
        start = (start + ahead) % ring.length
        return ring_arc(ring, start, length - 2.0 * ahead)

    free = arc(0.5 * width)
    others = np.delete(strands, [first // 2, second // 2])
    taken = free is not None and bool(
        shapely.dwithin(shapely.linestrings(free), others, _NEAR * width).any()
    )
    path = arc((0.5 - level - taken) * width)
    if path is None:
        return
    whole = np.concatenate([tips[:1], path, tips[1:]])
    points, _ = resample(whole, np.array([0, len(whole)]), 0.5 * width)
    for end in (first, second):
        cut[end // 2] = trimmed[end]
    joints.append(Joint(first, second, points[1:-1]))
