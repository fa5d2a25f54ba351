"""Joining polylines end to end into fewer, longer ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import along_line, is_closed, line_length, points_along
from ccfem.geometry.shapes import Region, Shapes, strings
from ccfem.linking.smooth_links import smooth_links

__all__ = ["Joined", "Joint", "join", "link_ends", "ring_arc"]


@dataclass(frozen=True)
class Joint:
    """A connection of two ends of polylines.

    Ends are numbered: polyline k starts with end 2 k and stops with end 2 k + 1.

    Attributes
    ----------
    first, second : int
        The ends.
    between : (n, 2) array, mm
        Points between them, from `first` to `second`, ends not included.
    marked : bool, default False
        Whether the path is marked as a link there.
    """

    first: int
    second: int
    between: FloatArray
    marked: bool = False


class Joined(NamedTuple):
    """Polylines joined to longer ones, and which steps of them are links.

    Attributes
    ----------
    lines : list of (n, 2) arrays, mm
        A chain of joints that returns to its start gives a closed polyline, first point repeated.
    link : list of (n,) bool arrays
        Whether the step from each point to the next is a link that is marked as one.
    """

    lines: list[FloatArray]
    link: list[BoolArray]


def join(lines: Sequence[FloatArray], joints: Sequence[Joint]) -> Joined:
    """Join polylines at their ends.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        Open polylines; closed ones simply have no joint.
    joints : sequence of Joint
        Each end in at most one of them.
    """
    partner: dict[int, tuple[int, FloatArray, bool]] = {}
    for joint in joints:
        partner[joint.first] = (joint.second, joint.between, joint.marked)
        partner[joint.second] = (joint.first, joint.between[::-1], joint.marked)
    joined = Joined([], [])
    done = np.zeros(len(lines), dtype=bool)
    ends = [end for end in range(2 * len(lines)) if end not in partner]
    for start in [*ends, *range(0, 2 * len(lines), 2)]:
        if done[start // 2]:
            continue
        parts, link = [], []
        end: int | None = start
        while end is not None and not done[end // 2]:
            done[end // 2] = True
            parts.append(lines[end // 2] if end % 2 == 0 else lines[end // 2][::-1])
            link.append(np.zeros(len(parts[-1]), dtype=bool))
            end, between, marked = partner.get(end ^ 1, (None, np.zeros((0, 2)), False))
            if end is not None:
                link[-1][-1] = marked  # the step off the strand
                parts.append(between)
                link.append(np.full(len(between), marked))
        if end is not None:  # back at the start
            parts.append(parts[0][:1])
            link.append(np.zeros(1, dtype=bool))
        joined.lines.append(np.concatenate(parts))
        joined.link.append(np.concatenate(link))
    return joined


_CLEARANCE = 0.9
"""Least distance of a link to other strands, in widths: ends on a slanted boundary stand a little
nearer to each other than the strands do."""

_CLOSING_TURN = np.deg2rad(60.0)
"""A link may close a path to a ring only where it turns less, both ends together: a path of two
neighbouring strands that closes on itself can no longer join the next."""

_ON_BORDER = 1e-6
"""Distance, mm, up to which rounding may carry what lies on a border off it."""


@dataclass(frozen=True)
class _Link:
    """A possible link of two ends; each line is cut back to where the link leaves it."""

    cost: float
    turn: float  # radians, both ends together
    first: int
    second: int
    path: FloatArray  # from the cut end of `first` to that of `second`
    smooth: bool = False  # keeps the radius


def link_ends(
    lines: Sequence[FloatArray],
    section: Region,
    limit: float,
    width: float,
    turn_cost: float = 1.0,
    along_boundary: bool = True,
    radius: float = 0.0,
    enough: float = np.inf,
    one_by_one: bool = False,
) -> Joined:
    """Join ends that lie near each other by links inside the section.

    A link is straight, or it follows the boundary half a strand's width inside it, where two
    neighbouring ends lie on that boundary. Links are taken in the order of their cost: their
    length, and `turn_cost` mm for every right angle that the path turns at its ends. A link
    crosses nothing and stays 0.9 widths away from all strands but the two that it joins.

    With a radius, curves that keep it (`smooth_links`) come first. Straight links and those along
    the boundary have corners: they join only what is shorter than `enough` to something else, and
    are marked as links.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    section : shapely (Multi)Polygon
    limit : float, mm
        Longest link.
    width : float, mm
        Of a strand.
    turn_cost : float, mm, default 1.0
    along_boundary : bool, default True
        Whether links may follow the boundary; otherwise all are straight.
    radius : float, mm, default 0
        Least radius of a turn; 0 for any, and no links that keep one.
    enough : float, mm, default inf
        Length from which on a path needs no link with corners, where there is a radius.
    one_by_one : bool, default False
        Whether a path goes on at either of its ends until it is long enough before another one is
        begun, from short strands to long ones: those side by side become zigzags.
    """
    opened = [k for k, line in enumerate(lines) if not is_closed(line)]
    if not opened or limit <= 0.0:
        return join(lines, [])
    ends = np.array([2 * k + side for k in opened for side in (0, 1)])
    points = np.array([lines[end // 2][-(end % 2)] for end in ends])
    outward = np.array([_outward(lines[end // 2], end % 2) for end in ends])
    links = _straight_links(points, outward, ends, limit, turn_cost)
    if along_boundary:
        links += _boundary_links(
            lines, points, outward, ends, section, 0.5 * width, limit, turn_cost
        )
    if radius > 0.0:
        found = smooth_links(lines, ends, limit, width, radius)
        links += [_Link(*link, smooth=True) for link in found]
    # Rounding orders no equal costs: a straight link comes before the same one along the boundary.
    size = [line_length(line) if one_by_one else 0.0 for line in lines]
    cost = [link.cost + size[link.first // 2] + size[link.second // 2] for link in links]
    keys = [
        (not x.smooth, round(c, 6), x.first, x.second) for x, c in zip(links, cost, strict=True)
    ]
    links = [links[k] for k in sorted(range(len(links)), key=keys.__getitem__)]
    needed, apart = enough if radius > 0.0 else np.inf, _CLEARANCE * width
    return _accept(list(lines), links, section, apart, needed, radius > 0.0, one_by_one)


def _accept(
    lines: list[FloatArray],
    links: list[_Link],
    section: Region,
    clearance: float,
    enough: float,
    mark: bool,
    one_by_one: bool,
) -> Joined:
    """Take links greedily, cheapest first, as long as they keep off everything else."""
    if not links:
        return join(lines, [])
    paths = strings([link.path for link in links])
    owners = np.array([[link.first // 2, link.second // 2] for link in links])
    free = _free_links(lines, paths, owners, section, clearance)
    taken: set[int] = set()
    accepted: list[Any] = []
    joints = []
    chain = np.arange(len(lines))
    length = np.array([line_length(line) for line in lines])  # of chains, at their numbers
    far = np.arange(2 * len(lines)) ^ 1  # other end of the chain of each end of a chain

    def take(k: int, most_long: int) -> bool:
        link, path = links[k], paths[k]
        if link.first in taken or link.second in taken:
            return False
        long = np.count_nonzero(length[chain[owners[k]]] >= enough)
        if not link.smooth and long > most_long:
            return False
        closes = chain[link.first // 2] == chain[link.second // 2]
        if closes and link.turn > _CLOSING_TURN:
            return False
        if accepted and shapely.dwithin(path, np.array(accepted), clearance).any():
            return False
        cut = {owner: _cut_back(lines[owner], link, owner) for owner in owners[k].tolist()}
        if min(len(line) for line in cut.values()) < 2:
            return False
        shortened = shapely.linestrings(_shorten(link.path))
        if shapely.intersects(shortened, strings(list(cut.values()))).any():
            return False
        for owner, line in cut.items():
            length[chain[owner]] += line_length(line) - line_length(lines[owner])
            lines[owner] = line
        into, gone = chain[owners[k]]
        length[into] += float(path.length) + (0.0 if closes else length[gone])
        chain[chain == gone] = into
        taken.update((link.first, link.second))
        accepted.append(path)
        marked = mark and not link.smooth
        joints.append(Joint(link.first, link.second, link.path[1:-1], marked))
        one, other = far[link.first], far[link.second]
        far[one], far[other] = other, one
        return True

    # Corners last, first between paths that are both too short. A smooth link needs no second try:
    # nothing that stood in its way has gone.
    rounds = [(k, 0) for k in np.flatnonzero(free).tolist()]
    if mark:
        rounds += [(k, 1) for k, _ in rounds if not links[k].smooth]
    at_end: dict[int, list[int]] = {}
    for k in np.flatnonzero(free).tolist() if one_by_one else ():
        for end in (links[k].first, links[k].second):
            at_end.setdefault(end, []).append(k)
    for k, most_long in rounds:
        grown = k if take(k, most_long) and not links[k].smooth and not most_long else None
        while grown is not None and one_by_one:
            tips = far[links[grown].first], far[links[grown].second]
            further = sorted({j for tip in tips for j in at_end.get(int(tip), ())})
            grown = next((j for j in further if take(j, 0)), None)
    return join(lines, joints)


def _free_links(
    lines: list[FloatArray], paths: Any, owners: Any, section: Region, clearance: float
) -> Any:
    """Mask (l,) of links inside the section and clear of all strands but their own."""
    # The link of two ends on one edge of the border lies on it: that must not be up to rounding.
    grown = shapely.buffer(section, _ON_BORDER)
    shapely.prepare(grown)
    free = shapely.covers(grown, paths)
    tree = shapely.STRtree(strings(lines))
    link, strand = tree.query(paths[free], predicate="dwithin", distance=clearance)
    link = np.flatnonzero(free)[link]
    free[link[(owners[link] != strand[:, None]).all(axis=1)]] = False
    return free


def _cut_back(line: FloatArray, link: _Link, k: int) -> FloatArray:
    """Line k, cut back at the ends that the link takes to where the link leaves it."""
    if link.first == 2 * k or link.second == 2 * k:
        line = _cut_start(line, link.path[0] if link.first == 2 * k else link.path[-1])
    if link.first == 2 * k + 1 or link.second == 2 * k + 1:
        point = link.path[0] if link.first == 2 * k + 1 else link.path[-1]
        line = _cut_start(line[::-1], point)[::-1]
    return line


def _cut_start(line: FloatArray, point: FloatArray) -> FloatArray:
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


def _shorten(path: FloatArray, share: float = 1e-3) -> FloatArray:
    shortened = path.copy()
    shortened[0] += share * (path[1] - path[0])
    shortened[-1] += share * (path[-2] - path[-1])
    return shortened


def _straight_links(
    points: FloatArray, outward: FloatArray, ends: Any, limit: float, turn_cost: float
) -> list[_Link]:
    pairs = cKDTree(points).query_pairs(limit, output_type="ndarray")
    a, b = pairs[:, 0], pairs[:, 1]
    step = points[b] - points[a]
    length = np.linalg.norm(step, axis=1)
    turn = _angles(outward[a], step) + _angles(outward[b], -step)
    cost = length + turn_cost * turn / (0.5 * np.pi)
    return [
        _Link(float(cost[k]), float(turn[k]), int(ends[a[k]]), int(ends[b[k]]), points[pairs[k]])
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
) -> list[_Link]:
    """Links along the boundary, `inset` inside it, between neighbouring ends on it."""
    links: list[_Link] = []
    starts = shapely.points(points)
    heads = strings(
        [_head(lines[e // 2] if e % 2 == 0 else lines[e // 2][::-1], limit) for e in ends]
    )
    for ring in shapely.get_rings(shapely.buffer(section, -inset)):
        near = np.flatnonzero(shapely.dwithin(ring, starts, 1.5 * inset))
        meeting, met = _first_meetings(heads[near], starts[near], ring)
        if not len(met):
            continue
        end = near[met]
        position = shapely.line_locate_point(ring, shapely.points(meeting))
        around = np.lexsort((end, position))
        for k, after in zip(around, np.roll(around, -1), strict=True):
            gap = float((position[after] - position[k]) % ring.length)
            if not 0.0 < gap <= limit:
                continue
            arc = ring_arc(ring, float(position[k]), gap)
            arc[0], arc[-1] = meeting[k], meeting[after]
            leaving = np.stack([arc[1] - arc[0], arc[-2] - arc[-1]])
            turn = float(_angles(outward[end[[k, after]]], leaving).sum())
            cost = gap + turn_cost * turn / (0.5 * np.pi)
            links.append(_Link(cost, turn, int(ends[end[k]]), int(ends[end[after]]), arc))
    return links


def _first_meetings(
    heads: Shapes, starts: Shapes, ring: shapely.LinearRing
) -> tuple[FloatArray, IntArray]:
    """Points (k, 2) where heads first meet a ring, and the numbers (k,) of the heads that do.

    A head that starts on the ring meets it there: strands that are kept half a width off the border
    end on it, and rounding puts one end just inside and the next just outside.
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
    """Points (n, 2) of a closed ring from the arc length `start` over `length`, both ends in."""
    corners = shapely.get_coordinates(ring)
    along = along_line(corners)
    twice = np.concatenate([along[:-1], along + along[-1]])
    inner = twice[(twice > start + 1e-9) & (twice < start + length - 1e-9)]
    wanted = np.concatenate([[start], inner, [start + length]]) % along[-1]
    return points_along(corners, along, wanted)


def _head(line: FloatArray, reach: float) -> FloatArray:
    """Return the first `reach` mm of a line, at least its first piece."""
    distance = np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))
    return line[: int(np.searchsorted(distance, reach)) + 2]


def _angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors (k, 2), radians in [0, pi]."""
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.asarray(np.abs(np.arctan2(cross, (a * b).sum(axis=1))))


def _outward(line: FloatArray, side: int, reach: float = 1.0) -> FloatArray:
    """Return the unit vector along which a line leaves its first or last (side 1) point."""
    head = _head(line if side == 0 else line[::-1], reach)
    step = head[0] - head[-1]
    return step / max(float(np.linalg.norm(step)), 1e-12)
