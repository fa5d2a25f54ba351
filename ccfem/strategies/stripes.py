"""Dense strands along the tension: stripe patterns of a line field, on flat and curved layers.

T. Zhang, T. Liu, N. Dutta, Y. Chen, R. Su, Z. Zhang, W. Wang, C. C. L. Wang, Toolpath generation
for high density spatial fiber printing guided by principal stresses, Composites Part B 295 (2025)
112154, lay strands along the phases of a field that follows a direction without a sign. The pattern
is that of F. Knoeppel, K. Crane, U. Pinkall, P. Schroeder, Stripe patterns on surfaces, ACM
Transactions on Graphics 34 (2015) 39. That every strand can be cut, what is joined and moved for
that, and the amount are ours.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.parallel import in_processes
from ccfem.base.tensor import in_plane
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.facets import are_among, connected
from ccfem.geometry.polylines import line_length, pack, starts_segment
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.linking.finishing import keep_off_border, long_enough, trim_to_clearance
from ccfem.paths.linking.joining import Joined, join
from ccfem.paths.planning.infill import Turns, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.planning.unfolding import unfolded
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, stress_on
from ccfem.strategies.stripe_pattern.pattern import (
    Cells,
    isocurves,
    line_field,
    refined,
    stripe_pattern,
)
from ccfem.strategies.stripe_pattern.strand_packing import (
    PUSHES,
    corners,
    even_points,
    evened,
    joined_ends,
    stepped_over,
    strands_in_rest,
    with_detours,
)

_EDGE = 0.9
"""Longest edge of the triangles of the pattern, in widths."""
_INSET = 0.1
"""Distance from the border, in widths, at which curves are cut before they are moved off it."""
_TRIM = 0.6
"""Distance, in widths, from a longer curve below which a curve is cut before they are moved."""
_PIECE = 1.5
"""Shortest curve, in widths, that may be joined to others."""
_NEARLY = 0.9
"""Share of the shortest length that a strand must have before strands move."""
_END = 0.4
"""Distance that strands keep from the border at last, in widths: half a width but for corners."""
_CHARTED = 1.03
"""Shortest strand in the chart of a curved layer, over the machine's: charts change lengths."""
_FOLDING = 0.36, 1.024
"""Factors, where strands may fold, on the lengths of smoothing, and on the pitch: with none of them
left out, nothing gives way."""
_FITTING = 12
"""Rounds of pushes in which strands of another layer move to where there is room."""
_HALVINGS = 40


@dataclass(frozen=True)
class Stripes:
    """Strands side by side along the largest tension; they end and begin where it converges.

    The direction of the largest tension has no sign. Where it is not decisive, or where there is no
    tension, strands follow their neighbours and the free border.

    Attributes
    ----------
    density : float in (0, 1], default 1
        Fibre to lay, as a share of all that the strategy lays side by side. With less, each strand
        keeps the stretch that carries most.
    pitch : float, default 0.98
        Distance of the curves in fibre widths before they are moved apart to a width.
    smooth : float, default 5
        Length over which the direction is smoothed, in fibre widths.
    border : float, default 10
        How far the border turns strands along itself, in fibre widths.
    tries : int, default 1
        Number of patterns that are tried for each layer; the one that carries most is taken.
    folds : bool, default False
        Whether strands that are too short are joined to their neighbours by links in which they
        fold (`ccfem.paths.folds`). More of the layer is then covered, closer to the tension:
        `smooth` and `border` count 0.36 times, `pitch` 1.024 times.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    """

    density: float = 1.0
    pitch: float = 0.98
    smooth: float = 5.0
    border: float = 10.0
    tries: int = 1
    folds: bool = False
    turns: Turns = "tight"

    amount: ClassVar[Amount] = Amount("density", most=1.0, least=0.05)
    in_plane: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "half": {"density": 0.5},
        "folds": {"folds": True},
        "best": {"tries": 2, "turns": "cut"},
    }

    def __post_init__(self) -> None:
        check_choices(self)
        check_fields(self, "density", above=0.0, at_most=1.0)
        check_fields(self, "pitch", at_least=0.8, unit="fibre widths")
        check_fields(self, "smooth", above=0.0, unit="fibre widths")
        check_fields(self, "border", at_least=0.0, unit="fibre widths")
        check_fields(self, "tries", at_least=1)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Plan all layers side by side, and choose what is laid of each strand."""
        full = replace(self, density=1.0)
        # The layers are kept, so that no other layer can get the same id.
        key = (full, machine, tuple(map(id, layers)))
        known: dict[Any, Any] = vars(stress).setdefault("stripes", {})
        if key not in known:

            def planned(layer: Layer) -> list[_Strand]:
                return full.strands(layer, stress_on(layer, stress), machine)

            known[key] = layers, list(in_processes(planned, layers, shared=[stress]))
        _, strands = known[key]
        if self.density < 1.0:
            every = [strand for some in strands for strand in some]
            least = max((_least(layer, machine) for layer in layers), default=0.0)
            level = _level(every, self.density, least)
            strands = [_kept(some, level, least) for some in strands]
        by_layer = {
            layer.index: Joined([one.line for one in some], [one.link for one in some])
            for layer, some in zip(layers, strands, strict=True)
        }
        return _Planner(self, by_layer)

    def strands(self, layer: Layer, stress: LayerStress, machine: Machine) -> "list[_Strand]":
        """Strands of one layer side by side, with the tension along them."""
        plane = in_plane(stress.nodal, layer.plane.frame)
        flags = _crossed_border(layer, stress.held_or_loaded)
        width = machine.fibre_width
        points, triangles, values = refined(
            layer.plane.points,
            layer.triangles,
            np.column_stack([plane, flags]),
            _EDGE * width,
        )
        cells = Cells(points, triangles)
        free = cells.border & (values[cells.edges, 3].min(axis=1) < 1.0 - 1e-6)
        # Strands that may fold may be short, and keep to the tension and to the border.
        closer, wider = _FOLDING if self.folds else (1.0, 1.0)
        rim, reach = free if self.folds else None, closer * width
        angle = line_field(cells, values[:, :3], free, self.smooth * reach, self.border * reach)
        best: list[_Strand] = []
        for seed in range(self.tries):
            pattern = stripe_pattern(cells, angle, wider * self.pitch * width, seed, rim)
            joined = _packed(isocurves(pattern), layer, machine, self.folds)
            strands = _carrying(joined, layer, plane)
            if not best or _carried(strands) > _carried(best):
                best = strands
        return best

    def taken_over(
        self, paths: Toolpaths, source: Layer, layer: Layer, machine: Machine
    ) -> Toolpaths:
        """Strands of a flat layer on another of about its section, moved to where that has room.

        Without folds; in a twentieth of the time of strands of its own.
        """
        width = machine.fibre_width
        lines = even_points([source.plane.project(path) for path in paths], width)
        joined = _settled(lines, layer, machine, rounds=_FITTING)
        return Toolpaths.from_plane(joined.lines, layer, link=joined.link)


@dataclass(frozen=True)
class _Planner:
    """Strands of all layers, by `Layer.index`."""

    strategy: Stripes
    joined: Mapping[int, Joined]

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        lines, link = self.joined[layer.index]
        joined = with_turns(self.strategy, lines, machine, link)
        return Toolpaths.from_plane(joined.lines, layer, link=joined.link)


def _least(layer: Layer, machine: Machine) -> float:
    """Length of the shortest strand in the plane of a layer, mm: more in charts of curved ones."""
    return machine.shortest_strand * (1.0 if layer.turns is None else _CHARTED)


def _crossed_border(layer: Layer, patches: Sequence[str]) -> FloatArray:
    """1 at points on outer borders that are held or loaded, (n,): strands may end there."""
    flags = np.zeros(len(layer.points))
    named = [layer.patches[name] for name in patches if len(layer.patches.get(name, ()))]
    if named:
        edges = np.concatenate(named)
        for loop in layer.loops:
            if len(loop) > 2 and shapely.LinearRing(layer.plane.points[loop]).is_ccw:
                sides = np.column_stack([loop, np.roll(loop, -1)])
                flags[sides[are_among(sides, edges)]] = 1.0
    return flags


def _packed(
    curves: list[FloatArray], layer: Layer, machine: Machine, folds: bool = False
) -> Joined:
    """Strands side by side, long enough for the cutter, made of curves."""
    section, width, least = layer.plane.polygon, machine.fibre_width, _least(layer, machine)
    lines = keep_off_border(curves, section, _INSET * width)
    lines = trim_to_clearance(even_points(lines, width), _TRIM * width, _PIECE * width)
    lines = even_points(joined_ends(even_points(lines, width), width), width)
    lines = stepped_over(lines, section, width, least)
    lines = even_points(joined_ends(lines, width), width)
    # What stays too short makes room for the others.
    joined = _settled(_long_chains(lines, width, _NEARLY * least, folds), layer, machine, folds)
    # Where no strand turns any more, straight ones may still fit.
    for radius in (0.0, 0.0) if folds else (machine.minimum_radius, 0.0):
        rest = strands_in_rest(joined.lines, section, width, least, radius)
        links = [np.zeros(len(line), dtype=bool) for line in rest.strands]
        joined = Joined(joined.lines + rest.strands, joined.link + links)
        joined = with_detours(joined, rest.rings, width) if folds else joined
        joined = _printable(joined, section, machine, least, folds)
    return joined


def _settled(
    lines: list[FloatArray],
    layer: Layer,
    machine: Machine,
    folds: bool = False,
    rounds: int = PUSHES,
) -> Joined:
    """Strands of lines in steps as of `even_points`, moved apart and off the border."""
    section, width, least = layer.plane.polygon, machine.fibre_width, _least(layer, machine)
    lines = evened(lines, section, width, rounds)
    lines = keep_off_border(lines, section, _END * width)
    lines = trim_to_clearance(even_points(lines, width), _TRIM * width, _PIECE * width)
    lines = _long_chains(lines, width, least, folds)
    joined = join(lines, corners(lines, width, least) if folds else [])
    return _printable(joined, section, machine, least, folds)


def _printable(
    joined: Joined, section: Region, machine: Machine, least: float, folds: bool
) -> Joined:
    """Strands that are long enough and, unless they may, do not fold."""
    return long_enough(joined if folds else unfolded(joined, section, machine, least), least)


def _long_chains(
    lines: list[FloatArray], width: float, least: float, folds: bool
) -> list[FloatArray]:
    """Lines that are long enough, alone or, where strands may fold, joined to others."""
    size = np.array([line_length(line) for line in lines])
    if folds:
        ends = [(joint.first // 2, joint.second // 2) for joint in corners(lines, width, least)]
        chain = connected(np.array(ends, dtype=np.int64).reshape(-1, 2), len(lines))
        size = np.bincount(chain, size)[chain] if len(lines) else size
    return [line for line, length in zip(lines, size, strict=True) if length >= least]


# How much of each strand is laid.


@dataclass(frozen=True)
class _Strand:
    """A strand, and the tension along it."""

    line: FloatArray  # (k, 2), mm
    link: BoolArray  # (k,): whether the step from each point is a link
    along: FloatArray  # (k,), mm: arc length at its points
    carried: FloatArray  # (k,), N/mm: integral of ``t . S t`` up to each point


def _carrying(joined: Joined, layer: Layer, plane: FloatArray) -> list[_Strand]:
    """Strands of a layer with the stress (n, 3) at its points."""
    if not joined.lines:
        return []
    points, offsets = pack(joined.lines)
    step = np.zeros_like(points)
    step[:-1] = np.where(starts_segment(offsets)[:-1, None], np.diff(points, axis=0), 0.0)
    triangle, weights = layer.plane_triangles.locate(points + 0.5 * step, np.inf)
    s11, s22, s12 = np.einsum("qk,qkc->cq", weights, plane[layer.triangles[triangle]])
    x, y = step.T
    length = np.hypot(x, y)
    pulled = (x * x * s11 + y * y * s22 + 2.0 * x * y * s12) / np.maximum(length, 1e-300)
    pulled[np.concatenate(joined.link)] = 0.0
    strands = []
    for line, link, a, b in zip(*joined, offsets[:-1], offsets[1:], strict=True):
        along, carried = (np.append(0.0, np.cumsum(x[a : b - 1])) for x in (length, pulled))
        strands.append(_Strand(line, link, along, carried))
    return strands


def _carried(strands: Sequence[_Strand]) -> float:
    """Sum of the tension that strands carry."""
    return float(sum(max(strand.carried[-1], 0.0) for strand in strands))


def _stretch(strand: _Strand, level: float, least: float) -> tuple[int, int] | None:
    """First and last point of the stretch, at least so long, that carries most above a level."""
    worth = strand.carried - level * strand.along
    # The latest point from which a stretch up to each point is long enough.
    last = np.searchsorted(strand.along, strand.along - least * (1.0 - 1e-9), side="right") - 1
    ends = np.flatnonzero(last >= 0)
    if not len(ends):
        return None
    lowest = np.minimum.accumulate(worth)
    gain = worth[ends] - lowest[last[ends]]
    best = int(np.argmax(gain))
    if gain[best] <= 0.0:
        return None
    stop = int(ends[best])
    return int(np.argmin(worth[: last[stop] + 1])), stop


def _level(strands: Sequence[_Strand], share: float, least: float) -> float:
    """Tension above which stretches are laid so that a share of all the length is."""
    wanted = share * sum(float(strand.along[-1]) for strand in strands)

    def length(level: float) -> float:
        total = 0.0
        for strand in strands:
            stretch = _stretch(strand, level, least)
            if stretch is not None:
                total += float(strand.along[stretch[1]] - strand.along[stretch[0]])
        return total

    slopes = [np.diff(s.carried) / np.maximum(np.diff(s.along), 1e-12) for s in strands]
    pulls = np.concatenate([np.zeros(1), *slopes])
    low, high = float(pulls.min()), float(pulls.max())
    low -= max(high - low, 1e-300)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if length(middle) >= wanted else (low, middle)
    return low


def _kept(strands: Sequence[_Strand], level: float, least: float) -> list[_Strand]:
    """Return the stretches of strands that are worth laying."""
    kept = []
    for strand in strands:
        stretch = _stretch(strand, level, least)
        if stretch is not None:
            a, b = stretch
            rows = slice(a, b + 1)
            link = strand.link[rows].copy()
            link[-1] = False
            kept.append(_Strand(strand.line[rows], link, strand.along[rows], strand.carried[rows]))
    return kept
