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
from ccfem.base.errors import InputError
from ccfem.geometry.offsets import ring_from
from ccfem.geometry.places import INSIDE, VOID, cut_at_section
from ccfem.geometry.polylines import between, is_closed, line_length, runs
from ccfem.geometry.section_grid import section_grid
from ccfem.geometry.shapes import Region
from ccfem.paths.linking.exchanges import Clusters, improved_order, strands
from ccfem.paths.linking.link_curves import LinkCurves, link_curve, link_curves, stub_points
from ccfem.paths.linking.ordering import costs_between_ends, order_clusters
from ccfem.paths.linking.ring_routes import RingRoutes, ring_cost, ring_curve, ring_routes

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
        found = []
        for a, b in zip(starts, ends, strict=True):
            link = self.link[a : b + 1].copy()
            link[-1:] = False
            found.append(LinkedPath(self.points[a : b + 1], link))
        return found

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

    Raises
    ------
    InputError
        For points that are not finite, an empty section, or a width that is not positive.
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
    opened = _opened(wanted, radius, width)
    closed = [is_closed(track) for group in wanted for track in group]
    tracks = [track for group in opened for track in group]
    network = _Network.between(tracks, np.array(closed), section, radius)
    offsets = np.concatenate([[0], np.cumsum([2 * len(group) for group in opened])])
    cost, found = network.cost, []
    for _ in range(_TRIES):
        visits = _order(cost, offsets)
        path = _assembled(tracks, visits, network)
        long = np.flatnonzero(path.long_links(section, inside, over_void))
        found.append((len(long), path))
        if not len(long):
            break
        cost = cost.copy()
        left, entered = visits[long, 1], visits[long + 1, 0]
        cost[left, entered] += _AVOIDED
        cost[entered, left] += _AVOIDED
    return min(found, key=lambda each: each[0])[1]


def _clean(track: FloatArray) -> FloatArray:
    """Track without repeated points."""
    track = np.asarray(track, dtype=np.float64)
    if track.ndim != 2 or track.shape[1] != 2 or not np.isfinite(track).all():
        raise InputError(f"tracks must be finite (n, 2) arrays; got shape {track.shape}")
    return track[np.concatenate([[True], (np.diff(track, axis=0) != 0.0).any(axis=1)])]


def _opened(
    groups: Sequence[Sequence[FloatArray]], radius: float, width: float
) -> list[list[FloatArray]]:
    """Open closed tracks side by side, as near to the other groups as possible.

    The gap in each is as long as two arcs to the next track, one `width` sideways.
    """
    aside = min(width, 2.0 * radius)
    gap = max(width, 1.1 * float(np.sqrt(aside * (4.0 * radius - aside))))
    found: list[list[FloatArray]] = []
    for group in groups:
        fixed = [track for track in group if not is_closed(track)]
        others = [*(track for other in groups if other is not group for track in other), *fixed]
        seam = np.concatenate([track[[0, -1]] for track in others]).mean(axis=0) if others else None
        found.append([])
        for track in group:
            if is_closed(track):
                ring = ring_from(track, track[0] if seam is None else seam)
                seam, length = ring[0], line_length(ring)
                track = between(ring, 0.0, max(length - gap, 0.5 * length))
            found[-1].append(track)
    return found


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
        own = order_clusters(strands(cost[span, span], a - span.start, b - span.start))
        order.append((own[:, 0] + span.start) // 2)
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
