"""Medial axis of a section: the centres of its largest inscribed discs, as a graph of curves.

It follows from the Voronoi diagram of points along the border (Brandt, Convergence and continuity
criteria for discrete approximations of the continuous planar skeleton, CVGIP 59, 1994). Spurs are
distinguished from limbs by the angle that the nearest border points subtend at the axis, or by the
ratio of the length along the border to its chord.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from scipy.spatial import QhullError, Voronoi, cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, repeated
from ccfem.base.checks import check_number
from ccfem.geometry.facets import connected, facet_keys
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import is_closed, line_length
from ccfem.geometry.shapes import Region

_SAME = 1e-4
"""Distance, as a share of the sampling step, below which points of the axis are the same."""
_NEARER = 1e-3
"""Share by which, due to rounding, another sample may be nearer to a Voronoi vertex."""


@dataclass(frozen=True)
class MedialSegment:
    """A curve of the medial axis between two of its nodes, or a closed one.

    Attributes
    ----------
    points : (m, 2) array, mm
        A closed one repeats its first point; one that meets no other starts where it is widest.
    radius : (m,) array, mm
        Distance of each point to the border.
    left, right : (m - 1, 2) arrays, mm
        Points of the border nearest to the middle of each step, on both sides of the walking
        direction.
    ends : tuple of 2 ints
        Nodes of `MedialAxis` at both ends; twice the same for a closed curve, -1 if it has none.
    """

    points: FloatArray
    radius: FloatArray
    left: FloatArray
    right: FloatArray
    ends: tuple[int, int]

    def __post_init__(self) -> None:
        freeze(self, points=float, radius=float, left=float, right=float)

    @property
    def closed(self) -> bool:
        """Whether the curve is closed."""
        return self.ends[0] == self.ends[1] and is_closed(self.points)

    @property
    def length(self) -> float:
        """Length, mm."""
        return line_length(self.points)


@dataclass(frozen=True)
class MedialAxis:
    """The medial axis of a section: segments between nodes, and their distance to the border.

    Nodes are ends, junctions, and the centres of parts whose axis is a point (discs).
    """

    nodes: FloatArray
    radius: FloatArray
    segments: tuple[MedialSegment, ...]

    def __post_init__(self) -> None:
        freeze(self, nodes=float, radius=float)


def medial_axis(
    section: Region,
    step: float,
    object_angle: float | None = 105.0,
    arc_chord: float | None = None,
    prune: float = 1.0,
) -> MedialAxis:
    """Medial axis of a section.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    step : float, mm
        Largest distance between samples of the border, below the thickness of the part. Both ends
        of every straight side are samples, and the others are equally spaced, so that a symmetric
        section has symmetric samples.
    object_angle : float, degrees, optional
        Ends of the axis are removed while their two nearest border points subtend an angle below
        this; 105 removes the spurs of 90 degree corners. None: no such rule.
    arc_chord : float, optional
        Ends are removed while the border between their two nearest points is no longer than this
        many chords, or than 6 steps; a square corner has 1.41.
    prune : float, default 1
        Branches with a free end that are shorter than this many radii of the disc at their
        junction are removed.

    Returns
    -------
    MedialAxis
        Every part of the section has a segment or a node; a hole stays surrounded by a cycle.
    """
    check_number("step of the medial axis", step, above=0.0, unit="mm")
    border = _Border.of(section, step)
    nothing = MedialAxis(np.zeros((0, 2)), np.zeros(0), ())
    if len(border.points) < 4:
        return nothing
    graph = _Graph.inside(section, border, step)
    if graph is None:
        return nothing
    firm = np.ones(len(graph.edges), dtype=bool)
    if object_angle is not None:
        firm &= graph.seen >= np.radians(object_angle)
    if arc_chord is not None:
        firm &= border.way(*graph.sites.T) > np.maximum(6.0 * step, arc_chord * graph.chord)
    kept = _without_soft_ends(graph.edges, firm, len(graph.points))
    chains = _pruned(graph, _chains(graph.edges, kept, len(graph.points)), prune, step)
    return _as_axis(section, graph, chains)


@dataclass(frozen=True)
class _Border:
    """Samples of the border: ring and arc length of each, and its neighbours on the ring."""

    points: FloatArray
    ring: IntArray
    along: FloatArray
    around: FloatArray
    before: IntArray
    after: IntArray

    @classmethod
    def of(cls, section: Region, step: float) -> "_Border":
        points, ring, along, around, before, after = [], [], [], [], [], []
        start = 0
        for number, line in enumerate(rings(section)):
            a, side = line[:-1], np.diff(line, axis=0)
            size = np.linalg.norm(side, axis=1)
            a, side, size = a[size > 0.0], side[size > 0.0], size[size > 0.0]
            count = np.maximum(np.ceil(size / step - 1e-9), 1.0).astype(np.int64)
            n = int(count.sum())
            if n < 3:
                continue
            edge, part = repeated(count)
            share = part / count[edge]
            here = start + np.arange(n)
            points.append(a[edge] + share[:, None] * side[edge])
            ring.append(np.full(n, number))
            along.append((np.cumsum(size) - size)[edge] + share * size[edge])
            around.append(np.full(n, size.sum()))
            before.append(np.roll(here, 1))
            after.append(np.roll(here, -1))
            start += n
        if not points:
            none = np.zeros(0, dtype=np.int64)
            return cls(np.zeros((0, 2)), none, np.zeros(0), np.zeros(0), none, none)
        return cls(*map(np.concatenate, (points, ring, along, around, before, after)))

    def way(self, one: IntArray, other: IntArray) -> FloatArray:
        """Way along the border between samples, mm; infinite between two rings."""
        gap = np.abs(self.along[one] - self.along[other])
        gap = np.minimum(gap, self.around[one] - gap)
        return np.where(self.ring[one] == self.ring[other], gap, np.inf)

    def foot(self, site: IntArray, points: FloatArray) -> FloatArray:
        """Point of the border nearest to each point, on the two pieces beside a sample."""
        foot_nearest, least = self.points[site], np.full(len(site), np.inf)
        for other in (self.before[site], self.after[site]):
            a, side = self.points[site], self.points[other] - self.points[site]
            t = np.einsum("ij,ij->i", points - a, side) / np.einsum("ij,ij->i", side, side)
            foot = a + np.clip(t, 0.0, 1.0)[:, None] * side
            gap = np.linalg.norm(points - foot, axis=1)
            foot_nearest = np.where((gap < least)[:, None], foot, foot_nearest)
            least = np.minimum(least, gap)
        return foot_nearest


@dataclass(frozen=True)
class _Graph:
    """Voronoi ridges inside the section."""

    points: FloatArray
    radius: FloatArray
    edges: IntArray
    sites: IntArray
    feet: FloatArray
    seen: FloatArray
    chord: FloatArray

    @classmethod
    def inside(cls, section: Region, border: _Border, step: float) -> "_Graph | None":
        try:
            diagram = Voronoi(border.points)
        except QhullError:
            return None
        edges = np.asarray(diagram.ridge_vertices, dtype=np.int64)
        sites = np.asarray(diagram.ridge_points, dtype=np.int64)
        # A copy: prepared geometries must not be shared between threads, but sections may be.
        prepared = shapely.force_2d(section)
        shapely.prepare(prepared)
        inner = shapely.contains_xy(prepared, diagram.vertices)
        nearest = np.zeros(len(inner) + 1, dtype=np.int64)  # the last one is at infinity
        nearest[edges] = sites[:, :1]
        inner &= _equidistant(diagram.vertices, nearest[:-1], border.points, inner)
        if not inner.any():
            return None
        kept = (edges >= 0).all(axis=1) & inner[edges].all(axis=1)
        # From one side of a thin hole to the other.
        ways = shapely.linestrings(diagram.vertices[edges[kept]])
        kept[kept] = shapely.contains(prepared, ways)
        sites, edges = sites[kept], (np.cumsum(inner) - 1)[edges[kept]]
        points, nearest = diagram.vertices[inner], nearest[:-1][inner]
        # Samples on one circle give several vertices at the same place.
        size = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
        tiny = edges[size < _SAME * step]
        place = connected(tiny, len(points))
        _, first = np.unique(place, return_index=True)
        points, nearest = points[first], nearest[first]
        edges = np.sort(place[edges], axis=1)
        _, rows = np.unique(facet_keys(edges)[0], return_index=True)
        rows = rows[edges[rows, 0] != edges[rows, 1]]
        edges, sites = edges[rows], sites[rows]
        middle = points[edges].mean(axis=1)
        feet = np.stack([border.foot(sites[:, k], middle) for k in (0, 1)], axis=1)
        rays = feet - middle[:, None]
        cosine = np.einsum("ij,ij->i", rays[:, 0], rays[:, 1])
        cross = rays[:, 0, 0] * rays[:, 1, 1] - rays[:, 0, 1] * rays[:, 1, 0]
        radius = np.linalg.norm(points - border.foot(nearest, points), axis=1)
        seen = np.abs(np.arctan2(cross, cosine))
        chord = np.linalg.norm(feet[:, 0] - feet[:, 1], axis=1)
        return cls(points, radius, edges, sites, feet, seen, chord)


def _equidistant(
    vertices: FloatArray, nearest: IntArray, sites: FloatArray, wanted: BoolArray
) -> BoolArray:
    """Which wanted Voronoi vertices have no site nearer than their own.

    Qhull places undetermined vertices, of collinear sites, at (-10.101, -10.101).
    """
    on_axis = np.zeros(len(vertices), dtype=bool)
    least, _ = cKDTree(sites).query(vertices[wanted])
    distance = np.linalg.norm(vertices[wanted] - sites[nearest[wanted]], axis=1)
    on_axis[wanted] = distance <= (1.0 + _NEARER) * least
    return on_axis


def _without_soft_ends(edges: IntArray, firm: BoolArray, count: int) -> BoolArray:
    """Edges that remain when free ends that are not firm are removed repeatedly."""
    kept = np.ones(len(edges), dtype=bool)
    while True:
        degree = np.bincount(edges[kept].ravel(), minlength=count)
        off = kept & ~firm & (degree[edges] == 1).any(axis=1)
        if not off.any():
            return kept
        kept &= ~off


def _chains(edges: IntArray, kept: BoolArray, count: int) -> list[list[int]]:
    """Chains of nodes between ends and junctions of kept edges; closed ones repeat their first."""
    beside: dict[int, list[int]] = {}
    for a, b in edges[kept].tolist():
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    for others in beside.values():
        others.sort()
    seen: set[tuple[int, int]] = set()
    chains = []
    # Ends and junctions first; what is left are closed chains.
    for first in sorted(beside, key=lambda node: (len(beside[node]) == 2, node)):
        for second in beside[first]:
            if (first, second) in seen:
                continue
            chain = [first, second]
            while len(beside[chain[-1]]) == 2 and chain[-1] != first:
                a, b = beside[chain[-1]]
                chain.append(b if a == chain[-2] else a)
            for a, b in pairwise(chain):
                seen |= {(a, b), (b, a)}
            chains.append(chain)
    return chains


def _pruned(graph: _Graph, chains: list[list[int]], prune: float, step: float) -> list[list[int]]:
    """Chains without short branches at free ends, shortest first, and without specks."""
    while True:
        degree = Counter(end for chain in chains for end in (chain[0], chain[-1]))
        short = []
        for number, chain in enumerate(chains):
            free = [degree[end] == 1 for end in (chain[0], chain[-1])]
            if not any(free):
                continue
            length = line_length(graph.points[chain])
            # A chain by itself is a speck below a step and a tenth of its radius; a branch is short
            # against the radius where it begins.
            if all(free):
                least = min(step, 0.1 * float(graph.radius[chain].max()))
            else:
                least = prune * float(graph.radius[chain[-1] if free[0] else chain[0]])
            if length < least:
                short.append((length, number))
        if not short:
            return chains
        del chains[min(short)[1]]
        pairs = [pair for chain in chains for pair in pairwise(chain)]
        edges = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        chains = _chains(edges, np.ones(len(edges), dtype=bool), len(graph.points))


def _from_widest(chain: list[int], radius: FloatArray) -> list[int]:
    """Return a closed chain that starts at its place of largest radius."""
    widest = int(np.argmax(np.round(radius[chain[:-1]], 6)))
    return [*chain[widest:-1], *chain[: widest + 1]]


def _as_axis(section: Region, graph: _Graph, chains: list[list[int]]) -> MedialAxis:
    """Values of the chains, and a node for every part of the section without one."""
    ends = {end for chain in chains if chain[0] != chain[-1] for end in (chain[0], chain[-1])}
    starts = shapely.points(graph.points[[chain[0] for chain in chains]])
    for part in shapely.get_parts(section):
        shapely.prepare(part)
        if not shapely.contains(part, starts).any():
            members = np.flatnonzero(shapely.contains_xy(part, graph.points))
            if len(members):
                ends.add(int(members[np.argmax(graph.radius[members])]))
    nodes = sorted(ends)
    index = {node: k for k, node in enumerate(nodes)}
    edge_of = {(a, b): k for k, (a, b) in enumerate(graph.edges.tolist())}
    segments = []
    for chain in chains:
        if chain[0] == chain[-1] and chain[0] not in index:
            chain = _from_widest(chain, graph.radius)
        places = graph.points[chain]
        rows = [edge_of[(min(p, q), max(p, q))] for p, q in pairwise(chain)]
        feet, along = graph.feet[rows], np.diff(places, axis=0)
        aside = feet[:, 0] - 0.5 * (places[1:] + places[:-1])
        swapped = along[:, 0] * aside[:, 1] - along[:, 1] * aside[:, 0] < 0.0
        left = np.where(swapped[:, None], feet[:, 1], feet[:, 0])
        right = np.where(swapped[:, None], feet[:, 0], feet[:, 1])
        both = (index.get(chain[0], -1), index.get(chain[-1], -1))
        segments.append(MedialSegment(places, graph.radius[chain], left, right, both))
    order = sorted(range(len(segments)), key=lambda k: -segments[k].length)
    return MedialAxis(graph.points[nodes], graph.radius[nodes], tuple(segments[k] for k in order))
