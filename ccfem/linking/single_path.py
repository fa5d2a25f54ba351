"""All tracks of a section as one continuous path, its turns outside the section as far as can be.

T. Wang, N. Li, G. Link, J. Jelonnek, J. Fleischer, J. Dittus, D. Kupzik, Load-dependent path
planning method for 3D printing of continuous fiber reinforced plastics, Composites Part A 140
(2021) 106181: one start, one end, most sharp turns outside the part. How the links are made is not
given there. Here they are Dubins curves or ways round the part (`link_curves`, `ring_routes`), and
the order of the tracks is the one whose links cost least (`ordering`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from ccfem.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.checks import check_number
from ccfem.errors import InputError
from ccfem.geometry.offsets import ring_from
from ccfem.geometry.places import INSIDE, VOID, cut_at_section
from ccfem.geometry.polylines import between, is_closed, line_length, runs
from ccfem.geometry.section_grid import section_grid
from ccfem.geometry.shapes import Region
from ccfem.linking.exchanges import improved_order
from ccfem.linking.link_curves import LinkCurves, link_curve, link_curves, stub_points
from ccfem.linking.ordering import costs_between_ends, order_clusters, strand_visits
from ccfem.linking.ring_routes import RingRoutes, ring_cost, ring_curve, ring_routes

__all__ = ["LinkedPath", "link_tracks"]

_REACH = (1.0, 3.0, 6.0)
"""Straight extensions, mm, of tracks before a link turns."""
_EXACT_GROUPS = 10
"""Most groups of which the best order is found for sure."""
_ROUNDS = 15
"""Of the search among single tracks."""
_ON_BORDER = 1e-3
"""Length, mm, of a link that begins on the border, by which it may seem to lie inside."""


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

    @property
    def links(self) -> list[FloatArray]:
        """The links in their order, as (m, 2) arrays, mm."""
        return [self.points[a : b + 1] for a, b in self._stretches()]

    def without_long_links(
        self, section: Region, inside: float, over_void: float = np.inf
    ) -> "list[LinkedPath]":
        """Leave out links of which more than so many mm lies inside a section or over its voids.

        The path falls into one piece more than there are such links.
        """
        stretches = self._stretches()
        steps = np.flatnonzero(self.link)
        cut = cut_at_section(self.points[steps], self.points[steps + 1], section, tolerance=0.0)
        size = np.linalg.norm(self.points[steps + 1] - self.points[steps], axis=1)[cut.step]
        owner = np.repeat(np.arange(len(stretches)), np.diff(stretches)[:, 0])[cut.step]
        left_out = np.zeros(len(stretches), dtype=bool)
        for place, longest in ((INSIDE, inside), (VOID, over_void)):
            there = size * (cut.end - cut.begin) * (cut.place == place)
            left_out |= np.bincount(owner, there, len(stretches)) > longest + _ON_BORDER
        starts = [0, *stretches[left_out, 1]]
        ends = [*stretches[left_out, 0], len(self.points) - 1]
        found = []
        for a, b in zip(starts, ends, strict=True):
            link = self.link[a : b + 1].copy()
            link[-1:] = False
            found.append(LinkedPath(self.points[a : b + 1], link))
        return found

    def _stretches(self) -> IntArray:
        """Points (k, 2) at which each link begins and ends."""
        return runs(self.link)


def link_tracks(
    groups: Sequence[Sequence[FloatArray]],
    section: Region,
    radius: float,
    width: float,
    inside_weight: float = 8.0,
    void_weight: float = 4.0,
    step: float = 0.5,
    time_limit: float = 30.0,
) -> LinkedPath:
    """Join the tracks of all groups to one path.

    First each group is laid in one go: the order of the tracks in a group, that of the groups, and
    the ends at which each is begun and left are those whose links cost least, exactly so for up to
    12 tracks in a group and 10 groups, else by a search that gives the same answer for the same
    input. Then stretches of single tracks change places where that makes the links cheaper still,
    as found by a search too.
    A link is the cheapest of the Dubins curves between the ends, extended straight, and of the ways
    along a ring round the section.

    Parameters
    ----------
    groups : sequence of sequences of (n_i, 2) arrays, mm
        One group for each main path. Tracks with less than two points are left out, and so are
        repeated points; a track whose last point is its first is closed, and is opened at the same
        place as the others of its group, with a gap for the link to the next. Tracks go on straight
        at their ends for a millimetre at least, so these should lie on the border of the section.
    section : shapely (Multi)Polygon, mm
    radius : float, mm
        Tightest turn of a link.
    width : float, mm
        Distance of neighbouring tracks.
    inside_weight : float, default 8
        Extra cost of each mm of a link inside the section.
    void_weight : float, default 4
        Extra cost of each mm of a link over a hole of the section, where nothing holds the fibre.
    step : float, mm, default 0.5
        Longest distance between neighbouring points of a link.
    time_limit : float, s, default 30
        For each of the searches, in which it ends sooner for up to some hundred tracks.

    Returns
    -------
    LinkedPath
        Empty without tracks; a single track as it is.

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
    weights = np.array([inside_weight, void_weight, 0.0])
    network = _Network.between(tracks, np.array(closed), section, radius, weights)
    sizes = np.array([len(group) for group in opened])
    visits = _order(network.cost, np.concatenate([[0], np.cumsum(sizes)]), time_limit)
    return _assembled(tracks, visits, network, step)


def _clean(track: FloatArray) -> FloatArray:
    """Track without repeated points."""
    track = np.asarray(track, dtype=np.float64)
    if track.ndim != 2 or track.shape[1] != 2 or not np.isfinite(track).all():
        raise InputError(f"tracks must be finite (n, 2) arrays; got shape {track.shape}")
    return track[np.concatenate([[True], (np.diff(track, axis=0) != 0.0).any(axis=1)])]


def _opened(
    groups: Sequence[Sequence[FloatArray]], radius: float, width: float
) -> list[list[FloatArray]]:
    """Open closed tracks side by side, as near to the other groups as can be.

    Each is left out for as long as two arcs take to the next track, one `width` aside.
    """
    aside = min(width, 2.0 * radius)
    gap = max(width, 1.1 * float(np.sqrt(aside * (4.0 * radius - aside))))
    found: list[list[FloatArray]] = []
    for k, group in enumerate(groups):
        others = [
            track[[0, -1]]
            for other in (*groups[:k], *groups[k + 1 :], group)
            for track in other
            if not (other is group and is_closed(track))
        ]
        seam: FloatArray | None = None
        tracks = []
        for track in group:
            if not is_closed(track):
                tracks.append(track)
                continue
            if seam is None:
                seam = np.concatenate(others).mean(axis=0) if others else track[0]
            ring = ring_from(track, seam)
            seam = ring[0]
            length = line_length(ring)
            tracks.append(between(ring, 0.0, max(length - gap, 0.5 * length)))
        found.append(tracks)
    return found


@dataclass(frozen=True)
class _Network:
    """Links between all ends of tracks.

    Attributes
    ----------
    ends : (t, 3) array
        Poses at the ends, heading out of the track: 2k and 2k + 1 are those of track k.
    reach : (t,) array, mm
        Straight extension of an end before a way round the part.
    cost : (t, t) array, mm
    curves : LinkCurves
    routes : RingRoutes
    by_ring : (t, t) bool array
    way : (t, t) int array
        On the ring.
    """

    ends: FloatArray
    reach: FloatArray
    cost: FloatArray
    curves: LinkCurves
    routes: RingRoutes
    by_ring: BoolArray
    way: IntArray

    @classmethod
    def between(
        cls,
        tracks: Sequence[FloatArray],
        closed: BoolArray,
        section: Region,
        radius: float,
        weights: FloatArray,
    ) -> "_Network":
        ends = _end_poses(tracks)
        grid = section_grid(section, 30.0)
        reach = np.repeat(np.where(closed, 0.0, 1.0), 2)[:, None] * np.array(_REACH)
        starts = ends.copy()
        starts[:, :2] += reach[:, :1] * np.stack([np.cos(ends[:, 2]), np.sin(ends[:, 2])], axis=1)
        routes = ring_routes(starts, section, radius, grid, weights)
        around, way = ring_cost(routes)
        around = around + reach[:, 0] + reach[:, :1]
        curves = link_curves(ends, reach, radius, grid, weights, around)
        cost = np.minimum(curves.cost, np.minimum(around, around.T))
        return cls(ends, reach[:, 0], cost, curves, routes, ~np.isfinite(curves.cost), way)

    def link(self, a: int, b: int, step: float) -> FloatArray:
        """Points (n, 2), mm, from end a to end b."""
        if not self.by_ring[a, b]:
            return link_curve(self.ends, a, b, self.curves, self.routes.radius, step)
        curve = ring_curve(self.routes, a, b, int(self.way[a, b]), step)
        before, after = (stub_points(self.ends[k], self.reach[k], step) for k in (a, b))
        return np.concatenate([before, curve, after[::-1]])


def _end_poses(tracks: Sequence[FloatArray]) -> FloatArray:
    ends = np.empty((2 * len(tracks), 3))
    for k, track in enumerate(tracks):
        for end, (tip, before) in enumerate(((track[0], track[1]), (track[-1], track[-2]))):
            out = tip - before
            ends[2 * k + end] = *tip, np.arctan2(out[1], out[0])
    return ends


def _order(cost: FloatArray, offsets: IntArray, time_limit: float) -> IntArray:
    """Find the ends (k, 2) at which each track is entered and left, in order."""
    spans = [slice(2 * a, 2 * b) for a, b in pairwise(offsets)]
    if len(spans) == 1:
        return _within(cost, None, None, time_limit)
    visit = np.full(cost.shape, np.inf)
    for span in spans:
        visit[span, span] = costs_between_ends(cost[span, span], time_limit=time_limit)
    found = []
    for a, b in order_clusters(
        cost, visit, 2 * offsets, exact=_EXACT_GROUPS, time_limit=time_limit
    ):
        span = next(span for span in spans if span.start <= a < span.stop)
        own = _within(cost[span, span], int(a - span.start), int(b - span.start), time_limit)
        found.append(own[:, 0] + span.start)
    count = len(cost) // 2
    return improved_order(
        np.concatenate(found) // 2,
        cost,
        strand_visits(count),
        2 * np.arange(count + 1),
        _ROUNDS,
        time_limit,
    )


def _within(cost: FloatArray, first: int | None, last: int | None, time_limit: float) -> IntArray:
    """Order one group: the ends (k, 2) at which each track is entered and left."""
    count = len(cost) // 2
    visit, offsets = strand_visits(count), 2 * np.arange(count + 1)
    return order_clusters(cost, visit, offsets, first, last, time_limit=time_limit)


def _assembled(
    tracks: Sequence[FloatArray], visits: IntArray, network: _Network, step: float
) -> LinkedPath:
    parts: list[FloatArray] = []
    marks: list[BoolArray] = []
    for k, (entered, _) in enumerate(visits):
        track = tracks[entered // 2]
        if entered % 2:
            track = track[::-1]
        if k:
            link = network.link(int(visits[k - 1, 1]), int(entered), step)[1:-1]
            marks[-1][-1] = True
            parts.append(link)
            marks.append(np.ones(len(link), dtype=bool))
        parts.append(track)
        marks.append(np.zeros(len(track), dtype=bool))
    return LinkedPath(np.concatenate(parts), np.concatenate(marks))
