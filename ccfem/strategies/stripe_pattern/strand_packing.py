"""Curves side by side made to strands: joined, moved apart, long enough for the cutter."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.linalg import solveh_banded
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import (
    farthest_point,
    is_closed,
    lengths,
    line_length,
    pack,
    resample,
    starts_segment,
)
from ccfem.geometry.shapes import Region, strings
from ccfem.paths.linking.joining import Joined, Joint, join
from ccfem.strategies.fiso import contour_trees, first_in_spiral_out

STEP = 0.4
"""Distance of points along a strand, in widths."""
_GAP = 3.0
"""Largest gap between two ends that are joined, in widths."""
_TANGENT, _ASIDE = np.cos(np.radians(35.0)), np.cos(np.radians(40.0))
"""Cosines of the largest angle between the strands at such a gap, and between strand and gap."""
_HEAD = 1.5
"""Length, in widths, over which the direction at an end is measured."""
PUSHES, _SEARCH = 48, 6
"""Rounds of pushes, and of those for which neighbours are searched once."""
_NEAR = 1.3
"""Distance, in widths, up to which they are."""
_APART = 1.015
"""Distance to which lines are pushed apart, in widths: charts change lengths by some hundredths."""
_SPREAD = 6.0
"""Length along a strand over which a push is spread, in widths."""
_WALL = 0.2001
"""Largest distance of the points of the border, in widths: no part of a usual length."""
_FACING = 0.7
"""Twice the cosine of the angle between the normals of line and border from which on it pushes."""
_OWN = 4.0
"""Length along a strand, in widths, from which on it is its own neighbour."""


def even_points(lines: Sequence[FloatArray], width: float) -> list[FloatArray]:
    """Lines (k, 2) in steps of two fifths of a width."""
    points, offsets = resample(*pack(lines), STEP * width)
    return np.split(points, offsets[1:-1]) if len(lines) else []


class _Ends(NamedTuple):
    """Ends of open lines: line k starts with end 2 k and stops with end 2 k + 1.

    `number` (e,), `place` (e, 2) and the unit vectors `outward` (e, 2) along which they leave.
    """

    number: IntArray
    place: FloatArray
    outward: FloatArray


def _ends(lines: Sequence[FloatArray], width: float) -> _Ends:
    opened = [k for k, line in enumerate(lines) if not is_closed(line)]
    number = [2 * k + side for k in opened for side in (0, 1)]
    # Each end with the points behind it, the end first.
    heads = [lines[end // 2][:: -1 if end % 2 else 1] for end in number]
    back = round(_HEAD / STEP)
    place = np.array([head[0] for head in heads]).reshape(-1, 2)
    inner = np.array([head[min(back, len(head) - 1)] for head in heads]).reshape(-1, 2)
    way = place - inner
    size = np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
    return _Ends(np.array(number, dtype=np.int64), place, way / size)


def joined_ends(lines: Sequence[FloatArray], width: float) -> list[FloatArray]:
    """Join lines whose ends face each other across a small gap.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    width : float, mm
        Of a strand.
    """
    ends = _ends(lines, width)
    if len(ends.number) < 2:
        return list(lines)
    pairs = cKDTree(ends.place).query_pairs(_GAP * width, output_type="ndarray")
    a, b = pairs.T
    gap = ends.place[b] - ends.place[a]
    size = np.linalg.norm(gap, axis=1)
    unit = gap / np.maximum(size, 1e-12)[:, None]
    facing = -np.einsum("ij,ij->i", ends.outward[a], ends.outward[b])
    ahead = np.minimum(
        np.einsum("ij,ij->i", ends.outward[a], unit), -np.einsum("ij,ij->i", ends.outward[b], unit)
    )
    possible = (facing > _TANGENT) & (ahead > _ASIDE)
    a, b, size, ahead = a[possible], b[possible], size[possible], ahead[possible]
    tracks = strings(lines)
    bridges = shapely.linestrings(np.stack([ends.place[a], ends.place[b]], axis=1))
    bridge, track = shapely.STRtree(tracks).query(bridges, predicate="intersects")
    owner = np.column_stack([ends.number[a], ends.number[b]]) // 2
    crossed = np.zeros(len(a), dtype=bool)
    crossed[bridge[(owner[bridge] != track[:, None]).all(axis=1)]] = True
    order = np.lexsort((np.round(size * (2.0 - ahead), 6), crossed))
    taken: set[int] = set()
    joints = []
    for k in order[: np.count_nonzero(~crossed)].tolist():
        first, second = int(ends.number[a[k]]), int(ends.number[b[k]])
        if first in taken or second in taken:
            continue
        if first // 2 == second // 2 and line_length(lines[first // 2]) < 4.0 * _GAP * width:
            continue
        taken |= {first, second}
        joints.append(Joint(first, second, np.zeros((0, 2))))
    return join(lines, joints).lines


def _frames(
    points: FloatArray, offsets: IntArray, rings: BoolArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors along lines and to the left of them at their points, (p, 2) each."""
    tangent = np.zeros_like(points)
    step = np.where(starts_segment(offsets)[:-1, None], np.diff(points, axis=0), 0.0)
    tangent[1:] += step
    tangent[:-1] += step
    if rings is not None and rings.any():
        first, last = offsets[:-1][rings], offsets[1:][rings] - 1
        tangent[first] = tangent[last] = tangent[first] + tangent[last]
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)[:, None]
    return tangent, np.column_stack([-tangent[:, 1], tangent[:, 0]])


def evened(
    lines: Sequence[FloatArray], section: Region, width: float, rounds: int = PUSHES
) -> list[FloatArray]:
    """Push lines apart that are nearer than a width, and off the border by half of it.

    Every point is pushed along the normal of its line by half of what is missing, and pushes are
    spread along the line.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    """
    if not lines:
        return []
    points, offsets = pack(lines)
    count, sizes = len(points), np.diff(offsets)
    line = np.repeat(np.arange(len(lines)), sizes)
    rings = np.array([is_closed(strand) for strand in lines])
    pairs = np.zeros((0, 2), dtype=np.int64)
    border = shapely.get_rings(shapely.get_parts(section))
    wall = shapely.get_coordinates(shapely.segmentize(border, _WALL * width))
    walls = cKDTree(wall)
    inner = line[1:] == line[:-1]
    ring_first, ring_last = offsets[:-1][rings], offsets[1:][rings] - 1
    stiff = (_SPREAD / STEP) ** 2
    band = np.zeros((2, count))
    band[1] = 1.0
    band[1, 1:] += stiff * inner
    band[1, :-1] += stiff * inner
    band[0, 1:] = -stiff * inner
    for turn in range(rounds):
        tangent, normal = _frames(points, offsets, rings)
        if not turn % _SEARCH:
            pairs = _neighbours(points, offsets, rings, width)
        up, down = np.zeros(count), np.zeros(count)
        _pushes(points, tangent, normal, pairs, width, up, down)
        # The border pushes alone, so by all that is missing; not where a line runs into it.
        near, at = walls.query(points, distance_upper_bound=0.5 * width)
        close = np.flatnonzero(np.isfinite(near))
        aside = np.einsum("ij,ij->i", points[close] - wall[at[close]], normal[close])
        facing = np.abs(aside) / np.maximum(near[close], 1e-12)
        pressing = np.clip(2.0 * facing - _FACING, 0.0, 1.0) * (0.5 * width - near[close])
        up[close] = np.maximum(up[close], np.where(aside > 0.0, pressing, 0.0))
        down[close] = np.maximum(down[close], np.where(aside < 0.0, pressing, 0.0))
        push = solveh_banded(band, up - down)
        if rings.any():
            push[ring_first] = push[ring_last] = 0.5 * (push[ring_first] + push[ring_last])
        points = points + push[:, None] * normal
    return np.split(_moved_in(points, section, width), offsets[1:-1])


@compiled
def _pushes(
    points: FloatArray,
    tangent: FloatArray,
    normal: FloatArray,
    pairs: IntArray,
    width: float,
    up: FloatArray,
    down: FloatArray,
) -> None:
    """Raise the pushes (p,) of points to the left and right of their lines, by their neighbours."""
    for k in range(len(pairs)):
        p, q = pairs[k, 0], pairs[k, 1]
        x, y = points[p, 0] - points[q, 0], points[p, 1] - points[q, 1]
        # Beside a line the distance is that from its tangent, beyond its end that from the end.
        distance = abs(x * normal[q, 0] + y * normal[q, 1])
        if abs(x * tangent[q, 0] + y * tangent[q, 1]) >= 0.6 * STEP * width:
            distance = np.sqrt(x * x + y * y)
        missing = 0.5 * (_APART * width - distance)
        side = x * normal[p, 0] + y * normal[p, 1]
        if side > 0.0:
            up[p] = max(up[p], missing)
        elif side < 0.0:
            down[p] = max(down[p], missing)


def _neighbours(points: FloatArray, offsets: IntArray, rings: BoolArray, width: float) -> IntArray:
    """Points near each other, each pair in both orders, but for those of one stretch of a line."""
    sizes = np.diff(offsets)
    line = np.repeat(np.arange(len(sizes)), sizes)
    number = np.arange(len(points)) - offsets[line]
    pairs = cKDTree(points).query_pairs(_NEAR * width, output_type="ndarray")
    one, other = line[pairs].T
    apart = np.abs(number[pairs[:, 0]] - number[pairs[:, 1]])
    apart = np.where(rings[one], np.minimum(apart, sizes[one] - 1 - apart), apart)
    pairs = pairs[(one != other) | (apart > round(_OWN / STEP))]
    return np.concatenate([pairs, pairs[:, ::-1]])


def _moved_in(points: FloatArray, section: Region, width: float) -> FloatArray:
    """Points less than half a width outside the room of strands, moved to its border."""
    room = shapely.buffer(section, -0.5 * width)
    if shapely.is_empty(room):
        return points
    shapely.prepare(room)
    out = np.flatnonzero(~shapely.contains_xy(room, points))
    nearest = shapely.get_coordinates(shapely.shortest_line(room, shapely.points(points[out])))
    nearest = nearest[::2]
    close = np.linalg.norm(nearest - points[out], axis=1) < 0.5 * width
    points = points.copy()
    points[out[close]] = nearest[close]
    return points


_SHIFT = 4.5
"""Length, in widths, before and behind a place over which a line steps over to its neighbour's."""
_NEXT = 1.6
"""Farthest neighbour of a line, in widths."""
_OFF = 0.3
"""Least distance of such a step from the border, and a little less than that from other lines."""
_ROUNDS = 8
_LEAST_GAIN = 2.0
"""Least gain of such a step, in widths of length."""


def _worth(length: FloatArray, least: float) -> FloatArray:
    """Length that counts: what is too short for the cutter may still grow."""
    return np.where(length >= least, length, 0.5 * length * (length / least) ** 2)


def stepped_over(
    lines: Sequence[FloatArray], section: Region, width: float, least: float
) -> list[FloatArray]:
    """Exchange the tracks of neighbours so that more of their length is long enough.

    Where lines run side by side, one steps over to the track of the other, and goes on along it;
    the rests of both end and begin there. This is done where one of them is too short, as long as
    more of the length is in lines that are long enough.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    least : float, mm
        Of a strand.
    """
    lines = list(lines)
    room = shapely.buffer(section, -_OFF * width)
    shapely.prepare(room)
    for _ in range(_ROUNDS):
        touched: set[int] = set()
        tree = shapely.STRtree(strings(lines))
        new: list[FloatArray] = []
        for k, other, parts in _steps_over(lines, width, least, touched):
            before, curve, after, *rests = parts
            string = shapely.linestrings(curve)
            near = tree.query(string, predicate="dwithin", distance=0.4 * width).tolist()
            if not shapely.covers(room, string) or set(near) - {k, other}:
                continue
            touched |= {k, other}
            new += [np.concatenate([before, curve[1:-1], after])]
            new += [rest for rest in rests if len(rest) > 1]
        if not touched:
            break
        lines = [line for k, line in enumerate(lines) if k not in touched] + even_points(new, width)
    return lines


def _steps_over(
    lines: list[FloatArray], width: float, least: float, touched: set[int]
) -> Iterator[tuple[int, int, list[FloatArray]]]:
    """Pairs of lines, best first, and what they become: three parts of one line, and two rests.

    Lines that have been touched by then are left alone.
    """
    if not lines:
        return
    points, offsets = pack(lines)
    count = np.diff(offsets)
    owner = np.repeat(np.arange(len(lines)), count)
    size, (tangent, _) = lengths(points, offsets), _frames(points, offsets)
    opened = np.array([not is_closed(line) for line in lines], dtype=bool)
    useful = (size < least) & opened
    pairs = cKDTree(points).query_pairs(_NEXT * width, output_type="ndarray")
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    one, other = owner[pairs].T
    kept = (one != other) & opened[one] & opened[other] & (useful[one] | useful[other])
    pairs, one, other = pairs[kept], one[kept], other[kept]
    # Of the points of the other line the one nearest to each.
    away = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    order = np.lexsort((pairs[:, 1], np.round(away, 9), pairs[:, 0], other, one))
    pairs, one, other = pairs[order], one[order], other[order]
    first = np.ones(len(pairs), dtype=bool)
    first[1:] = (pairs[1:, 0] != pairs[:-1, 0]) | (other[1:] != other[:-1])
    pairs, one, other = pairs[first], one[first], other[first]
    # Numbers of both points along their lines, the other one seen in the sense of the first.
    cosine = np.einsum("ij,ij->i", tangent[pairs[:, 0]], tangent[pairs[:, 1]])
    i, j = pairs[:, 0] - offsets[one], pairs[:, 1] - offsets[other]
    j = np.where(cosine < 0.0, count[other] - 1 - j, j)
    reach = round(_SHIFT / STEP)
    possible = (np.abs(cosine) > _TANGENT) & (i >= reach + 3) & (j + reach <= count[other] - 4)
    i, j, one, other, cosine = (x[possible] for x in (i, j, one, other, cosine))
    step = size / np.maximum(count - 1, 1)
    after = _worth(i * step[one] + (count[other] - 1 - j) * step[other], least)
    after += _worth(np.maximum(j - reach, 0) * step[other], least)
    after += _worth(np.maximum(count[one] - 1 - i - reach, 0) * step[one], least)
    gain = np.round(after - _worth(size[one], least) - _worth(size[other], least), 6)
    for k in np.lexsort((np.arange(len(gain)), -gain)).tolist():
        if gain[k] <= _LEAST_GAIN * width:
            return
        if not touched.isdisjoint((int(one[k]), int(other[k]))):
            continue
        line, track = lines[one[k]], lines[other[k]]
        track = track if cosine[k] > 0.0 else track[::-1]
        leave, meet = int(i[k]) - reach, int(j[k]) + reach
        curve = _blend(
            line[leave], line[leave] - line[leave - 3], track[meet], track[meet + 3] - track[meet]
        )
        rests = line[int(i[k]) + reach :], track[: max(int(j[k]) - reach, 0)]
        yield int(one[k]), int(other[k]), [line[: leave + 1], curve, track[meet:], *rests]


def _blend(start: FloatArray, way: FloatArray, end: FloatArray, onward: FloatArray) -> FloatArray:
    """Cubic curve (k, 2) from one place to another, leaving and meeting them along two vectors."""
    chord = float(np.linalg.norm(end - start))
    way, onward = (chord * v / max(float(np.linalg.norm(v)), 1e-12) for v in (way, onward))
    t = np.linspace(0.0, 1.0, 16)[:, None]
    return np.asarray(
        (1.0 + 2.0 * t) * (1.0 - t) ** 2 * start
        + t * (1.0 - t) ** 2 * way
        + t**2 * (3.0 - 2.0 * t) * end
        + t**2 * (t - 1.0) * onward
    )


_CORNER = 2.5
"""Largest gap between two ends that are joined by a corner, in widths."""
_FOLDED = 3.0
"""Length of a strand, in widths, that carries nothing where it is folded."""
_TIE = 1e-6
"""Least gain of other links, in least lengths."""
_BESIDE = 0.7
"""Least cosine of the angle between the ways in which two such ends leave their lines."""


def corners(lines: Sequence[FloatArray], width: float, least: float) -> list[Joint]:
    """Link ends side by side of lines that are too short: strands turn back there.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    least : float, mm
        Links are chosen that make most of the length of lines as long as that.
    """
    ends = _ends(lines, width)
    if len(ends.number) < 2:
        return []
    pairs = cKDTree(ends.place).query_pairs(_CORNER * width, output_type="ndarray")
    a, b = pairs.T
    gap = np.linalg.norm(ends.place[b] - ends.place[a], axis=1)
    beside = np.einsum("ij,ij->i", ends.outward[a], ends.outward[b])
    possible = (beside > _BESIDE) & (ends.number[a] // 2 != ends.number[b] // 2)
    a, b, gap = a[possible], b[possible], gap[possible]
    bridges = np.stack([ends.place[a], ends.place[b]], axis=1)
    # Without a thousandth at each end, where they touch their own lines.
    inner = bridges + 1e-3 * (bridges[:, ::-1] - bridges)
    met, _ = shapely.STRtree(strings(lines)).query(
        shapely.linestrings(inner), predicate="intersects"
    )
    crossed = np.zeros(len(a), dtype=bool)
    crossed[met] = True
    order = np.lexsort((a, np.round(gap, 6)))
    order = order[~crossed[order]]
    pairs = np.column_stack([ends.number[a], ends.number[b]])[order]
    size = np.array([line_length(line) for line in lines])
    chosen = _chosen(pairs, gap[order], size, least, _FOLDED * width)
    return [
        Joint(int(first), int(second), np.zeros((0, 2)), marked=True)
        for first, second in pairs[chosen]
    ]


def _chosen(
    pairs: IntArray, gap: FloatArray, size: FloatArray, least: float, cost: float
) -> list[int]:
    """Links that make most of the length of lines long enough, less a cost for each of them.

    A link is added, taken out, or takes the place of another, as long as there is a gain.

    Parameters
    ----------
    pairs : (k, 2) int array
        Ends that each link may join.
    gap, size : (k,), (n,) arrays, mm
        Lengths of links and of lines.
    """
    chosen: list[int] = []
    while len(pairs):
        gain = _gains(pairs, gap, size, least, chosen)
        new, old = int(np.argmax(gain)), -1
        most = gain[new] - cost
        if not most > 0.0:
            # What a link in the place of an old one gains, or none there: `new` is the old one.
            for k in chosen:
                rest = [other for other in chosen if other != k]
                gain = _gains(pairs, gap, size, least, rest)
                lost = gain[k]
                gain -= lost
                gain[k] = cost - lost
                best = int(np.argmax(gain))
                if gain[best] > most:
                    new, old, most = best, k, gain[best]
        if not most > _TIE * least:
            break
        chosen = [k for k in chosen if k != old] + ([new] if new != old else [])
    return chosen


def _gains(
    pairs: IntArray, gap: FloatArray, size: FloatArray, least: float, chosen: list[int]
) -> FloatArray:
    """Worth (k,) that each link adds to those chosen; -inf where its ends are not free."""
    line = pairs // 2
    chain = np.arange(len(size))
    for one, other in line[chosen]:
        chain[chain == chain[other]] = chain[one]
    total = np.bincount(chain, size, len(size))
    total += np.bincount(chain[line[chosen, 0]], gap[chosen], len(size))
    first, second = total[chain[line]].T
    # A link makes a strand longer, but it is worth the less, the longer it is.
    gain = _worth(first + second + gap, least) - 2.0 * gap
    gain -= _worth(first, least) + _worth(second, least)
    taken = np.zeros(2 * len(size), dtype=bool)
    taken[pairs[chosen]] = True
    free = ~taken[pairs].any(axis=1) & (chain[line[:, 0]] != chain[line[:, 1]])
    return np.where(free, np.round(gain, 6), -np.inf)


_BEND = 0.8
"""Least radius of strands that fill a rest, in least radii of the machine; one of 0.66 folds."""
_APART_IN_REST = 0.5
"""Least distance of opposite sides of such a strand where it may fold, in widths."""
_ARC = 32
"""Segments of arcs per quarter turn: the same rest to some thousandths, however it lies."""
_SIMPLE = 1e-3
"""Deviation, in widths, up to which points of the border of a rest are left out."""


_DETOUR = 6.0
"""Shortest ring that is a detour of a strand, in widths."""
_REACHED = 1.6
"""Largest distance of such a ring from the strand, in widths."""


class Rest(NamedTuple):
    """What fills the rest of a section: strands, and rings of pieces too small for one, in mm."""

    strands: list[FloatArray]
    rings: list[FloatArray]


def strands_in_rest(
    lines: Sequence[FloatArray], section: Region, width: float, least: float, radius: float
) -> Rest:
    """Strands from the middle to the border of each piece of a section that lines leave free.

    Parameters
    ----------
    least : float, mm
        Of a strand.
    radius : float, mm
        Least radius of the machine; 0 where strands may fold.
    """
    bands = shapely.buffer(strings(lines), 0.5 * width, quad_segs=_ARC)
    taken = shapely.union_all(shapely.make_valid(bands))
    rest = shapely.simplify(shapely.difference(section, taken), _SIMPLE * width)
    # Strands begin at the same place however the layer lies.
    border = max(rings(section), key=line_length)
    start, fill = border[farthest_point(border)], Rest([], [])
    apart, bend = 1.0 if radius else _APART_IN_REST, _BEND * radius
    for piece in shapely.get_parts(shapely.make_valid(rest)):
        for tree in contour_trees(piece, width, start, apart, bend):
            strands = first_in_spiral_out(tree, width, start, radius=bend, alone_from=least)
            fill.strands.extend(line for line in strands if line_length(line) >= least)
            if all(line_length(line) < least for line in strands):
                closed = [np.concatenate([ring, ring[:1]]) for ring in tree.contours]
                fill.rings.extend(x for x in closed if line_length(x) >= _DETOUR * width)
    return Rest(even_points(fill.strands, width), even_points(fill.rings, width))


def with_detours(joined: Joined, rings: Sequence[FloatArray], width: float) -> Joined:
    """Lead strands round rings (k, 2) beside them, by marked links to the ring and back.

    Strands, and rings, are in steps as of `even_points`.
    """
    lines, link = list(joined.lines), list(joined.link)
    for ring in rings:
        points, offsets = pack(lines)
        away, place = cKDTree(ring[:-1]).query(points)
        inner = np.ones(len(points), dtype=bool)
        for end in (offsets[:-1], offsets[1:] - 1):
            for step in (-1, 0, 1):
                inner[np.clip(end + step, 0, len(points) - 1)] = False
        away = np.where(inner, away, np.inf)
        at = int(np.argmin(np.round(away, 6)))
        if not away[at] < _REACHED * width:
            continue
        k = int(np.searchsorted(offsets, at, side="right")) - 1
        line, marks, at = lines[k], link[k], at - int(offsets[k])
        # The ring without one of its points, from beside the strand before its gap.
        way = np.roll(ring[:-1], -int(place[at + int(offsets[k])]), axis=0)[1:]
        forth = np.linalg.norm(way[[0, -1]] - line[[at - 1, at + 1]], axis=1).sum()
        back = np.linalg.norm(way[[-1, 0]] - line[[at - 1, at + 1]], axis=1).sum()
        way = way if forth <= back else way[::-1]
        lines[k] = np.concatenate([line[:at], way, line[at + 1 :]])
        new = np.zeros(len(way), dtype=bool)
        new[-1] = True
        link[k] = np.concatenate([marks[:at], new, marks[at + 1 :]])
        link[k][at - 1] = True
    return Joined(lines, link)
