"""First in, spiral out: one strand that starts in the middle of a region and winds to its border.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import KDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.geometry.offsets import ring_from, rings
from ccfem.geometry.polylines import line_length, resample
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Amount
from ccfem.paths.planning.infill import SPACING, Turns, check_fill, long_enough, with_turns
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress

# Contours of the distance to the border of a section, and the tree of which lie side by side.
#
# H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
# continuous carbon fiber parts, Materials 16 (2023) 998, measure the distance along the surface. In
# the plane, or in a chart of the layer, the contours are offsets of the border, which are exact.


SAMPLES = 3
"""Samples of a contour per spacing of length."""
_QUARTER = 16
"""Segments per quarter turn round a re-entrant corner."""
_SHORTEST = 2.2
"""Length of the shortest contour that is kept, in spacings."""
_NEXT, _RIDGE = 1.8, 2.1
"""Distance, in spacings, up to which contours lie side by side: of neighbouring levels, and of one
level on both sides of a ridge. Where contours end early, the ridge is that much wider."""
_RIDGE_COST = 3.0
"""Extra weight of a link across a ridge, in spacings."""
_LONGER = 1e-3
"""Weight, in spacings, that prefers long contours among those at the same distance."""


@dataclass(frozen=True)
class ContourTree:
    """Contours of one connected piece of a section.

    Attributes
    ----------
    contours : tuple of (n, 2) arrays, mm
        Closed rings, evenly sampled, with `SAMPLES` points or slightly fewer a spacing; the first
        point is not repeated.
    level : (k,) int array
        Distance of each contour inside the outermost one, in spacings.
    parent : (k,) int array
        The contour that each is attached to; -1 for the outermost one, which is the first.
    """

    contours: tuple[FloatArray, ...]
    level: IntArray
    parent: IntArray


def contour_trees(
    section: Region, spacing: float, start: FloatArray, closest: float, radius: float = 0.0
) -> list[ContourTree]:
    """Trees of the contours at half a spacing from the border and at every further spacing inwards.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    spacing : float, mm
    start : (2,) array, mm
        Every contour begins at its point nearest to this.
    closest : float
        Least distance between opposite sides of a contour, in spacings, from 0 to 1. A contour ends
        where it is narrower, and splits at a neck.
    radius : float, mm, default 0
        Least radius of the inner corners of contours. The contours stay a spacing apart, so the
        corners of the section stay open.

    Returns
    -------
    list of ContourTree
        One for each connected piece that is wide enough, and long enough for a contour.
    """
    narrow = 0.4995 * closest * spacing
    trees = []
    for piece in shapely.get_parts(_level(section, 0.5 * spacing, narrow, radius)):
        sampled: list[FloatArray] = []
        level: list[int] = []
        here = rings(piece)
        while here:
            long = [ring for ring in here if line_length(ring) >= _SHORTEST * spacing]
            depth = level[-1] + 1 if level else 0
            if not long:
                break
            sampled += [_sampled(ring_from(ring, start), spacing) for ring in long]
            level += [depth] * len(long)
            deeper = shapely.get_parts(_level(section, (1.5 + depth) * spacing, narrow, radius))
            here = rings(shapely.multipolygons(deeper[shapely.intersects(deeper, piece)]))
        if sampled:
            trees += _contour_trees(sampled, np.array(level), spacing, _RIDGE + closest)
    return trees


def _level(section: Region, distance: float, narrow: float, radius: float) -> Region:
    """Return the region at a distance from the border, with rounded corners, that is wide enough.

    All in mm. A border is rounded by the discs of the radius that fit on the material's side,
    regardless of other borders. So a border rounded further in lies further in by that distance.
    """
    inner = shapely.buffer(section, -distance, quad_segs=_QUARTER)
    if radius > 0.0:
        parts = shapely.get_parts(inner)
        outer = _contour_opened(shapely.polygons(shapely.get_exterior_ring(parts)), radius)
        holes = [shapely.Polygon(ring) for part in parts for ring in part.interiors]
        inner = shapely.union_all(outer)
        if holes:
            inner = shapely.difference(inner, shapely.union_all(_contour_opened(holes, -radius)))
    return _contour_opened(inner, narrow)


def _contour_opened(region: Any, radius: float) -> Any:
    """Return what discs of a radius, mm, reach inside; if negative, what they miss outside."""
    if radius == 0.0:
        return region
    inner = shapely.buffer(region, -radius, quad_segs=_QUARTER)
    return shapely.buffer(inner, radius, quad_segs=_QUARTER)


def _sampled(ring: FloatArray, spacing: float) -> FloatArray:
    """Ring in even steps of at least a third of a spacing, without repeating its first point."""
    count = max(int(line_length(ring) * SAMPLES / spacing), 4)
    points, _ = resample(ring, np.array([0, len(ring)]), line_length(ring) / count * (1.0 + 1e-9))
    return points[:-1]


def _contour_trees(
    rings: Sequence[FloatArray], level: IntArray, spacing: float, reach: float
) -> list[ContourTree]:
    """Trees of contours: minimum spanning trees over those that lie side by side."""
    lines = np.array([shapely.linearrings(ring) for ring in rings])
    one, other = shapely.STRtree(lines).query(lines, "dwithin", reach * spacing)
    kept = (one < other) & (np.abs(level[one] - level[other]) <= 1)
    one, other = one[kept], other[kept]
    apart = shapely.distance(lines[one], lines[other]) / spacing
    ridge = level[one] == level[other]
    links = shapely.shortest_line(lines[one], lines[other])
    link, met = shapely.STRtree(lines).query(links, "intersects")
    over = (met != one[link]) & (met != other[link])
    kept = ridge | (apart < _NEXT)
    kept[link[over]] = False  # with another contour between them
    one, other, apart, ridge = one[kept], other[kept], apart[kept], ridge[kept]
    size = shapely.length(lines) / shapely.length(lines).max()
    weight = np.round(apart, 3) + _RIDGE_COST * ridge + _LONGER * (2.0 - size[one] - size[other])
    count = len(rings)
    forest = minimum_spanning_tree(coo_array((weight, (one, other)), shape=(count, count)).tocsr())
    trees = []
    left = np.ones(count, dtype=bool)
    while left.any():
        outer = np.flatnonzero(left & (level == level[left].min()))
        root = int(outer[np.argmax(size[outer])])
        order, before = breadth_first_order(forest, root, directed=False)
        left[order] = False
        number = np.empty(count, dtype=np.int64)
        number[order] = np.arange(len(order))
        parent = np.append(-1, number[before[order[1:]]])
        trees.append(
            ContourTree(
                tuple(read_only(rings[k], float) for k in order.tolist()),
                read_only(level[order], int),
                read_only(parent, int),
            )
        )
    return trees


_NARROW = 0.5
"""Least distance between opposite sides of a contour, in spacings, where laps keep a radius."""


@dataclass(frozen=True)
class Fiso:
    """Contours of a region joined to one strand, which is never cut inside it. No stress is needed.

    The contours lie half a spacing from the border and at every further spacing inwards. Those
    between the border and the point farthest from it become laps: the fibre starts at the innermost
    one and steps outwards from lap to lap. All other contours are merged into their neighbours.
    A region is a connected part of the section that is at least as wide as a strand.

    Attributes
    ----------
    spacing : float, default 1
        Distance between neighbouring contours in fibre widths, at least 1.
    closest : float, default 0
        Least distance between opposite sides of a contour, in spacings, from 0 to 1. With 0, as
        published, two strands may lie nearer than a width along the ridge between two borders. With
        1 none does, but a gap up to three spacings wide stays open there.
    least_radius : float, mm, default 0
        Least radius of the corners of contours and of the ramps between laps. All laps then run in
        one sense, and the corners of the section and the middle of small regions stay open. Turns
        where contours are merged are still half a spacing wide. With 0, as published, all turns
        are that tight.
    entry : bool, default False
        Whether the strand also starts at the border, and goes straight to the middle through the
        openings of the laps. Not with `least_radius`.
    minimum_length : float, mm, optional
        Shorter paths are dropped; by default the shortest that the machine can cut.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`. Unless this is "tight", contours that are long enough for the cutter are not
        merged.
    """

    spacing: float = 1.0
    closest: float = 0.0
    least_radius: float = 0.0
    entry: bool = False
    minimum_length: float | None = None
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True
    by_layer: ClassVar[bool] = True
    folds: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "apart": {"closest": 1.0},
        "round": {"least_radius": 3.85},
        "entry": {"entry": True},
        "printable": {"turns": "printable"},
        "cut": {"turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_fill(self)
        check_fields(self, "closest", at_least=0.0, at_most=1.0, unit="spacings")
        check_fields(self, "least_radius", at_least=0.0, unit="mm")
        if self.entry and self.least_radius > 0.0:
            raise InputError(
                "fiso.entry goes through openings that leave no room for ramps: set "
                "fiso.least_radius to 0, or fiso.entry to false"
            )

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        spacing, radius = self.spacing * machine.fibre_width, self.least_radius
        closest = max(self.closest, _NARROW) if radius > 0.0 else self.closest
        start = layer.plane.points[layer.loops[0][:2]].mean(axis=0)
        lines: list[FloatArray] = []
        least = np.inf if self.turns == "tight" else machine.shortest_strand
        section = layer.plane.polygon
        for tree in contour_trees(section, spacing, start, closest, radius):
            lines += first_in_spiral_out(tree, spacing, start, self.entry, radius, least)
        lines = with_turns(self, lines, machine).lines
        return long_enough(Toolpaths.from_plane(lines, layer), self.minimum_length, machine)


# First in, spiral out: the contours of a section as one strand that starts in its middle.
#
# H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
# continuous carbon fiber parts, Materials 16 (2023) 998. The supplement with their algorithm is not
# available. Here dynamic programming chooses the places where the contours are opened, so that the
# strand steps from each contour to the next where they lie side by side.


_STEP = 1.8
"""Longest step from one contour to the next, in spacings; if one is longer, all are merged."""
_NEIGHBOURS = 8
"""Number of points of the next contour that a step may lead to."""
_CANDIDATES = 12
"""Number of places that are tried for merging two contours."""
_APART = 2 * SAMPLES
"""Samples beside a gap that no other gap may touch."""
_LIPS = 4 * SAMPLES
"""Samples beside the opening of a lap that no gap may touch."""
_CUBE = 3.0
"""Power of the step lengths whose sum is minimised."""
_NEAR = 1e-3
"""Cost of the distance from the start, per spacing: it decides between otherwise equal places."""
_WIDEST = 3.1
"""Longest mean link of a merged contour, in spacings: enough for a ridge that stays open."""
_BEND = 10.0
"""Cost of a place where the contour lies a spacing off the chord of a ramp."""
_RAMP = 6.0
"""Squared length of a ramp, over its radius times its height."""
_TURN = 12
"""Least number of ramps that would fit round a contour."""
_PASSES = 2
"""Passes of smoothing."""


@dataclass(frozen=True)
class _Loop:
    """A closed line of samples (n, 2), the samples no gap may touch, and where it is opened."""

    points: FloatArray
    kept: BoolArray
    opening: BoolArray

    def rolled(self, first: int) -> "_Loop":
        """Return the same loop starting at another sample."""
        points = np.roll(self.points, -first, axis=0)
        return _Loop(points, np.roll(self.kept, -first), np.roll(self.opening, -first))


def first_in_spiral_out(
    tree: ContourTree,
    spacing: float,
    start: FloatArray,
    entry: bool = False,
    radius: float = 0.0,
    alone_from: float = np.inf,
) -> list[FloatArray]:
    """Join the contours of a tree to one open strand from the innermost to the outermost.

    The contours from the outermost one to the highest maximum of the distance become laps. Each is
    opened by a spacing where the next one is near, and the strand steps there from lap to lap. All
    other contours are merged into their parent: both are opened by a spacing at one place and
    joined crosswise.

    Parameters
    ----------
    spacing : float, mm
    start : (2,) array, mm
        Of places with equal cost, the outermost contour is opened at the one nearest to this.
    entry : bool, default False
        Whether the strand also starts at the outermost contour, and goes straight to the middle
        through the openings, which are then two spacings wide. If it would cross a lap on the way,
        it starts in the middle all the same.
    radius : float, mm, default 0
        Above 0 all laps run in one sense, and ramps of at least this radius lead from each to the
        next; not with `entry`. Turns where contours are merged are still half a spacing wide.
    alone_from : float, mm, default inf
        Length from which contours that are not laps stay separate closed curves, since merging
        would need turns half a spacing wide.

    Returns
    -------
    list of (n, 2) arrays, mm
        One strand, and contours that lie nowhere side by side with another for the length of a
        gap.
    """
    chain = _chain(tree)
    gap = 2 * SAMPLES if entry else SAMPLES
    if radius > 0.0:
        gap = max(int(np.ceil(SAMPLES * np.sqrt(_RAMP * radius / spacing))), SAMPLES)
    places = _openings([tree.contours[k] for k in chain], gap, spacing, start)
    wide = np.linalg.norm(np.diff(places.points, axis=0), axis=1).max(initial=0.0) > _STEP * spacing
    laps = {} if wide else dict(zip(chain, places.before, strict=True))
    loops, alone = _merged_contours(tree, laps, gap, spacing, start, alone_from)
    if wide:
        strands = [_opened_loop(loops[0], SAMPLES)]
    elif (
        entry
        and len(chain) > 1
        and shapely.is_simple(shapely.linestrings(through := _entered(loops, places.points)))
    ):
        strands = [through]
    elif radius > 0.0:
        # On a ring round a small hole a long ramp would cut through the hole.
        gaps = [max(min(gap, len(tree.contours[k]) // _TURN), SAMPLES) for k in chain]
        opened = [_opened_loop(loop, opening) for loop, opening in zip(loops, gaps, strict=True)]
        strands = [_ramped(opened[::-1])]
    else:
        strands = [_laps([_opened_loop(loop, gap) for loop in reversed(loops)])]
    return [_smooth(line) for line in (*strands, *alone)]


class _Openings(NamedTuple):
    """Where the laps are opened: the sample before each opening, and the places (k, 2), mm."""

    before: list[int]
    points: FloatArray


def _chain(tree: ContourTree) -> list[int]:
    """Contours from the outermost to the highest maximum, the longest where there are several."""
    size = np.array([len(ring) for ring in tree.contours])
    highest = np.flatnonzero(tree.level == tree.level.max())
    at = int(highest[np.argmax(size[highest])])
    chain = []
    while at >= 0:
        chain.append(at)
        at = int(tree.parent[at])
    return chain[::-1]


def _openings(
    rings: Sequence[FloatArray], gap: int, spacing: float, start: FloatArray
) -> _Openings:
    """Choose openings of a width in samples for which the sum of cubed steps is least.

    For a wide opening the distance of the contour from its chord is added to the cost.
    """
    middles = [_middles(ring) for ring in rings]
    distances = [_NEAR / spacing * np.linalg.norm(line - start, axis=1) for line in middles]
    if gap > 2 * SAMPLES:
        for line, cost in zip(middles, distances, strict=True):
            chord = 0.5 * (np.roll(line, gap // 2, axis=0) + np.roll(line, -(gap // 2), axis=0))
            cost += _BEND * np.linalg.norm(line - chord, axis=1) / spacing
    cost = distances[-1]
    following: list[IntArray] = []
    # From the inside out: the least sum from each place on, and the place that it goes on to.
    for k in range(len(rings) - 2, -1, -1):
        outer, inner = middles[k], middles[k + 1]
        count = min(_NEIGHBOURS, len(inner))
        off, near = KDTree(inner).query(outer, k=range(1, count + 1))
        total = (off / spacing) ** _CUBE + cost[near]
        best = total.argmin(axis=1)
        rows = np.arange(len(outer))
        cost = total[rows, best] + distances[k]
        following.append(near[rows, best])
    index = [int(cost.argmin())]
    for step in reversed(following):
        index.append(int(step[index[-1]]))
    places = np.stack([line[k] for line, k in zip(middles, index, strict=True)])
    return _Openings(index, places)


def _merged_contours(
    tree: ContourTree,
    laps: Mapping[int, int],
    gap: int,
    spacing: float,
    start: FloatArray,
    alone_from: float,
) -> tuple[list[_Loop], list[FloatArray]]:
    """Laps, or else the outermost contour, with contours merged into them; contours left alone."""
    loops: dict[int, _Loop] = {}
    for k, ring in enumerate(tree.contours):
        opening = np.zeros(len(ring), dtype=bool)
        kept = opening.copy()
        if k in laps:
            at = laps[k]
            opening[at] = True
            beside = _LIPS + (gap - SAMPLES) // 2
            kept[np.arange(at - beside + 1, at + beside + 1) % len(ring)] = True
        loops[k] = _Loop(ring, kept, opening)
    alone = []
    # Parents come before their children: going backwards, every contour already holds all of its.
    for k in range(len(tree.contours) - 1, 0, -1):
        if k in laps:
            continue
        parent = int(tree.parent[k])
        ring = np.concatenate([loops[k].points, loops[k].points[:1]])
        long = line_length(ring) >= alone_from
        joined = None if long else _joined_loops(loops[parent], loops[k], spacing, start)
        if joined is None:
            alone.append(ring)
        else:
            loops[parent] = joined
    return [loops[k] for k in (laps or (0,))], alone


def _joined_loops(line: _Loop, other: _Loop, spacing: float, start: FloatArray) -> _Loop | None:
    """Two closed lines joined to one where both links are shortest; None if there is no place."""
    mine, theirs = (np.flatnonzero(~_gap_touches(loop.kept)) for loop in (line, other))
    if min(len(line.points), len(other.points)) < SAMPLES + 2 or not (len(mine) and len(theirs)):
        return None
    # Of the nearest pairs of steps, the one with the shortest links, either way round.
    middles = _middles(line.points)[mine]
    off, near = KDTree(_middles(other.points)[theirs]).query(middles)
    late = _NEAR / spacing * np.linalg.norm(middles - start, axis=1)
    best, choice = np.inf, (0, 0, False)
    for row in np.argsort(np.round(off / spacing, 6) + late, kind="stable")[:_CANDIDATES].tolist():
        i, j = int(mine[row]), int(theirs[near[row]])
        for turned in (False, True):
            total = _links(line.points, i, other.points, j, turned) / spacing + late[row]
            if total < best:
                best, choice = total, (i, j, turned)
    i, j, turned = choice
    if _links(line.points, i, other.points, j, turned) > 2.0 * _WIDEST * spacing:
        return None
    one, two = _gap(line, i), _gap(other, j)
    if turned:
        two = _Loop(two.points[::-1], two.kept[::-1], two.opening[::-1])
    return _Loop(
        np.concatenate([one.points, two.points]),
        np.concatenate([one.kept, two.kept]),
        np.concatenate([one.opening, two.opening]),
    )


def _links(line: FloatArray, i: int, other: FloatArray, j: int, turned: bool) -> float:
    """Total length of both links between two lines opened about the steps from samples i and j."""
    lips = [other[(j + 2) % len(other)], other[j - 1]]
    to, back = reversed(lips) if turned else lips
    here, on = line[i - 1], line[(i + 2) % len(line)]
    return float(np.linalg.norm(here - to) + np.linalg.norm(on - back))


def _middles(ring: FloatArray) -> FloatArray:
    """Return the middles of the steps from each sample of a ring to the next."""
    return 0.5 * (ring + np.roll(ring, -1, axis=0))


def _gap_touches(kept: BoolArray) -> BoolArray:
    """Whether a gap about the step from each sample would touch a sample in `kept`."""
    return kept | np.roll(kept, 1) | np.roll(kept, -1) | np.roll(kept, -2)


def _gap(loop: _Loop, at: int) -> _Loop:
    """Open a loop by three samples about the step from one sample; its ends are the lips."""
    opened = loop.rolled((at + 2) % len(loop.points))
    kept = opened.kept[:-2].copy()
    kept[:_APART] = kept[-_APART:] = True
    return _Loop(opened.points[:-2], kept, opened.opening[:-2])


def _opened_loop(loop: _Loop, gap: int) -> FloatArray:
    """Open a loop by a number of samples about its opening, or at its first sample."""
    at = int(np.flatnonzero(loop.opening)[0]) if loop.opening.any() else 0
    before = (gap - 1) // 2
    points = loop.rolled((at + 1 + before) % len(loop.points)).points
    return points[: max(len(points) - gap + 1, 2)]


def _laps(lines: Sequence[FloatArray]) -> FloatArray:
    """Lay laps one after the other, each from its nearer end."""
    path = [lines[0]]
    if len(lines) > 1:
        ends = np.linalg.norm(lines[0][[0, -1], None] - lines[1][None, [0, -1]], axis=2)
        if ends[0].min() < ends[1].min():
            path = [lines[0][::-1]]
    for line in lines[1:]:
        here = path[-1][-1]
        nearer = np.linalg.norm(line[0] - here) <= np.linalg.norm(line[-1] - here)
        path.append(line if nearer else line[::-1])
    return np.concatenate(path)


def _ramped(lines: Sequence[FloatArray]) -> FloatArray:
    """Lay laps one after the other in one sense, with a smooth ramp from each to the next."""
    path = [lines[0]]
    for line in lines[1:]:
        before = path[-1]
        beyond = line
        if np.linalg.norm(line[0] - before[-1]) < np.linalg.norm(line[-1] - before[-1]):
            beyond = line[::-1]
        path += [_ramp(before, beyond), beyond]
    return np.concatenate(path)


def _ramp(before: FloatArray, beyond: FloatArray) -> FloatArray:
    """Points between two lines on the cubic that continues both of them smoothly."""
    (a, b), way = (before[-1], beyond[0]), float(np.linalg.norm(beyond[0] - before[-1]))
    ahead = [line[1] - line[0] for line in (before[-2:], beyond[:2])]
    u, v = (way * tangent / np.linalg.norm(tangent) for tangent in ahead)
    count = max(round(way / float(np.linalg.norm(ahead[1]))), 2)
    t = np.arange(1, count)[:, None] / count
    ends = (1.0 - t) ** 2 * (1.0 + 2.0 * t) * a + t**2 * (3.0 - 2.0 * t) * b
    return np.asarray(ends + t * (1.0 - t) ** 2 * u + t**2 * (t - 1.0) * v)


def _entered(loops: Sequence[_Loop], places: FloatArray) -> FloatArray:
    """Lay laps with a straight way in through their openings, from the border to the innermost."""
    wide, way_in = 2 * SAMPLES, shapely.linestrings(places)
    inner = loops[-1]
    at = int(np.flatnonzero(inner.opening)[0])
    # The innermost lap starts where the way in meets it, and stops a wide gap before that.
    ring = inner.rolled((at + 1) % len(inner.points)).points
    ring = np.stack([ring, ring[::-1]])[:, : max(len(ring) - wide + 1, 2)]
    path = [places]
    for number, loop in enumerate(reversed(loops[:-1])):
        lap = _opened_loop(loop, wide)
        heres = ring[:, -1] if number == 0 else path[-1][-1:]
        links = np.array([[here, lip] for here in heres for lip in lap[[0, -1]]])
        across = shapely.intersects(shapely.linestrings(links), way_in)
        best = int(np.lexsort((np.linalg.norm(links[:, 1] - links[:, 0], axis=1), across))[0])
        if number == 0:
            path.append(ring[best // 2])
        path.append(lap if best % 2 == 0 else lap[::-1])
    return np.concatenate(path)


def _smooth(line: FloatArray) -> FloatArray:
    """Line with every point but its ends moved towards the middle of its neighbours, twice."""
    closed = bool((line[0] == line[-1]).all())
    for _ in range(_PASSES):
        ends = line[[-2, 1]] if closed else line[[0, -1]]
        around = np.concatenate([ends[:1], line, ends[1:]])
        moved = 0.25 * (around[:-2] + around[2:]) + 0.5 * line
        line = moved if closed else np.concatenate([line[:1], moved[1:-1], line[-1:]])
    return line
