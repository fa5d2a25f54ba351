"""Plans that cost little: a designed plan is tested against them, and has to be better."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import largest_in_plane
from ccfem.fem.elasticity.stress_field import StressField, WeightedCases
from ccfem.geometry.shapes import Region, open_lines
from ccfem.machine.machine import Machine
from ccfem.paths.fields.tensile import Tension, layer_tension
from ccfem.paths.planning.alike import on_layer
from ccfem.paths.planning.infill import long_enough
from ccfem.paths.planning.layer_plans import plan, plan_layers
from ccfem.paths.planning.strategy import LayerPlanner
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, curved_layers
from ccfem.strategies import create
from ccfem.strategies.concentric import Concentric
from ccfem.strategies.fibre_aware.heights import (
    grouped_by_stress,
    is_large,
    layers_by_case,
    layers_of_one_kind,
    middle,
)
from ccfem.strategies.stripes import Stripes

_CAP = 60.0
"""Percentile of the stress at which isocurves lie side by side: more fibre than is kept."""

_CLOSE_TO_TENSION = Stripes(smooth=4.0, border=5.0)
"""Stripes that are cut down follow the tension more closely than those that cover a layer."""

_SHARED, _SAME = 2, 0.5
"""Layers that share stripes, and distance of their borders in strand widths. On the Shell of Chen
et al. 2021 the plan is then .1 % softer."""

_ALIKE = 1e-6
"""Share by which sizes, and angle by which directions, count as equal."""


@dataclass(frozen=True)
class StraightRows:
    """Straight rows a strand's width apart: a `LayerPlanner` for flat layers.

    The outermost rows lie half a width inside the section. Rows end at the border where that keeps
    all their width inside, else half a width before it.

    Attributes
    ----------
    along : {"tension", "section"}
        Whether they follow the mean tension of a layer or the longer side of its section.
    """

    along: str = "tension"

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the rows of one layer; none where it has no tension."""
        tension, width = layer_tension(stress), machine.fibre_width
        section = layer.plane.polygon
        room = shapely.buffer(section, -0.5 * width)
        size = layer.areas * np.where(tension.defined, tension.stress, 0.0)
        if not size.any() or room.is_empty:
            return Toolpaths.empty()
        along = _mean(tension, size)
        if self.along == "section":
            along = _longer_side(section, along)
        across = np.array([-along[1], along[0]])
        corners = shapely.get_coordinates(room)
        low, high = (corners @ across).min(), (corners @ across).max()
        count = int((high - low) / width * (1.0 + 1e-9)) + 1
        middle = np.linspace(low, high, count)[:, None] * across
        reach = np.abs(corners @ along).max() + width
        rows = shapely.linestrings(np.stack([middle - reach * along, middle + reach * along], 1))
        # Rows on an edge must not be lost by rounding.
        inside = shapely.intersection(rows, shapely.buffer(room, 1e-6 * width))
        allowed = shapely.buffer(section, 1e-3 * width)
        shapely.prepare((section, allowed))
        lines = [_drawn_to_border(line, section, allowed, width) for line in open_lines(inside)]
        return long_enough(Toolpaths.from_plane(lines, layer), None, machine)


def _mean(tension: Tension, size: FloatArray) -> FloatArray:
    """Average the directions of tension, (2,), by their tensors: directions have no sign."""
    x, y = tension.direction.T
    _, _, angle = largest_in_plane(size @ np.stack([x * x, y * y, x * y], axis=1))
    return np.array([np.cos(angle), np.sin(angle)])


def _longer_side(section: Region, near: FloatArray) -> FloatArray:
    """Return the direction (2,) of the longer side of the smallest rectangle round a section.

    Of rectangles as small as that, as round a section that is its own mirror image, the one whose
    side is nearest to a direction counts, so that rounding does not decide.
    """
    corners = shapely.get_coordinates(section.convex_hull)
    edges = np.diff(corners, axis=0)
    sides = edges / np.linalg.norm(edges, axis=1)[:, None]
    sides = np.concatenate([sides, np.stack([-sides[:, 1], sides[:, 0]], axis=1)])
    long = np.ptp(sides @ corners.T, axis=1)
    wide = np.roll(long, len(edges))
    least = (long * wide <= (long * wide).min() * (1.0 + _ALIKE)) & (long >= wide * (1.0 - _ALIKE))
    sides = sides[least]
    along = sides @ near
    # A side has no sign: angles lie within a right angle of the direction.
    angle = np.arctan2(np.where(along < 0.0, -1.0, 1.0) * (sides @ [-near[1], near[0]]), abs(along))
    alike = np.flatnonzero(np.abs(angle) <= np.abs(angle).min() + _ALIKE)
    longest: FloatArray = sides[alike[np.argmax(angle[alike])]]
    return longest


def _drawn_to_border(
    line: FloatArray, section: Region, allowed: Region, width: float
) -> FloatArray:
    """Row (2, 2), its ends drawn out to the border where all its width is allowed there."""
    step = (line[-1] - line[0]) / np.linalg.norm(line[-1] - line[0])
    for end, way in ((0, -step), (-1, step)):
        ray = shapely.linestrings([line[end], line[end] + width * way])
        out = shapely.intersection(ray, section)
        whole = shapely.buffer(out, 0.5 * width, cap_style="flat")
        if out.length and shapely.covers(allowed, whole):
            line = line.copy()
            line[end] = line[end] + out.length * way
    return line


@dataclass(frozen=True)
class SharedStripes:
    """Stripes of some flat layers, which others of about their section take over.

    Attributes
    ----------
    paths : Toolpaths
        Of those layers.
    sources : mapping of int to Layer
        The layer that each takes its strands from, by `Layer.index`.
    """

    paths: Toolpaths
    sources: Mapping[int, Layer]

    @classmethod
    def of(
        cls, layers: Sequence[Layer], group: Sequence[int], stress: StressField, machine: Machine
    ) -> "SharedStripes":
        """Plan stripes on every second layer of about the same section.

        Parameters
        ----------
        group : sequence of int
            Of each layer: only layers of one group share.
        """
        kinds = layers_of_one_kind(layers, np.array(group), _SAME * machine.fibre_width)
        runs = [run for kind in kinds for run in np.array_split(kind, -(-len(kind) // _SHARED))]
        chosen = [layers[middle(run)] for run in runs]
        sources = {
            layers[k].index: source
            for run, source in zip(runs, chosen, strict=True)
            for k in run.tolist()
        }
        return cls(plan(_CLOSE_TO_TENSION, chosen, stress, machine), sources)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Strands of one layer."""
        source = self.sources[layer.index]
        paths = self.paths.on_layer(source.index)
        if source is layer:
            return paths
        return _CLOSE_TO_TENSION.taken_over(paths, source, layer, machine)


def plain_plans(
    cases: WeightedCases, layers: Sequence[Layer], machine: Machine, curves: bool = True
) -> list[Toolpaths]:
    """Plan straight rows, contours, stripes and isocurves, each with more fibre than is kept.

    Layers of one section under alike stress are planned once, and on large parts two flat layers
    of about the same section share stripes. There contours and isocurves are left out for one load
    case. On curved layers rows and contours follow the tension nowhere, and are left out.

    Parameters
    ----------
    layers : sequence of Layer
        Each is planned for one load case, as many for each as its weight says.
    curves : bool, default True
        Whether to plan isocurves too.

    Returns
    -------
    list of Toolpaths
        Without folds.
    """
    case, field = layers_by_case(cases.weights, layers), cases.heaviest
    stresses = [field.stress for field in cases.fields]
    group = case * len(layers) + grouped_by_stress(field.mesh, stresses, layers)
    kinds = layers_of_one_kind(layers, group)
    middles = [middle(numbers) for numbers in kinds]

    def in_all(planned: Callable[[Sequence[Layer], StressField], Toolpaths]) -> Toolpaths:
        """Plan the middle layer of each kind, and draw its paths on the others."""
        drawn: dict[int, Toolpaths] = {}
        for k, field in enumerate(cases.fields):
            chosen = [layers[number] for number in middles if case[number] == k]
            paths = planned(chosen, field) if chosen else Toolpaths.empty()
            drawn |= {layer.index: paths.on_layer(layer.index) for layer in chosen}
        source = {int(k): n for numbers, n in zip(kinds, middles, strict=True) for k in numbers}
        return Toolpaths.concatenate(
            on_layer(drawn[layers[source[k]].index], layer) for k, layer in enumerate(layers)
        )

    def by(planner: LayerPlanner) -> Toolpaths:
        return in_all(lambda some, field: plan_layers(planner, some, some, field, machine))

    plans = []
    large = is_large(cases.mesh, layers)
    few = large and len(cases) == 1
    if not curved_layers(layers):
        plans += [by(StraightRows("tension")), by(StraightRows("section"))]
        if not few:
            plans.append(by(Concentric().for_part(field, layers, machine)))
    group_of = {layer.index: int(k) for layer, k in zip(layers, group, strict=True)}

    def striped(some: Sequence[Layer], field: StressField) -> Toolpaths:
        if not large:
            return plan(_CLOSE_TO_TENSION, some, field, machine)
        groups = [group_of[layer.index] for layer in some]
        shared = SharedStripes.of(some, groups, field, machine)
        return plan_layers(shared, some, some, field, machine)

    plans.append(in_all(striped))
    if curves and not few:
        isocurve = create("isocurve", {"cap": _CAP})
        plans.append(in_all(lambda some, field: plan(isocurve, some, field, machine)))
    return plans
