"""All tracks of a section as one continuous path that turns outside the section where possible.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181: one start, one end, most sharp turns outside the part. The paper does not say how the
links are made. Here they are Dubins curves or ways round the part (`link_curves`, `ring_routes`),
and the tracks are laid in the order whose links cost least (`ordering`).
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
from ccfem.geometry.dubins import WORDS, curve_points, word_sizes
from ccfem.geometry.offsets import ring_from
from ccfem.geometry.polylines import between, is_closed, line_length, resample, runs
from ccfem.geometry.section_grid import SectionGrid, section_grid
from ccfem.geometry.shapes import INSIDE, VOID, Region, Shapes, cut_at_section
from ccfem.paths.linking.exchanges import Clusters, greedy_order, improved_order, strands
from ccfem.paths.linking.link_curves import (
    LinkCurves,
    curve_cost,
    link_curve,
    link_curves,
    stub_points,
)

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
    """Ring round a part, and the cheapest leads to it.

    Parameters
    ----------
    starts : (t, 3) array
        Poses heading out of strands.
    section : shapely (Multi)Polygon, mm
    radius : float, mm
    weights : (3,) array
        Extra cost of each mm inside the part, over its voids, and outside.
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
    """Cost of the way along the ring between each two ends, and an index of that way.

    Returns
    -------
    cost : (t, t) array, mm
        Symmetric.
    way : (t, t) int array
        Sense and leads, encoded as a number that `ring_curve` reads.
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
        for place, longest in ((INSIDE, inside), (VOID, over_void)):
            there = size * (cut.end - cut.begin) * (cut.place == place)
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


# Order in which items with several ends are visited so that the links between them cost least.
#
# A cluster is visited once: it is entered at one of its terminals and left at another. A strand is
# a cluster of two terminals; a group of strands that are laid together is a cluster of all their
# ends. The order of the clusters and their terminals are found together. For few clusters, dynamic
# programming over sets of clusters gives the optimum (M. Held, R. M. Karp, A dynamic programming
# approach to sequencing problems, Journal of SIAM 10 (1962) 196). Otherwise stretches of the order
# are exchanged (2-opt, Or-opt), each order being evaluated with its best terminals.


_EXACT = 12
"""Maximum number of clusters for which the order is optimal."""


def order_clusters(clusters: Clusters, exact: int = _EXACT, rounds: int = 30) -> IntArray:
    """Order of clusters, and the terminals at which each is entered and left.

    Parameters
    ----------
    exact : int, default 12
        Up to this many clusters the order is optimal; the work is 2^p t^2.
    rounds : int, default 30
        Rounds of the search above that (`improved_order`); fewer for more than fifty clusters.

    Returns
    -------
    (p, 2) int array
        Terminals entered and left, in order.
    """
    links, visit = (np.ascontiguousarray(cost, dtype=np.float64) for cost in clusters[:2])
    offsets = np.ascontiguousarray(clusters.offsets, dtype=np.int64)
    count = len(offsets) - 1
    size = (int(offsets[-1]), int(offsets[-1]))
    if links.shape != size or visit.shape != size or not (np.diff(offsets) > 0).all():
        raise InputError(
            f"links and visit must have the shape {size} of the terminals in offsets, and every "
            f"cluster a terminal; got {links.shape} and {visit.shape}"
        )
    if count == 0:
        return np.zeros((0, 2), dtype=np.int64)
    clusters = Clusters(links, visit, offsets, clusters.first, clusters.last)
    if count <= exact:
        return _traced(_costs_of_sets(clusters), clusters)
    return improved_order(greedy_order(clusters), clusters, rounds)


def costs_between_ends(links: FloatArray) -> FloatArray:
    """Least cost of laying all strands of a group from one of their ends to another.

    Parameters
    ----------
    links : (2k, 2k) array
        Cost of the link between each two ends, the same both ways; strand i has the ends 2i and
        2i + 1.

    Returns
    -------
    (2k, 2k) array
        inf where the strands cannot be laid that way, as from an end to itself. For more than 12
        strands only pairs of ends that a search finds to be good have a finite cost.
    """
    if len(links) <= 2 * _EXACT:
        every = range(len(links))
        return np.stack([_costs_of_sets(strands(links, first))[-1] for first in every])
    table = np.full(links.shape, np.inf)
    starts = [-1]
    while starts:
        way = order_clusters(strands(links, starts.pop(0)), rounds=5)
        a, b = int(way[0, 0]), int(way[-1, 1])
        cost = float(links[way[:-1, 1], way[1:, 0]].sum())
        if not np.isfinite(table).any():
            starts = [a ^ 1, b, b ^ 1]
        table[a, b] = table[b, a] = min(cost, table[a, b])
    return table


@compiled
def _costs_of_sets(clusters: Clusters) -> FloatArray:
    """Least cost of having visited a set of clusters and left at one of its terminals, (2^p, t)."""
    links, visit, offsets, first, _ = clusters
    count, terminals = len(offsets) - 1, len(links)
    best = np.full((1 << count, terminals), np.inf)
    entry = np.empty(terminals)
    # Held and Karp: a set of clusters is a number, and larger sets come after those that they hold.
    for done in range((1 << count) - 1):
        for c in range(count):
            if done >> c & 1:
                continue
            for a in range(offsets[c], offsets[c + 1]):
                entry[a] = np.inf
                if done == 0:
                    entry[a] = 0.0 if first < 0 or first == a else np.inf
                    continue
                # Entered from the best exit of any cluster before.
                for d in range(count):
                    if done >> d & 1:
                        for t in range(offsets[d], offsets[d + 1]):
                            entry[a] = min(entry[a], best[done, t] + links[t, a])
            more = done | 1 << c
            for a in range(offsets[c], offsets[c + 1]):
                if entry[a] < np.inf:
                    for b in range(offsets[c], offsets[c + 1]):
                        best[more, b] = min(best[more, b], entry[a] + visit[a, b])
    return best


def _traced(best: FloatArray, clusters: Clusters) -> IntArray:
    """Terminals entered and left on the best way, read from the costs of sets backwards."""
    links, visit, offsets, first, last = clusters
    cluster = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    done = len(best) - 1
    left = last if last >= 0 else int(np.argmin(best[done]))
    if not np.isfinite(best[done, left]):
        raise InputError("there is no way through all clusters: some visit must be possible")
    way: list[tuple[int, int]] = []
    while True:
        nodes = np.arange(offsets[cluster[left]], offsets[cluster[left] + 1])
        done &= ~(1 << int(cluster[left]))
        if not done:
            way.append((first if first >= 0 else int(nodes[np.argmin(visit[nodes, left])]), left))
            return np.array(way[::-1])
        through = best[done][:, None] + links[:, nodes] + visit[nodes, left]
        t, a = np.unravel_index(int(np.argmin(through)), through.shape)
        way.append((int(nodes[a]), left))
        left = int(t)
