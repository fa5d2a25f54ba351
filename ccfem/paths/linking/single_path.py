"""All tracks of a section as one continuous path that turns outside the section where possible.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181: one start, one end, most sharp turns outside the part. The paper does not say how the
links are made. Here they are Dubins curves (`link_curves`), the cheapest of several straight
extensions of the strands, or ways round the part (`ring_routes`), and the tracks are laid in the
order whose links cost least (`ordering`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.geometry.dubins import WORDS, advance, curve_points, word_sizes
from ccfem.geometry.offsets import ring_from
from ccfem.geometry.polylines import between, is_closed, line_length, resample, runs
from ccfem.geometry.section_grid import SectionGrid, place, place_and_room, section_grid
from ccfem.geometry.shapes import INSIDE, VOID, Region, Shapes, cut_at_section
from ccfem.paths.linking.ordering import (
    Clusters,
    costs_between_ends,
    improved_order,
    order_clusters,
    strands,
)

# Links between the ends of strands: curves of a least radius, cheapest outside the part.


_SAMPLE = 0.25
"""Step, mm, at which a curve is sampled close to the border."""
_STRAIGHT = np.zeros(3, dtype=np.int64)
"""Word of a straight line, constant like `WORDS` so that numba compiles one signature."""
_FAR = 15.0
"""Distance, in radii and longest extensions, beyond which only the first extension is tried: others
change little on a long way."""


class LinkCurves(NamedTuple):
    """The cheapest curve between each two ends.

    Attributes
    ----------
    cost : (t, t) array, mm
        Symmetric; inf between the two ends of one strand, and where no curve is below the bound.
    reach : (t, t) array, mm
        Straight extension at the first end; that at the second is ``reach[b, a]``.
    word : (t, t) int array
        Word from the end with the smaller number to the other.
    """

    cost: FloatArray
    reach: FloatArray
    word: IntArray


def link_curves(
    ends: FloatArray,
    reach: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    bound: FloatArray,
) -> LinkCurves:
    """Cheapest curves between all ends.

    Parameters
    ----------
    ends : (t, 3) array
        Poses at the ends of strands, heading out of the strand; 2k and 2k + 1 belong to strand k.
    reach : (t, v) array, mm
        Extensions to choose from; the first is the usual one.
    radius : float, mm
    weights : (3,) array
        Extra cost of each mm inside the part, over its voids, and outside.
    bound : (t, t) array, mm
        Cost of the link by other means: more expensive curves are not searched for.
    """
    return LinkCurves(*_link_curves(ends, reach, radius, grid, weights, bound))


def link_curve(
    ends: FloatArray, a: int, b: int, curves: LinkCurves, radius: float, step: float
) -> FloatArray:
    """Points (n, 2), mm, of the link from end a to end b, including both ends."""
    if a > b:
        return link_curve(ends, b, a, curves, radius, step)[::-1]
    first, second = curves.reach[a, b], curves.reach[b, a]
    start, end = _extended(ends[a], first), _reversed(_extended(ends[b], second))
    sizes = np.empty((6, 3))
    word_sizes(start, end, radius, sizes)
    word = int(curves.word[a, b])
    turns = WORDS[word] * np.where(sizes[word] < 0.0, -1, 1)
    curve = curve_points(start, end, turns, np.abs(sizes[word]), radius, step)
    before, after = stub_points(ends[a], first, step), stub_points(ends[b], second, step)[::-1]
    return np.concatenate([before, curve, after])


def stub_points(end: FloatArray, reach: float, step: float) -> FloatArray:
    """Points (n, 2), mm, from an end along its straight extension, without the last one."""
    parts = max(1, int(np.ceil(reach / step))) if reach > 0.0 else 0
    at = reach * np.arange(parts)[:, None] / max(parts, 1)
    return end[:2] + at * [np.cos(end[2]), np.sin(end[2])]


@compiled
def _extended(end: FloatArray, reach: float) -> FloatArray:
    pose = end.copy()
    pose[0] += reach * np.cos(end[2])
    pose[1] += reach * np.sin(end[2])
    return pose


@compiled
def _reversed(pose: FloatArray) -> FloatArray:
    back = pose.copy()
    back[2] += np.pi
    return back


@compiled
def curve_cost(
    start: FloatArray,
    turns: IntArray,
    sizes: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    limit: float,
) -> float:
    """Length of a curve plus `weights` times its length in each place; inf above the limit."""
    cost = abs(sizes[0]) + abs(sizes[1]) + abs(sizes[2])
    x, y, heading = start[0], start[1], start[2]
    for piece in range(3):
        turn, size = turns[piece], sizes[piece]
        total, done = abs(size), 0.0
        sense = 1.0 if size >= 0.0 else -1.0
        while done < total:
            if cost >= limit:
                return np.inf
            px, py, _ = advance(x, y, heading, turn, sense * done, radius)
            # A circle free of border: the place is the same for as long as the curve stays in it.
            where, room = place_and_room(grid, px, py)
            move = min(max(room, _SAMPLE), total - done)
            if room < move:
                middle = sense * (done + 0.5 * move)
                px, py, _ = advance(x, y, heading, turn, middle, radius)
                where = place(grid, px, py)
            cost += weights[where] * move
            done += move
        x, y, heading = advance(x, y, heading, turn, size, radius)
    return cost if cost < limit else np.inf


@compiled
def _link_curves(
    ends: FloatArray,
    reach: FloatArray,
    radius: float,
    grid: SectionGrid,
    weights: FloatArray,
    bound: FloatArray,
) -> tuple[FloatArray, FloatArray, IntArray]:
    count, variants = reach.shape
    cost = np.full((count, count), np.inf)
    chosen = np.zeros((count, count))
    word = np.zeros((count, count), np.int64)
    sizes, straight = np.empty((6, 3)), np.zeros(3)
    stub = np.empty(reach.shape)
    # Straight extensions of the ends, which curves begin after.
    for a in range(count):
        for v in range(variants):
            straight[1] = reach[a, v]
            stub[a, v] = curve_cost(ends[a], _STRAIGHT, straight, radius, grid, weights, np.inf)
    for a in range(count):
        for b in range(a + 1, count):
            if a // 2 == b // 2:
                continue
            apart = np.hypot(ends[a, 0] - ends[b, 0], ends[a, 1] - ends[b, 1])
            best = limit = min(bound[a, b], bound[b, a])
            for variant in range(variants * variants):
                v, w = variant // variants, variant % variants
                # Far apart, longer extensions change little.
                if variant and apart > _FAR * radius + reach[a, v] + reach[b, w]:
                    continue
                start = _extended(ends[a], reach[a, v])
                end = _reversed(_extended(ends[b], reach[b, w]))
                word_sizes(start, end, radius, sizes)
                stubs = stub[a, v] + stub[b, w]
                for k in range(6):
                    length = abs(sizes[k, 0]) + abs(sizes[k, 1]) + abs(sizes[k, 2])
                    if stubs + length >= best:
                        continue
                    total = stubs + curve_cost(
                        start, WORDS[k], sizes[k], radius, grid, weights, best - stubs
                    )
                    if total < best - 1e-9:
                        best = total
                        chosen[a, b], chosen[b, a] = reach[a, v], reach[b, w]
                        word[a, b] = k
            if best < limit:
                cost[a, b] = cost[b, a] = best
    return cost, chosen, word


# Links that lead round a part, along a ring outside it.


_DISTANCE = 5.0
"""Distance, mm, from the ring to the part; at least the radius."""
_LEADS = (5.0, 10.0, 16.0)
"""How far ahead on the ring, mm, a lead may end; more if turns are wide."""

_NEAR = 0.01
"""Half the length, mm, of the chord taken as a tangent of the ring."""


class RingRoutes(NamedTuple):
    """A ring round a part, and leads from ends to it.

    Attributes
    ----------
    ring : (n, 2) array, mm
        Closed; anticlockwise.
    length : float, mm
    starts : (t, 3) array
        Poses at which leads begin.
    goal : (t, 2, v, 3) array
        Poses on the ring at which they end: anticlockwise, then clockwise.
    position : (t, 2, v) array, mm
        Arc length on the ring of these poses.
    cost : (t, 2, v) array, mm
        Of the leads.
    word : (t, 2, v) int array
    radius : float, mm
    """

    ring: FloatArray
    length: float
    starts: FloatArray
    goal: FloatArray
    position: FloatArray
    cost: FloatArray
    word: IntArray
    radius: float


def ring_routes(
    starts: FloatArray, section: Region, radius: float, grid: SectionGrid, weights: FloatArray
) -> RingRoutes:
    """Ring round a part, and the cheapest leads to it from poses (t, 3) that head out of strands.

    Weights (3,) are extra costs of each mm inside the part, over its voids, and outside.
    """
    ring = _ring(section, max(_DISTANCE, radius))
    line = shapely.LineString(ring)
    length = float(line.length)
    ahead = np.array(_LEADS) * max(1.0, 0.5 * radius)
    foot = shapely.line_locate_point(line, shapely.points(starts[:, :2]))
    sense = np.array([1.0, -1.0])
    position = (foot[:, None, None] + sense[:, None] * ahead) % length
    flat = position.ravel()
    here, before, after = (
        shapely.get_coordinates(shapely.line_interpolate_point(line, (flat + d) % length))
        for d in (0.0, -_NEAR, _NEAR)
    )
    way = (after - before).reshape(*position.shape, 2) * sense[:, None, None]
    goal = np.concatenate(
        [here.reshape(*position.shape, 2), np.arctan2(way[..., 1:], way[..., :1])], axis=-1
    )
    cost, word = _leads(starts, goal, radius, grid, weights)
    return RingRoutes(ring, length, starts, goal, position, cost, word, radius)


def _ring(section: Region, distance: float) -> FloatArray:
    """Lay a closed curve (n, 2) round a section at a distance; round the hull of several parts."""
    for filled in (shapely.union_all(_filled(section)), shapely.convex_hull(section)):
        grown = shapely.union_all(_filled(shapely.buffer(filled, 2.0 * distance)))
        outline = shapely.buffer(grown, -distance, quad_segs=32)
        if outline.geom_type == "Polygon":
            break
    ring = shapely.get_coordinates(shapely.get_exterior_ring(shapely.normalize(outline)))
    return ring if shapely.is_ccw(shapely.linearrings(ring)) else ring[::-1]


def _filled(section: Region) -> Shapes:
    return shapely.polygons(shapely.get_exterior_ring(shapely.get_parts(section)))


@compiled
def _leads(
    starts: FloatArray, goal: FloatArray, radius: float, grid: SectionGrid, weights: FloatArray
) -> tuple[FloatArray, IntArray]:
    count, _, variants, _ = goal.shape
    cost = np.full(goal.shape[:3], np.inf)
    word = np.zeros(goal.shape[:3], np.int64)
    sizes = np.empty((6, 3))
    for a in range(count):
        for side in range(2):
            for v in range(variants):
                word_sizes(starts[a], goal[a, side, v], radius, sizes)
                for k in range(6):
                    total = curve_cost(
                        starts[a], WORDS[k], sizes[k], radius, grid, weights, cost[a, side, v]
                    )
                    if total < cost[a, side, v]:
                        cost[a, side, v] = total
                        word[a, side, v] = k
    return cost, word


@compiled
def ring_cost(routes: RingRoutes) -> tuple[FloatArray, IntArray]:
    """Cost (t, t), mm, of the way along the ring between each two ends, and an index of that way.

    The index encodes sense and leads, as `ring_curve` reads them.
    """
    position, lead, length = routes.position, routes.cost, routes.length
    count, _, variants = position.shape
    cost = np.full((count, count), np.inf)
    way = np.zeros((count, count), np.int64)
    for a in range(count):
        for b in range(count):
            for side in range(2):
                sense = 1.0 - 2.0 * side
                for v in range(variants):
                    for w in range(variants):
                        along = sense * (position[b, 1 - side, w] - position[a, side, v])
                        along -= length * np.floor(along / length)
                        total = lead[a, side, v] + along + lead[b, 1 - side, w]
                        if total < cost[a, b] - 1e-9:
                            cost[a, b] = total
                            way[a, b] = (side * variants + v) * variants + w
    return cost, way


def ring_curve(routes: RingRoutes, a: int, b: int, way: int, step: float) -> FloatArray:
    """Points (n, 2), mm, of the way from start a along the ring to start b."""
    variants = routes.position.shape[2]
    side, v, w = way // variants**2, way // variants % variants, way % variants
    out = _lead(routes, a, side, v, step)
    back = _lead(routes, b, 1 - side, w, step)[::-1]
    s, t = routes.position[a, side, v], routes.position[b, 1 - side, w]
    if side:
        s, t = t, s
    if t < s:
        t += routes.length
    twice = np.concatenate([routes.ring, routes.ring[1:]])
    arc = between(twice, float(s), float(t))
    arc, _ = resample(arc, np.array([0, len(arc)]), step)
    return np.concatenate([out, (arc[::-1] if side else arc)[1:-1], back])


def _lead(routes: RingRoutes, a: int, side: int, v: int, step: float) -> FloatArray:
    start, goal = routes.starts[a], routes.goal[a, side, v]
    sizes = np.empty((6, 3))
    word_sizes(start, goal, routes.radius, sizes)
    word = int(routes.word[a, side, v])
    turns = WORDS[word] * np.where(sizes[word] < 0.0, -1, 1)
    return curve_points(start, goal, turns, np.abs(sizes[word]), routes.radius, step)


_REACH = (1.0, 3.0, 6.0)
"""Straight extensions, mm, of tracks before a link turns."""
_EXACT_GROUPS = 10
"""Maximum number of groups whose order is optimal."""
_ROUNDS = 15
"""Rounds of the search among single tracks."""
_WEIGHTS = (16.0, 4.0, 0.0)
"""Extra cost of each mm of a link inside the section, over its holes, where nothing holds the
fibre, and outside."""
_AVOIDED = 100.0
"""Extra cost, mm, of a link that would be left out, in the next search for an order."""
_TRIES = 3
"""Number of orders that are tried while there are such links."""
_STEP = 0.5
"""Longest distance, mm, between neighbouring points of a link."""
_ON_BORDER = 1e-3
"""Length, mm, of a link on the border that may count as inside because of rounding."""


@dataclass(frozen=True)
class LinkedPath:
    """Tracks joined to one path.

    Attributes
    ----------
    points : (n, 2) array, mm
        A closed path repeats its first point.
    link : (n,) bool array
        Whether the step from each point to the next one is a link; false at the last point.
    """

    points: FloatArray
    link: BoolArray

    def __post_init__(self) -> None:
        freeze(self, points=float, link=bool)

    def without_long_links(
        self, section: Region, inside: float, over_void: float = np.inf
    ) -> "list[LinkedPath]":
        """Leave out links with more than a given length, mm, inside a section or over its voids.

        The number of pieces is one more than the number of such links.
        """
        stretches, left_out = runs(self.link), self.long_links(section, inside, over_void)
        starts = [0, *stretches[left_out, 1]]
        ends = [*stretches[left_out, 0], len(self.points) - 1]
        parts = []
        for a, b in zip(starts, ends, strict=True):
            link = self.link[a : b + 1].copy()
            link[-1:] = False
            parts.append(LinkedPath(self.points[a : b + 1], link))
        return parts

    def long_links(self, section: Region, inside: float, over_void: float) -> BoolArray:
        """Whether each link has more than the given length, mm, in a section or over its voids."""
        stretches = runs(self.link)
        steps = np.flatnonzero(self.link)
        cut = cut_at_section(self.points[steps], self.points[steps + 1], section, tolerance=0.0)
        size = np.linalg.norm(self.points[steps + 1] - self.points[steps], axis=1)[cut.step]
        owner = np.repeat(np.arange(len(stretches)), np.diff(stretches)[:, 0])[cut.step]
        left_out = np.zeros(len(stretches), dtype=bool)
        for where, longest in ((INSIDE, inside), (VOID, over_void)):
            there = size * (cut.end - cut.begin) * (cut.place == where)
            left_out |= np.bincount(owner, there, len(stretches)) > longest + _ON_BORDER
        return left_out


def link_tracks(
    groups: Sequence[Sequence[FloatArray]],
    section: Region,
    radius: float,
    width: float,
    inside: float = np.inf,
    over_void: float = np.inf,
) -> LinkedPath:
    """Join the tracks of all groups to one path.

    First each group is laid without interruption. The order of the groups, the order of the tracks
    in each and the ends at which they are entered and left are those of least link cost: exact for
    up to 12 tracks in a group and 10 groups, otherwise the result of a search. A second search
    moves stretches of single tracks where that makes the links cheaper still. The same input gives
    the same path, unless a search reaches its time limit.

    A link is the cheapest of the Dubins curves between the straight extensions of the ends, and of
    the ways along a ring round the section. It costs its length, plus 16 mm for each mm inside the
    section and 4 mm for each mm over a hole.

    Parameters
    ----------
    groups : sequence of sequences of (n_i, 2) arrays, mm
        One group for each main path. Tracks with fewer than two points are left out, and so are
        repeated points. A track whose last point is its first is closed. It is opened at the same
        place as the others of its group, with a gap for the link to the next. Tracks are extended
        straight by at least a millimetre, so their ends should lie on the border of the section.
    section : shapely (Multi)Polygon, mm
    radius : float, mm
        Tightest turn of a link.
    width : float, mm
        Spacing of neighbouring tracks.
    inside, over_void : float, mm
        As in `LinkedPath.without_long_links`: of a few orders, the one whose path is then cut into
        the fewest pieces is taken.

    Returns
    -------
    LinkedPath
        Empty without tracks; a single track is returned as it is.
    """
    wanted = [[_clean(track) for track in group if len(track) > 1] for group in groups]
    wanted = [[track for track in group if len(track) > 1] for group in wanted]
    wanted = [group for group in wanted if group]
    if not wanted:
        return LinkedPath(np.zeros((0, 2)), np.zeros(0, dtype=bool))
    if shapely.is_empty(section):
        raise InputError("tracks can only be linked round a section; got an empty one")
    check_number("width of tracks", width, above=0.0, unit="mm")
    if len(wanted) == len(wanted[0]) == 1:
        return LinkedPath(wanted[0][0], np.zeros(len(wanted[0][0]), dtype=bool))
    radius = max(radius, 0.05 * width)
    opened = _opened_tracks(wanted, radius, width)
    closed = [is_closed(track) for group in wanted for track in group]
    tracks = [track for group in opened for track in group]
    network = _Network.between(tracks, np.array(closed), section, radius)
    offsets = np.concatenate([[0], np.cumsum([2 * len(group) for group in opened])])
    cost, candidates = network.cost, []
    for _ in range(_TRIES):
        visits = _order(cost, offsets)
        path = _assembled(tracks, visits, network)
        long = np.flatnonzero(path.long_links(section, inside, over_void))
        candidates.append((len(long), path))
        if not len(long):
            break
        cost = cost.copy()
        left, entered = visits[long, 1], visits[long + 1, 0]
        cost[left, entered] += _AVOIDED
        cost[entered, left] += _AVOIDED
    return min(candidates, key=lambda candidate: candidate[0])[1]


def _clean(track: FloatArray) -> FloatArray:
    """Track without repeated points."""
    track = np.asarray(track, dtype=np.float64)
    if track.ndim != 2 or track.shape[1] != 2 or not np.isfinite(track).all():
        raise InputError(f"tracks must be finite (n, 2) arrays; got shape {track.shape}")
    return track[np.concatenate([[True], (np.diff(track, axis=0) != 0.0).any(axis=1)])]


def _opened_tracks(
    groups: Sequence[Sequence[FloatArray]], radius: float, width: float
) -> list[list[FloatArray]]:
    """Open closed tracks side by side, as near to the other groups as possible.

    The gap in each is as long as two arcs to the next track, one `width` sideways.
    """
    aside = min(width, 2.0 * radius)
    gap = max(width, 1.1 * float(np.sqrt(aside * (4.0 * radius - aside))))
    opened: list[list[FloatArray]] = []
    for group in groups:
        fixed = [track for track in group if not is_closed(track)]
        others = [*(track for other in groups if other is not group for track in other), *fixed]
        seam = np.concatenate([track[[0, -1]] for track in others]).mean(axis=0) if others else None
        opened.append([])
        for track in group:
            if is_closed(track):
                ring = ring_from(track, track[0] if seam is None else seam)
                seam, length = ring[0], line_length(ring)
                track = between(ring, 0.0, max(length - gap, 0.5 * length))
            opened[-1].append(track)
    return opened


class _Network(NamedTuple):
    """Links between all ends of tracks: ends 2k and 2k + 1 are those of track k."""

    ends: FloatArray  # (t, 3), poses that head out of the track
    reach: FloatArray  # (t,), mm, straight extension before a way round the part
    cost: FloatArray  # (t, t), mm
    curves: LinkCurves
    routes: RingRoutes
    way: IntArray  # (t, t), on the ring

    @classmethod
    def between(
        cls, tracks: Sequence[FloatArray], closed: BoolArray, section: Region, radius: float
    ) -> "_Network":
        ends = _end_poses(tracks)
        grid, weights = section_grid(section, 30.0), np.array(_WEIGHTS)
        reach = np.repeat(np.where(closed, 0.0, 1.0), 2)[:, None] * np.array(_REACH)
        starts = ends.copy()
        starts[:, :2] += reach[:, :1] * np.stack([np.cos(ends[:, 2]), np.sin(ends[:, 2])], axis=1)
        routes = ring_routes(starts, section, radius, grid, weights)
        around, way = ring_cost(routes)
        around = around + reach[:, 0] + reach[:, :1]
        curves = link_curves(ends, reach, radius, grid, weights, around)
        cost = np.minimum(curves.cost, np.minimum(around, around.T))
        return cls(ends, reach[:, 0], cost, curves, routes, way)

    def link(self, a: int, b: int) -> FloatArray:
        """Points (n, 2), mm, from end a to end b."""
        if np.isfinite(self.curves.cost[a, b]):
            return link_curve(self.ends, a, b, self.curves, self.routes.radius, _STEP)
        curve = ring_curve(self.routes, a, b, int(self.way[a, b]), _STEP)
        before, after = (stub_points(self.ends[k], self.reach[k], _STEP) for k in (a, b))
        return np.concatenate([before, curve, after[::-1]])


def _end_poses(tracks: Sequence[FloatArray]) -> FloatArray:
    tips = np.concatenate([track[[0, -1]] for track in tracks])
    x, y = (tips - np.concatenate([track[[1, -2]] for track in tracks])).T
    return np.column_stack([tips, np.arctan2(y, x)])


def _order(cost: FloatArray, offsets: IntArray) -> IntArray:
    """Find the ends (k, 2) at which each track is entered and left, in order.

    Group g has the ends from ``offsets[g]`` up to ``offsets[g + 1]``.
    """
    spans = [slice(a, b) for a, b in pairwise(offsets.tolist())]
    if len(spans) == 1:
        return order_clusters(strands(cost))
    visit = np.full(cost.shape, np.inf)
    for span in spans:
        visit[span, span] = costs_between_ends(cost[span, span])
    order = []
    for a, b in order_clusters(Clusters(cost, visit, offsets), exact=_EXACT_GROUPS).tolist():
        span = next(span for span in spans if span.start <= a < span.stop)
        within = order_clusters(strands(cost[span, span], a - span.start, b - span.start))
        order.append((within[:, 0] + span.start) // 2)
    return improved_order(np.concatenate(order), strands(cost), _ROUNDS)


def _assembled(tracks: Sequence[FloatArray], visits: IntArray, network: _Network) -> LinkedPath:
    parts: list[FloatArray] = []
    marks: list[BoolArray] = []
    for k, (entered, _) in enumerate(visits.tolist()):
        track = tracks[entered // 2]
        if k:
            link = network.link(int(visits[k - 1, 1]), entered)[1:-1]
            marks[-1][-1] = True
            parts.append(link)
            marks.append(np.ones(len(link), dtype=bool))
        parts.append(track[::-1] if entered % 2 else track)
        marks.append(np.zeros(len(track), dtype=bool))
    return LinkedPath(np.concatenate(parts), np.concatenate(marks))
