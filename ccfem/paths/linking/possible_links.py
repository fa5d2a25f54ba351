"""Possible links between the ends of polylines, and a check for free space."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.dubins import WORDS, shortest_curve, word_sizes
from ccfem.geometry.polylines import along_line, is_closed, pack, points_along, sizes
from ccfem.geometry.shapes import Region, Shapes, strings
from ccfem.paths.folds import MARGIN, folds

CLEARANCE = 0.9
"""Least distance of a link from other strands, in widths. Ends on a slanted boundary are slightly
nearer to each other than the strands are."""

CLOSING_TURN = np.deg2rad(60.0)
"""Largest turn, both ends together, of a link that closes a path to a ring. A path of two
neighbouring strands that closes on itself could no longer join the next strand."""

_WINDOWS = 1.2
"""Length of the strands beside a link that is looked at for folds, in radii."""

_OUTWARD = 1.0
"""Length, mm, over which the direction of an end is measured."""

_POINTS = 32
"""Points of the beginnings of lines that are looked at first."""

_ON_BORDER = 1e-6
"""Distance, mm, by which rounding may move points off a border."""


@dataclass(frozen=True)
class Link:
    """A possible link between two ends; each line is cut back to where the link leaves it.

    Attributes
    ----------
    cost : float, mm
    turn : float, radians
        Total over both ends.
    first, second : int
        The ends: line k starts with end 2 k and stops with end 2 k + 1.
    path : (n, 2) array, mm
        From the cut end of `first` to that of `second`.
    smooth : bool, default False
        Whether the link keeps the radius.
    """

    cost: float
    turn: float
    first: int
    second: int
    path: FloatArray
    smooth: bool = False


def possible_links(
    lines: Sequence[FloatArray],
    section: Region,
    limit: float,
    width: float,
    turn_cost: float = 1.0,
    along_boundary: bool = True,
    radius: float = 0.0,
) -> list[Link]:
    """Find links between near ends: straight, along the boundary, and smooth if there is a radius.

    Parameters as in `ccfem.paths.linking.joining.link_ends`. Links lie inside the section and
    `CLEARANCE` widths away from all strands but their own. With a radius there are none at which a
    strand would fold (`ccfem.paths.folds`).
    """
    opened = [k for k, line in enumerate(lines) if not is_closed(line)]
    if not opened or limit <= 0.0:
        return []
    ends = np.array([2 * k + side for k in opened for side in (0, 1)])
    points = np.array([lines[end // 2][-(end % 2)] for end in ends])
    outward = _outward(_heads(lines, ends, _OUTWARD))
    links = _straight_links(points, outward, ends, limit, turn_cost)
    if along_boundary:
        links += _boundary_links(
            lines, points, outward, ends, section, 0.5 * width, limit, turn_cost
        )
    if radius > 0.0:
        links += smooth_links(lines, ends, limit, width, radius)
    links = _free(lines, links, section, CLEARANCE * width)
    return _without_folds(lines, links, radius) if radius > 0.0 else links


def _free(
    lines: Sequence[FloatArray], links: list[Link], section: Region, clearance: float
) -> list[Link]:
    """Links inside the section and clear of all strands except their own."""
    if not links:
        return []
    paths = strings([link.path for link in links])
    # The link between two ends on one edge of the border lies on it: rounding must not matter.
    grown = shapely.buffer(section, _ON_BORDER)
    shapely.prepare(grown)
    free = shapely.covers(grown, paths)
    tree = shapely.STRtree(strings(lines))
    link, strand = tree.query(paths[free], predicate="dwithin", distance=clearance)
    link = np.flatnonzero(free)[link]
    owners = np.array([[link.first // 2, link.second // 2] for link in links])
    free[link[(owners[link] != strand[:, None]).all(axis=1)]] = False
    return [links[k] for k in np.flatnonzero(free).tolist()]


def _without_folds(lines: Sequence[FloatArray], links: list[Link], radius: float) -> list[Link]:
    """Links in which the joined strand does not fold, nor where it enters and leaves them."""
    if not links:
        return []
    heads: dict[tuple[int, bytes], FloatArray] = {}

    def head(end: int, place: FloatArray) -> FloatArray:
        """Line that runs from a place at one of its ends; most links leave it at the end itself."""
        key = end, place.tobytes()
        if key not in heads:
            line = lines[end // 2][:: -1 if end % 2 else 1]
            heads[key] = _head(cut_start(line, place), _WINDOWS * radius)
        return heads[key]

    joined = []
    for link in links:
        before, after = head(link.first, link.path[0]), head(link.second, link.path[-1])
        joined.append(np.concatenate([before[:0:-1], link.path, after[1:]]))
    open_ = np.zeros(len(links), dtype=bool)
    counts = folds(*pack(joined), open_, MARGIN * radius, strict=True).counts
    return [link for link, count in zip(links, counts.tolist(), strict=True) if not count]


def cut_back(line: FloatArray, link: Link, k: int) -> FloatArray:
    """Line k, cut back to where the link leaves it at the ends that the link uses."""
    if link.first == 2 * k or link.second == 2 * k:
        line = cut_start(line, link.path[0] if link.first == 2 * k else link.path[-1])
    if link.first == 2 * k + 1 or link.second == 2 * k + 1:
        point = link.path[0] if link.first == 2 * k + 1 else link.path[-1]
        line = cut_start(line[::-1], point)[::-1]
    return line


def cut_start(line: FloatArray, point: FloatArray) -> FloatArray:
    """Replace the start of a line, up to a point on it, by that point."""
    if np.array_equal(line[0], point):
        return line
    step = np.diff(line, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-30)
    share = np.clip(((point - line[:-1]) * step).sum(axis=1) / length, 0.0, 1.0)
    gap = np.linalg.norm(line[:-1] + share[:, None] * step - point, axis=1)
    piece = int(np.argmax(gap < 1e-9 + gap.min()))
    rest = line[piece + 1 :]
    return np.concatenate([[point], rest[1:] if np.allclose(rest[0], point) else rest])


def shortened(path: FloatArray, share: float = 1e-3) -> FloatArray:
    """Path without a share of its first and last step, which may touch the lines it joins."""
    result = path.copy()
    result[0] += share * (path[1] - path[0])
    result[-1] += share * (path[-2] - path[-1])
    return result


def _straight_links(
    points: FloatArray, outward: FloatArray, ends: Any, limit: float, turn_cost: float
) -> list[Link]:
    pairs = cKDTree(points).query_pairs(limit, output_type="ndarray")
    a, b = pairs[:, 0], pairs[:, 1]
    step = points[b] - points[a]
    length = np.linalg.norm(step, axis=1)
    turn = _angles(outward[a], step) + _angles(outward[b], -step)
    cost = length + turn_cost * turn / (0.5 * np.pi)
    return [
        Link(float(cost[k]), float(turn[k]), int(ends[a[k]]), int(ends[b[k]]), points[pairs[k]])
        for k in np.flatnonzero(length > 0.0)
    ]


def _boundary_links(
    lines: Sequence[FloatArray],
    points: FloatArray,
    outward: FloatArray,
    ends: Any,
    section: Region,
    inset: float,
    limit: float,
    turn_cost: float,
) -> list[Link]:
    """Links along the boundary, `inset` inside it, between neighbouring ends on it."""
    links: list[Link] = []
    starts = shapely.points(points)
    head = _heads(lines, ends, limit)
    inside = np.arange(head.along.shape[1]) <= head.last(limit)[:, None]
    heads = shapely.linestrings(head.points[inside], indices=np.nonzero(inside)[0])
    for ring in shapely.get_rings(shapely.buffer(section, -inset)):
        near = np.flatnonzero(shapely.dwithin(ring, starts, 1.5 * inset))
        meeting, met = _first_meetings(heads[near], starts[near], ring)
        if not len(met):
            continue
        end = near[met]
        # Ends in their order round the ring: each with the next one.
        position = shapely.line_locate_point(ring, shapely.points(meeting))
        around = np.lexsort((end, position))
        for k, after in zip(around, np.roll(around, -1), strict=True):
            gap = float((position[after] - position[k]) % ring.length)
            if not 0.0 < gap <= limit:
                continue
            arc = ring_arc(ring, float(position[k]), gap)
            arc[0], arc[-1] = meeting[k], meeting[after]
            # Rings have points on straight edges that hang on how the section lies.
            arc = shapely.get_coordinates(shapely.simplify(shapely.linestrings(arc), _ON_BORDER))
            leaving = np.stack([arc[1] - arc[0], arc[-2] - arc[-1]])
            turn = float(_angles(outward[end[[k, after]]], leaving).sum())
            cost = gap + turn_cost * turn / (0.5 * np.pi)
            links.append(Link(cost, turn, int(ends[end[k]]), int(ends[end[after]]), arc))
    return links


def _first_meetings(
    heads: Shapes, starts: Shapes, ring: shapely.LinearRing
) -> tuple[FloatArray, IntArray]:
    """Points (k, 2) where heads first meet a ring, and the numbers (k,) of the heads that do.

    A head that starts on the ring meets it there. Strands kept half a width off the border end on
    it, and rounding puts some ends just inside and others just outside.
    """
    starts_on = shapely.dwithin(ring, starts, _ON_BORDER)
    on, off = np.flatnonzero(starts_on), np.flatnonzero(~starts_on)
    crossed, index = shapely.get_coordinates(
        shapely.intersection(heads[off], ring), return_index=True
    )
    passed = shapely.line_locate_point(heads[off][index], shapely.points(crossed))
    order = np.lexsort((passed, index))
    _, first = np.unique(index[order], return_index=True)
    meeting = np.concatenate([shapely.get_coordinates(starts[on]), crossed[order[first]]])
    return meeting, np.concatenate([on, off[index[order[first]]]])


def ring_arc(ring: shapely.LinearRing, start: float, length: float) -> FloatArray:
    """Points (n, 2) of a closed ring over a `length` from arc length `start`, with both ends."""
    corners = shapely.get_coordinates(ring)
    along = along_line(corners)
    twice = np.concatenate([along[:-1], along + along[-1]])
    inner = twice[(twice > start + 1e-9) & (twice < start + length - 1e-9)]
    wanted = np.concatenate([[start], inner, [start + length]]) % along[-1]
    return points_along(corners, along, wanted)


def _head(line: FloatArray, reach: float) -> FloatArray:
    """Return the first `reach` mm of a line, or at least its first piece."""
    return line[: int(np.searchsorted(along_line(line)[1:], reach)) + 2]


class _Heads(NamedTuple):
    """Beginnings of lines, each from one of its ends: the last points of short ones repeat.

    Attributes
    ----------
    points : (e, h, 2) array, mm
    along : (e, h) array, mm
        Arc length from the end.
    number : (e,) int array
        Points of each line.
    """

    points: FloatArray
    along: FloatArray
    number: IntArray

    def last(self, reach: float) -> IntArray:
        """Last point (e,) of the first `reach` mm, or at least of the first piece."""
        before = (self.along[:, 1:] < reach).sum(axis=1)
        return np.minimum(before + 1, self.number - 1)

    def at(self, positions: FloatArray) -> FloatArray:
        """Points (e, k, 2) at arc lengths (k,), or the last ones, as of `numpy.interp`."""
        wanted = np.minimum(positions, self.along[:, -1:])
        piece = (self.along[:, None] <= wanted[..., None]).sum(axis=2) - 1
        row, piece = np.arange(len(piece))[:, None], np.minimum(piece, self.along.shape[1] - 2)
        begin, end = self.along[row, piece], self.along[row, piece + 1]
        first, second = self.points[row, piece], self.points[row, piece + 1]
        slope = (second - first) / np.where(end > begin, end - begin, 1.0)[..., None]
        inner = slope * (wanted - begin)[..., None] + first
        return np.where((wanted < end)[..., None], inner, second)


def _heads(lines: Sequence[FloatArray], ends: IntArray, reach: float) -> _Heads:
    """Beginnings of lines up to a reach, mm, from ends as of `Link`."""
    points, offsets = pack(lines)
    line, back = ends // 2, ends % 2
    count = np.diff(offsets)[line]
    start, sense = np.where(back, offsets[line + 1] - 1, offsets[line]), 1 - 2 * back
    most = _POINTS
    while True:
        number = np.minimum(np.arange(most), count[:, None] - 1)
        head = points[start[:, None] + sense[:, None] * number]
        steps = sizes((head[:, 1:] - head[:, :-1]).reshape(-1, 2)).reshape(len(head), -1)
        along = np.concatenate([np.zeros((len(head), 1)), np.cumsum(steps, axis=1)], axis=1)
        if ((along[:, -1] >= reach) | (count <= most)).all():
            return _Heads(head, along, count)
        most *= 2


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors (k, 2), radians in [0, pi]."""
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.asarray(np.abs(np.arctan2(cross, (a * b).sum(axis=1))))


def _outward(heads: _Heads) -> FloatArray:
    """Return the unit vectors (e, 2) along which lines leave their ends."""
    step = heads.points[:, 0] - heads.points[np.arange(len(heads.number)), heads.last(_OUTWARD)]
    return np.array([one / max(float(np.linalg.norm(one)), 1e-12) for one in step])


# Links that a machine's fibre can follow: of a least radius, and in line with the strands.
#
# Each link is the shortest curve of the radius (Dubins) from one strand to another. It leaves the
# strands before their ends where it is then shorter, or avoids a turn.


_CUTS = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
"""Distances before its end at which a strand may be left, in widths."""
_HEADING = 1.0
"""Length, in widths, over which the heading of a strand is measured."""
_STEP = 0.25
"""Longest step along a link, in widths."""
_MOST_TURN = np.radians(200.0)
"""Largest total turn of a link: beyond it there is no strand to be met."""


def smooth_links(
    lines: Sequence[FloatArray], ends: IntArray, limit: float, width: float, radius: float
) -> list[Link]:
    """Find possible links between ends that lie near each other, one for each pair.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    ends : (e,) int array
        Line k starts with end 2 k and stops with end 2 k + 1.
    limit : float, mm
        Largest distance between two ends.
    width : float, mm
        Of a strand.
    radius : float, mm
        Least radius of a link.

    Returns
    -------
    list of Link
        The cost is the length of the link plus what it cuts off the strands, mm.
    """
    if len(ends) < 2:
        return []
    cuts = _CUTS * width
    poses = _poses(_heads(lines, ends, cuts[-1] + 2.0 * _HEADING * width), cuts, width)
    pairs = cKDTree(poses[:, 0, :2]).query_pairs(limit, output_type="ndarray")
    room = np.array([along_line(line)[-1] for line in lines])[ends // 2]
    cheapest = _best(poses, pairs, cuts, room, radius, limit + cuts[-1])
    links = []
    for (a, b), (cost, turn, one, other) in zip(pairs, cheapest, strict=True):
        if not np.isfinite(cost):
            continue
        start, end = poses[a, int(one)].copy(), poses[b, int(other)].copy()
        end[2] += np.pi
        path = shortest_curve(start, end, radius, _STEP * width)
        if len(path) > 1:
            links.append(Link(float(cost), float(turn), int(ends[a]), int(ends[b]), path, True))
    return links


def _poses(heads: _Heads, cuts: FloatArray, width: float) -> FloatArray:
    """Poses (e, c, 3) at places before ends of lines, heading out of the lines."""
    # The heading of a chord is that in its middle: on a bend the end turns further by half of it.
    here, back, far = (heads.at(cuts + k * _HEADING * width) for k in (0.0, 1.0, 2.0))
    way, before = here - back, back - far
    bend = np.arctan2(
        before[..., 0] * way[..., 1] - before[..., 1] * way[..., 0], (before * way).sum(axis=2)
    )
    heading = np.arctan2(way[..., 1], way[..., 0]) + 0.5 * np.clip(bend, -0.3, 0.3)
    return np.concatenate([here, heading[..., None]], axis=2)


@compiled
def _best(
    poses: FloatArray,
    pairs: IntArray,
    cuts: FloatArray,
    room: FloatArray,
    radius: float,
    limit: float,
) -> FloatArray:
    """Cost, turn and cuts of the cheapest link of each pair; infinite cost if there is none."""
    result = np.empty((len(pairs), 4))
    sizes = np.empty((6, 3))
    end = np.empty(3)
    for p in range(len(pairs)):
        a, b = pairs[p, 0], pairs[p, 1]
        for column in range(4):
            result[p, column] = np.inf
        for one in range(len(cuts)):
            for other in range(len(cuts)):
                if cuts[one] > 0.4 * room[a] or cuts[other] > 0.4 * room[b]:
                    continue
                end[0], end[1] = poses[b, other, 0], poses[b, other, 1]
                end[2] = poses[b, other, 2] + np.pi
                word_sizes(poses[a, one], end, radius, sizes)
                # The shortest of the six words of Dubins between both poses.
                word, length = 0, np.inf
                for w in range(6):
                    size = abs(sizes[w, 0]) + abs(sizes[w, 1]) + abs(sizes[w, 2])
                    if size < length:
                        word, length = w, size
                cost = length + cuts[one] + cuts[other]
                if not cost < result[p, 0] or length > limit + np.pi * radius:
                    continue
                turn = 0.0
                for piece in range(3):
                    if WORDS[word, piece] != 0:
                        turn += abs(sizes[word, piece]) / radius
                if turn <= _MOST_TURN:
                    result[p, 0], result[p, 1] = cost, turn
                    result[p, 2], result[p, 3] = one, other
    return result
