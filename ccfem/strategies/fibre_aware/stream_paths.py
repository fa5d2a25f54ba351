"""Paths along the levels of designed fields, of which the stretches worth most are kept."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise, product
from typing import Any, cast

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.parallel import in_processes
from ccfem.body.mesh import TetMesh
from ccfem.geometry.isocontours import isocontours, triangle_edges
from ccfem.geometry.polylines import line_length
from ccfem.geometry.shapes import Region
from ccfem.judging.virtual_testing import cut_strands
from ccfem.judging.virtual_testing.equilibrium import bars
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import Chart, flat_view
from ccfem.paths.linking.finishing import (
    keep_off_border,
    linked_paths,
    long_enough,
    parts_inside,
    trim_to_clearance,
)
from ccfem.paths.linking.joining import Joined
from ccfem.paths.planning.alike import on_layer
from ccfem.paths.planning.unfolding import unfolded, unfolded_paths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.heights import LARGE_CELLS, layers_of_one_kind, middle
from ccfem.strategies.fibre_aware.hole_wraps import LEVELS, led_round_holes
from ccfem.strategies.fibre_aware.path_profile import Profile, least_price
from ccfem.strategies.fibre_aware.prune import profiles
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.strand_lines import strand_lines
from ccfem.strategies.fibre_aware.strand_spacing import spacing
from ccfem.strategies.fibre_aware.worth_links import link_by_worth

CLEARANCE = 0.95
"""Least distance between strands before linking, in widths. They are designed 1 / 0.975 apart and
slide apart later: what a cut for some hundredths of a width removes would be lost."""

SHORTEST = 5.0
"""Length, in strand widths, of the shortest pieces kept for linking."""

_CUT_COST = 20.0
"""Length, mm, of the least valuable fibre that another cut has to save to be made."""

_NEAR = 0.06
"""Share below the largest value up to which other positions of the levels are tried as well."""

_REACHES = (0.5, 1.0)
"""Shares of the longest link up to which the links worth most are searched for."""

_BETTER = 0.003
"""Share by which paths with such links have to be worth more to be tried."""

_SAME = 0.5
"""Distance, in strand widths, up to which the borders of two sections count as the same. The levels
that are best for one layer are then used for the other."""


@dataclass(frozen=True)
class Extraction:
    """Paths from designed fields.

    Attributes
    ----------
    fields : tuple of (c,) arrays
        Coefficients of the fields on the grid; unit levels are paths.
    mesh : TetMesh
        Of linear cells.
    strains_of : sequence of (float, (n, 3) array)
        Worth of a squared strain, and the displacement, mm, that strains the paths; one pair for
        each load case.
    phases : int
        Number of positions of the levels that are tried; layers of the same section share the best.
        One position is at whole numbers of the field.
    inset, link_limit : float
        Least distance from the boundary, and largest distance of linked ends, in strand widths.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none.
    charts : mapping of int to Chart, default {}
        Where layers are curved, of all by `Layer.index`: paths are drawn in the plane of the chart.
    """

    fields: tuple[FloatArray, ...]
    grid: SplineGrid
    mesh: TetMesh
    strains_of: Sequence[tuple[float, FloatArray]]
    machine: Machine
    phases: int
    inset: float
    link_limit: float
    radius: float = 0.0
    charts: Mapping[int, Chart] = field(default_factory=dict)

    @property
    def few(self) -> bool:
        """Whether tests take so long that only the position that seems best is given, as it is."""
        flat = not self.charts and not self.radius
        return flat and len(self.strains_of) == 1 and len(self.mesh.cells) > LARGE_CELLS

    def candidates(
        self, layers: Sequence[Layer], group: IntArray, lengths: Sequence[float]
    ) -> list[list[Toolpaths]]:
        """Paths of all layers, uncut, at those positions of the levels that may be best.

        The strains of the design say only roughly which positions are worth most. Others are given
        too if they are worth hardly less, and so are whole numbers, which were drawn to the border.
        The best position is given once more with the links that are worth most, if these paths are
        worth more. On large flat parts under one load (`few`) that position is the only one.

        Parameters
        ----------
        group : (layers,) int array
            Number of the field of each layer.
        lengths : sequence of float, mm
            In all layers.

        Returns
        -------
        list of list of Toolpaths
            For each length; the paths worth most first.
        """
        drawings = _Drawings(self, layers, group)
        alike = drawings.alike
        stand_ins = list(map(middle, alike))
        counts = [len(numbers) for numbers in alike]
        # Leading strands round holes takes most of the time, and does not tell positions apart.
        drawings.draw("rough", list(product(stand_ins, range(self.phases))))
        tried = [[drawings.rough(k, phase) for phase in range(self.phases)] for k in stand_ins]
        prices = [self._price(tried, counts, length) for length in lengths]
        shifts = [self.best_phases(tried, counts, price) for price in prices]
        if self.few:
            best = [(some[0], 0.0) for some in shifts]
            drawn = drawings.planned(set(best))
            return [[drawn[way]] for way in best]
        whole = len(alike) * (0,)  # drawn to the border: they may only lack links worth most
        linked = [dict.fromkeys((some[0], whole)) for some in shifts]
        pairs = {
            pair
            for some in linked
            for phases in some
            for pair in zip(stand_ins, phases, strict=True)
        }
        drawings.draw("with_links", sorted(pairs))

        def gain(phases: tuple[int, ...], reach: float, price: float) -> float:
            return sum(
                count * self._gain(drawings.worth(k, phase, reach), price)
                for k, count, phase in zip(stand_ins, counts, phases, strict=True)
            )

        chosen: list[list[tuple[tuple[int, ...], float]]] = []
        for some, two, price in zip(shifts, linked, prices, strict=True):
            chosen.append([(phases, 0.0) for phases in some])
            ways = list(product(two, _REACHES))
            gains = [gain(phases, reach, price) for phases, reach in ways]
            if max(gains) > (1.0 + _BETTER) * gain(some[0], 0.0, price):
                chosen[-1].append(ways[int(np.argmax(gains))])
        planned = drawings.planned({way for some in chosen for way in some})
        return [[planned[way] for way in some] for some in chosen]

    def best_phases(
        self, tried: list[list[list[Profile]]], counts: Sequence[int], price: float
    ) -> list[tuple[int, ...]]:
        """Position of the levels worth most for each kind of layer, and others close to it.

        Parameters
        ----------
        tried : list of list of list of Profile
            Of one layer of each kind at each position of the levels.
        counts : sequence of int
            Layers of each kind.
        price : float
            Of fibre.
        """
        gains = np.array(
            [[self._gain(along, price) for along in profiles] for profiles in tried], dtype=float
        )
        first, rows = gains.argmax(axis=1), np.arange(len(gains))
        others = gains.copy()
        others[rows, first] = -np.inf
        second = others.argmax(axis=1)
        near = others[rows, second] >= (1.0 - _NEAR) * gains[rows, first]
        candidates = [first, np.zeros_like(first), np.where(near, second, first)]
        if self.radius:  # only the test shows which bends can stay
            candidates += [np.full_like(first, phase) for phase in range(self.phases)]
        return list(dict.fromkeys(tuple(phases.tolist()) for phases in candidates))

    def _price(
        self, tried: list[list[list[Profile]]], counts: Sequence[int], length: float
    ) -> float:
        """Price of fibre at which a length is worth keeping, at the middle position of levels."""
        central = [one[self.phases // 2] for one in tried]
        along = [p for one, count in zip(central, counts, strict=True) for p in count * one]
        return least_price(along, length, self.machine.shortest_strand, _CUT_COST) if along else 0.0

    def _gain(self, along: list[Profile], price: float) -> float:
        """Return the worth of fibre beyond its price."""
        minimum = self.machine.shortest_strand
        return sum(profile.kept(price, minimum, _CUT_COST)[1] for profile in along)

    def layer_paths(self, layer: Layer, field: FloatArray, shift: float) -> Toolpaths:
        """Paths of one layer along the levels `shift` above whole numbers."""
        lines, _ = self.round_holes(self.strands(layer, field, shift), layer)
        return self.linked(layer, lines)

    def strands(self, layer: Layer, field: FloatArray, shift: float) -> list[FloatArray]:
        """Trace the levels, and cut strands that can slide neither off the border nor apart."""
        width = self.machine.fibre_width
        lines = self.unfolded(self.levels(layer, field, shift), layer)
        lines = lines_to_slide_in(lines, layer.plane.polygon, self.inset * width)
        return trim_to_clearance(lines, CLEARANCE * width, SHORTEST * width)

    def round_holes(
        self, lines: list[FloatArray], layer: Layer, tried: range = range(1, LEVELS + 1)
    ) -> tuple[list[FloatArray], int]:
        """Lead strands that end at the wall of a hole round it, as many as there is room for.

        Of none and the numbers tried on each side, take what leaves most in printable strands:
        these lines (n_i, 2), and their number on each side.
        """
        machine, section = self.machine, layer.plane.polygon
        width = machine.fibre_width

        def printable(strands: list[FloatArray]) -> float:
            sizes = [line_length(line) for line in strands]
            return sum(size for size in sizes if size >= machine.shortest_strand)

        best, number, count = lines, 0, len(lines)
        for levels in tried if tried.start else ():
            led = led_round_holes(lines, section, width, 0.75 * machine.minimum_radius, levels)
            if len(led) == count:
                break  # no further strand to be led round
            count = len(led)
            paths = Toolpaths.from_plane(led, layer)
            paths = slid_out(paths, layer, machine, self.inset, levels, self.radius)
            room = [layer.plane.project(path) for path in paths]
            room = lines_to_slide_in(room, section, self.inset * width)
            room = trim_to_clearance(room, CLEARANCE * width, SHORTEST * width)
            if printable(room) > printable(best):
                best, number = room, levels
        return best, number

    def linked(self, layer: Layer, lines: list[FloatArray], reach: float = 0.0) -> Toolpaths:
        """Link the strands of one layer, and slide the paths inwards.

        Links are the shortest; with a `reach` they are those worth most (`worth_links`), up to that
        share of the longest link.
        """
        width, section = self.machine.fibre_width, layer.plane.polygon
        limit, least = self.link_limit * width, self.machine.shortest_strand
        radius = self.machine.minimum_radius
        if reach:
            worth = partial(self._worth, layer)
            joined = link_by_worth(lines, section, reach * limit, width, radius, least, worth)
            joined = long_enough(joined, least)
        else:
            joined = linked_paths(lines, section, width, limit, least, radius=radius)
        paths = Toolpaths.from_plane(joined.lines, layer, link=joined.link)
        paths = slid_in(paths, layer, self.machine, self.inset, self.radius)
        return unfolded_paths(paths, layer, self.machine)

    def unfolded(self, lines: list[FloatArray], layer: Layer) -> list[FloatArray]:
        """Lines led round their folds or cut there, before they are linked."""
        link = [np.zeros(len(line), dtype=bool) for line in lines]
        least = SHORTEST * self.machine.fibre_width
        return unfolded(Joined(lines, link), layer.plane.polygon, self.machine, least).lines

    def levels(self, layer: Layer, field: FloatArray, shift: float) -> list[FloatArray]:
        """Trace the levels `shift` above whole numbers on a layer, (n, 2), mm."""
        points, triangles = refined(layer)
        chart = self.charts.get(layer.index)
        places = points if chart is None else refined(chart.layer, in_space=True)[0]
        values = self.grid.values(places) @ field
        first = float(np.ceil(values.min() - shift)) + shift
        return isocontours(points, triangles, values, first, 1.0).lines()

    def _worth(self, layer: Layer, lines: Sequence[FloatArray]) -> list[Profile]:
        """Profiles of lines on a layer, each starting at its first point."""
        closed = len(lines) * [False]
        return self.profiles(Toolpaths.from_plane(lines, layer, closed), layer)

    def on_part(self, paths: Toolpaths, layer: Layer) -> Toolpaths:
        """Paths of a layer where they lie on the part."""
        chart = self.charts.get(layer.index)
        return paths if chart is None else chart.lifted(paths)

    def profiles(self, paths: Toolpaths, layer: Layer) -> list[Profile]:
        """Value of the paths of a layer at the strains of the designed part."""
        if not len(paths):
            return []
        toolpaths = self.on_part(paths, layer)
        strands = cut_strands(toolpaths, self.mesh)
        pieces = bars(strands, self.mesh)
        value = np.zeros(len(strands.length))
        for worth, displacement in self.strains_of:
            value += worth * np.maximum(pieces.strain(displacement), 0.0) ** 2
        return profiles(toolpaths, strands, value)


class _Drawings:
    """Paths of layers at positions of the levels, each drawn once, and several at a time.

    Layers of equal section share their strands; of others that are alike the middle one says how
    many strands are led round holes.
    """

    def __init__(self, extraction: Extraction, layers: Sequence[Layer], group: IntArray) -> None:
        self.alike = layers_of_one_kind(layers, group, _SAME * extraction.machine.fibre_width)
        self._extraction, self._group = extraction, group
        self._layers = list(map(flat_view, layers))
        self._kind = {int(k): middle(numbers) for numbers in self.alike for k in numbers}
        equal = layers_of_one_kind(layers, group)
        self._source = {int(k): middle(numbers) for numbers in equal for k in numbers}
        self._strands: dict[tuple[int, int], list[FloatArray]] = {}
        self._rough: dict[tuple[int, int], list[Profile]] = {}
        self._led: dict[tuple[int, int], tuple[list[FloatArray], int]] = {}
        self._paths: dict[tuple[int, int, float], Toolpaths] = {}
        self._worth: dict[tuple[int, int, float], list[Profile]] = {}

    def draw(self, what: str, keys: Sequence[tuple[Any, ...]]) -> None:
        """Draw in processes what a method gives for several arguments."""
        drawn_so_far = (self._strands, self._rough, self._led, self._paths, self._worth)
        caches = cast(tuple[dict[Any, Any], ...], drawn_so_far)

        def drawn(*key: Any) -> list[dict[Any, Any]]:
            getattr(self, what)(*key)
            return [dict(cache) for cache in caches]

        for filled in in_processes(drawn, *zip(*keys, strict=True), shared=[self]):
            for cache, more in zip(caches, filled, strict=True):
                cache.update(more)

    def strands(self, number: int, phase: int) -> list[FloatArray]:
        """Strands of a layer, not led round holes."""
        number = self._source[number]
        if (number, phase) not in self._strands:
            extraction, layer = self._extraction, self._layers[number]
            field = extraction.fields[self._group[number]]
            lines = extraction.strands(layer, field, phase / extraction.phases)
            self._strands[number, phase] = lines
        return self._strands[number, phase]

    def rough(self, number: int, phase: int) -> list[Profile]:
        """Worth of the paths of a layer, not led round holes."""
        if (number, phase) not in self._rough:
            paths = self._extraction.linked(self._layers[number], self.strands(number, phase))
            self._rough[number, phase] = self._extraction.profiles(paths, self._layers[number])
        return self._rough[number, phase]

    def led(self, number: int, phase: int) -> tuple[list[FloatArray], int]:
        """Strands led round holes, and how many on each side of a hole."""
        number = self._source[number]
        if (number, phase) not in self._led:
            tried, first = range(1, LEVELS + 1), self._source[self._kind[number]]
            if number != first:
                count = self.led(first, phase)[1]
                tried = range(count, count + 1)
            lines, layer = self.strands(number, phase), self._layers[number]
            self._led[number, phase] = self._extraction.round_holes(lines, layer, tried)
        return self._led[number, phase]

    def paths(self, number: int, phase: int, reach: float = 0.0) -> Toolpaths:
        """Paths of a layer, linked as `Extraction.linked` does."""
        key, source = (number, phase, reach), self._source[number]
        if key not in self._paths:
            layer = self._layers[number]
            if not reach and number != source:
                self._paths[key] = on_layer(self.paths(source, phase), layer)
            else:  # what links are worth differs from layer to layer
                lines, _ = self.led(number, phase)
                self._paths[key] = self._extraction.linked(layer, lines, reach)
        return self._paths[key]

    def worth(self, number: int, phase: int, reach: float) -> list[Profile]:
        """Worth of the paths of a layer."""
        key = number, phase, reach
        if key not in self._worth:
            self._worth[key] = self._extraction.profiles(self.paths(*key), self._layers[number])
        return self._worth[key]

    def with_links(self, number: int, phase: int) -> None:
        """Draw the paths of a layer with all links."""
        for reach in (0.0, *_REACHES):
            self.worth(number, phase, reach)

    def planned(
        self, ways: Collection[tuple[tuple[int, ...], float]]
    ) -> dict[tuple[tuple[int, ...], float], Toolpaths]:
        """Paths of all layers for positions of each kind of layer and a reach of links."""
        positions = {
            (phases, reach): [
                (k, phase, reach)
                for numbers, phase in zip(self.alike, phases, strict=True)
                for k in numbers.tolist()
            ]
            for phases, reach in ways
        }
        keys = {key for some in positions.values() for key in some}
        firsts = {(self._source[self._kind[k]], phase) for k, phase, _ in keys}
        self.draw("led", sorted(firsts))
        alone = {(k if reach else self._source[k], phase, reach) for k, phase, reach in keys}
        self.draw("paths", sorted(alone - self._paths.keys()))
        return {
            way: Toolpaths.concatenate(
                self._extraction.on_part(self.paths(*key), self._layers[key[0]])
                for key in sorted(some)
            )
            for way, some in positions.items()
        }


def refined(layer: Layer, in_space: bool = False) -> tuple[FloatArray, IntArray]:
    """Points and triangles (t, 3) of a layer, each triangle cut in four.

    Points are (n, 2) in the plane of a flat layer, or (n, 3) in space, in the same order.
    """
    points, corners = layer.points if in_space else layer.plane.points, layer.triangles
    edges, opposite = triangle_edges(corners)
    a, b, c = corners.T
    x, y, z = opposite.T + len(points)
    four = [np.stack(three, axis=1) for three in ((a, z, y), (z, b, x), (y, x, c), (x, y, z))]
    middle = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    return np.concatenate([points, middle]), np.concatenate(four)


# Strands beside the border, slid inwards until they keep their distance from it.
#
# If a strand comes too near the border at a small angle, cutting it would remove a long stretch
# where the stress is highest. Instead the strand slides inwards. Its neighbours give way, and so do
# links that go round a hole or along an edge.


_DEPTH = 0.8
"""Share of the distance from the border below which lines are cut; the rest of them slides in."""

_ROUNDS = 2
"""Number of slides, each along the normals of the paths after the last one."""

_OUT = 0.25
"""Steps, in widths, in which strands are slid out of holes: the way out changes as they go."""

_ON_THE_WAY = 2
"""Rounds of such a step; the last one has as many as any slide."""

_INNER, _APART = 1.01, 1.004
"""Factors on the distances that slides aim at: from the border, and between strands. A slide only
approaches its aim, and the steps between points cut corners."""


def lines_to_slide_in(
    lines: Sequence[FloatArray], section: Region, inset: float
) -> list[FloatArray]:
    """Parts of lines that `slid_in` can bring to a given distance from the border of a section.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    inset : float >= 0, mm

    Returns
    -------
    list of (n_i, 2) arrays
        Parts at least 0.8 times the distance off the border. Ends that run onto the border are cut
        at the full distance, since sideways slides do not move them inwards.
    """
    if inset == 0.0:
        return list(lines)
    slid_in, room = [], shapely.buffer(section, -inset)
    for line in keep_off_border(lines, section, _DEPTH * inset):
        kept = parts_inside([line], room)
        cut = len(kept) == 1 and line_length(line) - line_length(kept[0]) < inset
        slid_in.append(kept[0] if cut else line)
    return slid_in


def slid_in(
    paths: Toolpaths, layer: Layer, machine: Machine, inset: float, radius: float = 0.0
) -> Toolpaths:
    """Slide paths inwards where they are too near the border, and slide strands apart.

    Parameters
    ----------
    paths : Toolpaths
        On one flat layer.
    inset : float
        Least distance from the border, in strand widths.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none.

    Returns
    -------
    Toolpaths
        Paths in even steps between corners. Ends that are still too near the border are cut.
        Elsewhere strands stay too near where there is no room.
    """
    width = machine.fibre_width
    if not len(paths):
        return paths
    off = _INNER * inset * width
    lines = strand_lines(paths, (layer,), machine, hold=False)
    apart = spacing(lines, (layer,), _APART * width, off, come_in=True, radius=radius)
    for after in range(_ROUNDS):
        if after:
            lines = strand_lines(paths, (layer,), machine, hold=False)
            apart = apart.for_lines(lines, off)
        paths = lines.slid(apart.spread(np.zeros(len(lines.path))))
    return _ends_cut(_back_inside(paths, layer), layer, inset * width, machine)


def slid_out(
    paths: Toolpaths, layer: Layer, machine: Machine, inset: float, depth: float, radius: float
) -> Toolpaths:
    """Slide paths that are led through holes out of them, in small steps, and others ahead of them.

    Parameters as of `slid_in`; `depth` is how far inside a hole paths lie, in strand widths.
    """
    width, off = machine.fibre_width, _INNER * inset
    steps = np.arange(off - depth - 1.0, off, _OUT)
    lines = strand_lines(paths, (layer,), machine, hold=False)
    apart = spacing(lines, (layer,), _APART * width, off, come_in=True, radius=radius)
    for step in steps:
        slide = apart.for_lines(lines, step * width).spread(np.zeros(len(lines.path)), _ON_THE_WAY)
        lines = strand_lines(lines.slid(slide), (layer,), machine, hold=False)
    return lines.slid(apart.for_lines(lines, off * width).spread(np.zeros(len(lines.path))))


def _back_inside(paths: Toolpaths, layer: Layer) -> Toolpaths:
    """Paths with points that neighbours have pushed over the border moved back onto it."""
    section, frame = layer.plane.polygon, layer.plane.frame[:2]
    places = paths.points @ frame.T
    shapely.prepare(section)
    out = np.flatnonzero(~shapely.intersects_xy(section, places))
    ways = shapely.shortest_line(shapely.points(places[out]), shapely.boundary(section))
    steps = np.diff(shapely.get_coordinates(ways).reshape(-1, 2, 2), axis=1)[:, 0]
    points = paths.points.copy()
    points[out] += steps @ frame
    return replace(paths, points=points)


def _ends_cut(paths: Toolpaths, layer: Layer, inset: float, machine: Machine) -> Toolpaths:
    """Paths without ends that are too near the border, where the rest is long enough."""
    border = shapely.boundary(layer.plane.polygon)
    shapely.prepare(border)
    plane = paths.points @ layer.plane.frame[:2].T

    def missing(some: slice | IntArray) -> FloatArray:
        return np.asarray(inset - shapely.distance(shapely.points(plane[some]), border))

    ends = np.stack([paths.offsets[:-1], paths.offsets[1:] - 1], axis=1)
    near = (missing(ends.ravel()).reshape(-1, 2) > 0.0).any(axis=1) & ~paths.closed
    if not near.any():
        return paths
    left = paths.lengths - np.minimum(paths.lengths, machine.shortest_strand)
    cut = []
    for k, (first, end) in enumerate(pairwise(paths.offsets)):
        points, link = paths.points[first:end], paths.link[first:end]
        short = missing(slice(first, end)) if near[k] else np.zeros(len(points))
        for _ in range(2 * int(near[k])):  # one end, then the other
            points, link, short = points[::-1], np.roll(link[::-1], -1), short[::-1]
            number = int(np.argmax(short <= 0.0))
            if number == 0:
                continue
            share = short[number] / (short[number] - short[number - 1])
            place = points[number] + share * (points[number - 1] - points[number])
            off = line_length(np.concatenate([points[:number], place[None]]))
            if off <= min(left[k], 2.0 * machine.fibre_width):
                left[k] -= off
                points = np.concatenate([place[None], points[number:]])
                link, short = link[number - 1 :], np.concatenate([[0.0], short[number:]])
        cut.append((points, link))
    counts = [len(points) for points, _ in cut]
    normals = np.repeat(paths.normals[paths.offsets[:-1]], counts, axis=0)
    return replace(
        paths,
        points=np.concatenate([points for points, _ in cut]),
        normals=normals,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        link=np.concatenate([link for _, link in cut]),
    )
