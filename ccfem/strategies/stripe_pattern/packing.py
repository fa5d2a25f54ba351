"""Curves side by side made to strands: joined end to end, moved apart, long enough for the cutter."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from scipy.linalg import solveh_banded
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.polylines import (
    along_line,
    is_closed,
    line_length,
    pack,
    points_along,
    resample,
)
from ccfem.geometry.shapes import Region, open_lines, strings
from ccfem.paths.linking.joining import Joint, join
from ccfem.paths.linking.possible_links import Link, cut_back, links_without_folds, smooth_links

STEP = 0.4
"""Distance of points along a strand, in widths."""
_GAP = 3.0
"""Largest gap between two ends that are joined, in widths."""
_TANGENT, _ASIDE = np.cos(np.radians(35.0)), np.cos(np.radians(40.0))
"""Cosines of the largest angle between the strands at such a gap, and between strand and gap."""
_HEAD = 1.5
"""Length, in widths, over which the direction at an end is measured."""
_PUSHES = 16
_SPREAD = 3.0
"""Length along a strand over which a push is spread, in widths."""
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
    number = [2 * k + side for k, line in enumerate(lines) if not is_closed(line) for side in (0, 1)]
    back = max(int(round(_HEAD / STEP)), 1)
    place = [lines[end // 2][-(end % 2)] for end in number]
    inner = [
        lines[end // 2][max(len(lines[end // 2]) - 1 - back, 0) if end % 2 else back]
        if len(lines[end // 2]) > back
        else lines[end // 2][-1 + end % 2]
        for end in number
    ]
    place_, inner_ = np.array(place).reshape(-1, 2), np.array(inner).reshape(-1, 2)
    way = place_ - inner_
    size = np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None]
    return _Ends(np.array(number, dtype=np.int64), place_, way / size)


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


def evened(
    lines: Sequence[FloatArray], section: Region, width: float, rounds: int = _PUSHES
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
    number = np.arange(count) - offsets[line]
    rings = np.array([is_closed(each) for each in lines])
    border = shapely.get_rings(shapely.get_parts(section))
    wall = shapely.get_coordinates(shapely.segmentize(border, STEP * width))
    inner = line[1:] == line[:-1]
    ring_first, ring_last = offsets[:-1][rings], offsets[1:][rings] - 1
    stiff = (_SPREAD / STEP) ** 2
    band = np.zeros((2, count))
    band[1] = 1.0
    band[1, 1:] += stiff * inner
    band[1, :-1] += stiff * inner
    band[0, 1:] = -stiff * inner
    own = int(_OWN / STEP)
    for _ in range(rounds):
        tangent = np.zeros_like(points)
        step = np.where(inner[:, None], np.diff(points, axis=0), 0.0)
        tangent[1:] += step
        tangent[:-1] += step
        if rings.any():
            both = tangent[ring_first] + tangent[ring_last]
            tangent[ring_first] = tangent[ring_last] = both
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)[:, None]
        normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        tree = cKDTree(points)
        pairs = tree.query_pairs(1.02 * width, output_type="ndarray")
        apart = np.abs(number[pairs[:, 0]] - number[pairs[:, 1]])
        around = sizes[line[pairs[:, 0]]] - 1 - apart
        apart = np.where(rings[line[pairs[:, 0]]], np.minimum(apart, around), apart)
        pairs = pairs[(line[pairs[:, 0]] != line[pairs[:, 1]]) | (apart > own)]
        p, q = np.concatenate([pairs, pairs[:, ::-1]]).T
        gap = points[p] - points[q]
        # Beside a line the distance is that from its tangent, beyond its end that from the end.
        across = np.einsum("ij,ij->i", gap, normal[q])
        along = np.abs(np.einsum("ij,ij->i", gap, tangent[q]))
        beside = along < 0.6 * STEP * width
        distance = np.where(beside, np.abs(across), np.linalg.norm(gap, axis=1))
        side = np.einsum("ij,ij->i", gap, normal[p])
        missing = 0.5 * (width - distance)
        # The border pushes alone, so by all that is missing.
        near, at = cKDTree(wall).query(points, distance_upper_bound=width)
        close = np.flatnonzero(np.isfinite(near))
        off = points[close] - wall[at[close]]
        p = np.concatenate([p, close])
        side = np.concatenate([side, np.einsum("ij,ij->i", off, normal[close])])
        missing = np.concatenate([missing, 0.5 * width - near[close]])
        up, down = np.zeros(count), np.zeros(count)
        kept = missing > 0.0
        p, side, missing = p[kept], side[kept], missing[kept]
        np.maximum.at(up, p[side > 0.0], missing[side > 0.0])
        np.maximum.at(down, p[side < 0.0], missing[side < 0.0])
        push = solveh_banded(band, up - down)
        if rings.any():
            push[ring_first] = push[ring_last] = 0.5 * (push[ring_first] + push[ring_last])
        points = points + push[:, None] * normal
    return np.split(points, offsets[1:-1])


_SHIFT = 4.5
"""Length, in widths, before and behind its end over which a line steps over to its neighbour's."""
_NEXT = 1.6
"""Farthest neighbour of an end, in widths."""
_ROUNDS = 8
_LEAST_GAIN = 2.0
"""Least gain of such a step, in widths of length."""


def _worth(length: float, least: float) -> float:
    """Length that counts: what is too short for the cutter may still grow."""
    return length if length >= least else 0.5 * length * (length / least) ** 2


def stepped_over(
    lines: Sequence[FloatArray], section: Region, width: float, least: float
) -> list[FloatArray]:
    """Lead lines that are too short on along their neighbours' tracks.

    Where a short line ends beside a longer one, it takes over the track of that one, which then
    ends there, if both are long enough afterwards or at least more of the length is.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    least : float, mm
        Of a strand.
    """
    lines = list(lines)
    room = shapely.buffer(section, -0.3 * width)
    shapely.prepare(room)
    for _ in range(_ROUNDS):
        steps = sorted(_steps_over(lines, width, least), key=lambda step: -step.gain)
        touched: set[int] = set()
        tree = shapely.STRtree(strings(lines))
        new: list[FloatArray] = []
        for step in steps:
            if step.short in touched or step.long in touched:
                continue
            curve = shapely.linestrings(step.curve)
            if not shapely.covers(room, curve):
                continue
            met = set(tree.query(curve, predicate="dwithin", distance=0.4 * width).tolist())
            if met - {step.short, step.long}:
                continue
            touched |= met | {step.short, step.long}
            new += [part for part in step.lines if len(part) > 1]
        if not touched:
            break
        lines = [line for k, line in enumerate(lines) if k not in touched] + even_points(new, width)
    return lines


class _Step(NamedTuple):
    """A short line that steps over to the track of a long one; `lines` take the place of both."""

    gain: float
    short: int
    long: int
    curve: FloatArray
    lines: tuple[FloatArray, ...]


def _steps_over(lines: list[FloatArray], width: float, least: float) -> list[_Step]:
    points, offsets = pack(lines)
    owner = np.repeat(np.arange(len(lines)), np.diff(offsets))
    tree, shift = cKDTree(points), _SHIFT * width
    size = [line_length(line) for line in lines]
    steps: list[_Step] = []
    for k, line in enumerate(lines):
        if size[k] >= least or size[k] < shift + 2.0 * width or is_closed(line):
            continue
        for side in (0, 1):
            ahead = line if side else line[::-1]
            near = np.array(tree.query_ball_point(ahead[-1], _NEXT * width), dtype=np.int64)
            for other in np.unique(owner[near]).tolist():
                if other == k or is_closed(lines[other]):
                    continue
                mine = near[owner[near] == other]
                nearest = mine[np.argmin(np.linalg.norm(points[mine] - ahead[-1], axis=1))]
                step = _step_over(ahead, lines[other], int(nearest - offsets[other]), width)
                if step is None:
                    continue
                curve, parts = step
                after = sum(_worth(line_length(part), least) for part in parts if len(part) > 1)
                gain = after - _worth(size[k], least) - _worth(size[other], least)
                if gain > _LEAST_GAIN * width:
                    steps.append(_Step(gain, k, other, curve, parts))
    return steps


def _step_over(
    short: FloatArray, long: FloatArray, at: int, width: float
) -> tuple[FloatArray, tuple[FloatArray, ...]] | None:
    """Curve from the end of a line to the track of another beside its point `at`, and both lines."""
    outward = short[-1] - short[-4]
    along = long[min(at + 2, len(long) - 1)] - long[max(at - 2, 0)]
    cosine = float(outward @ along) / max(
        float(np.linalg.norm(outward) * np.linalg.norm(along)), 1e-12
    )
    if abs(cosine) < _TANGENT:
        return None
    if cosine < 0.0:
        long, at = long[::-1], len(long) - 1 - at
    reach = int(round(_SHIFT / STEP))
    leave, meet = len(short) - 1 - reach, at + reach
    if leave < 4 or meet > len(long) - 4:
        return None
    curve = _blend(short[leave], short[leave] - short[leave - 3], long[meet], long[meet + 3] - long[meet])
    return curve, (
        np.concatenate([short[:leave], curve, long[meet + 1 :]]),
        long[: max(at - reach, 0)],
    )


def _blend(
    start: FloatArray, way: FloatArray, end: FloatArray, onward: FloatArray
) -> FloatArray:
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


_TURN = 0.75
"""Radius of a turn that leads a strand back, in least radii of the machine; one of 0.66 folds."""
_TURN_LIMIT = 10.0
"""Largest distance of the ends that it joins, in widths."""
_CLEAR = 0.95
"""Distance, in widths, that other strands are cut back to."""


def turned_back(
    lines: Sequence[FloatArray], section: Region, width: float, least: float, radius: float
) -> list[FloatArray]:
    """Join ends of lines that are too short by turns, and cut back what lies in their way.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        In steps as of `even_points`.
    least : float, mm
        Of a strand.
    radius : float, mm
        Least radius of the machine.
    """
    lines = list(lines)
    room = shapely.buffer(section, -0.4 * width)
    shapely.prepare(room)
    for _ in range(_ROUNDS):
        turns = sorted(
            _turns(lines, room, width, least, radius), key=lambda turn: -round(turn.gain, 6)
        )
        touched: set[int] = set()
        new: list[FloatArray] = []
        for turn in turns:
            if touched & turn.old:
                continue
            touched |= turn.old
            new += turn.lines
        if not touched:
            break
        lines = [line for k, line in enumerate(lines) if k not in touched] + even_points(new, width)
    return lines


class _Turn(NamedTuple):
    """A turn that joins two lines, and the `lines` that take the place of all `old` ones."""

    gain: float
    old: set[int]
    lines: list[FloatArray]


def _turns(
    lines: list[FloatArray], room: Region, width: float, least: float, radius: float
) -> list[_Turn]:
    size = np.array([line_length(line) for line in lines])
    opened = np.array([not is_closed(line) for line in lines])
    number = np.flatnonzero(opened & (size > 6.0 * width))
    ends = (2 * number[:, None] + np.arange(2)).ravel()
    # From the ends, and from where a turn ends where the strand did.
    back = int(round(_TURN * radius / (STEP * width)))
    shorter = [line[back:-back] if len(line) > 4 * back else line for line in lines]
    links = []
    for tracks in (lines, shorter):
        links += smooth_links(tracks, ends, _TURN_LIMIT * width, width, _TURN * radius)
    links = [
        link
        for link in links
        if min(size[link.first // 2], size[link.second // 2]) < least
        and link.first // 2 != link.second // 2
    ]
    if not links:
        return []
    paths = strings([link.path for link in links])
    inside = shapely.covers(room, paths)
    links = links_without_folds(lines, [links[k] for k in np.flatnonzero(inside)], radius)
    if not links:
        return []
    paths = strings([link.path for link in links])
    tracks = strings(lines)
    link, track = shapely.STRtree(tracks).query(paths, predicate="dwithin", distance=_CLEAR * width)
    turns = []
    for k, candidate in enumerate(links):
        first, second = candidate.first // 2, candidate.second // 2
        old = {first, second}
        one, other = cut_back(lines[first], candidate, first), cut_back(lines[second], candidate, second)
        if min(len(one), len(other)) < 2:
            continue
        before = one if candidate.first % 2 else one[::-1]
        after = other[::-1] if candidate.second % 2 else other
        joined = np.concatenate([before, candidate.path[1:-1], after])
        zone = shapely.buffer(paths[k], _CLEAR * width)
        parts = [joined]
        for met in track[link == k].tolist():
            if met in (first, second):
                continue
            old.add(met)
            parts += open_lines(shapely.difference(tracks[met], zone))
        gain = sum(_worth(line_length(part), least) for part in parts) - line_length(candidate.path)
        gain -= sum(_worth(size[j], least) for j in old)
        if gain > _LEAST_GAIN * width and shapely.is_simple(shapely.linestrings(joined)):
            turns.append(_Turn(gain, old, parts))
    return turns
