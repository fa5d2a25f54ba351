"""Isocurves of a field that is designed for the stiffness of the part with its fibre in it.

Beyond the papers: the density of fibre and its direction follow from the gradient of one scalar
field, as in `isocurve`, but the field is not fitted to the stress of the part without fibre. It is
optimised for the compliance of the part with the fibre that its isocurves lay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import shapely

from ccfem.arrays import FloatArray, IntArray
from ccfem.checks import check_fields
from ccfem.elasticity.part_stress import PartStress
from ccfem.elasticity.stress_field import StressField, solved
from ccfem.errors import InputError
from ccfem.fibre_aware.heights import (
    alike_share,
    fibre_capacity,
    group_layers,
    nearest_layer,
)
from ccfem.fibre_aware.prune import Profile, least_price, profiles, shorten
from ccfem.fibre_aware.smeared import SmearedPart
from ccfem.fibre_aware.spline_grid import SplineGrid
from ccfem.fibre_aware.stream_design import DENSEST, StreamDesign, StreamProblem, design
from ccfem.fibre_aware.stream_start import plane_axes, start_field
from ccfem.fields.layer_tension import layer_tension
from ccfem.geometry.isocontours import isocontours, triangle_edges
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import stress_on
from ccfem.linking.clearance import trim_to_clearance
from ccfem.linking.finishing import keep_off_border, linked_paths
from ccfem.machine.machine import Machine
from ccfem.planning.strategy import Amount, LayerPlanner
from ccfem.planning.whole_part import WholePart, full_length
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.bars import bars
from ccfem.virtual_testing.strand import RHO
from ccfem.virtual_testing.strands import cut_strands

__all__ = ["StreamFunction"]

_CLEARANCE = 0.95
"""Least distance of strands in widths: they are designed to be 1 / 0.975 apart, and what is cut for
a hundredth of a width would be lost."""

_SHORTEST = 5.0
"""Length, in strand widths, of the shortest pieces that are kept for linking."""

_CUT_COST = 20.0
"""Length, mm, of the least valuable fibre that another cut has to save."""

_ALIKE = 0.8
"""Share of the stress that all heights have in common, above which all layers get one field."""

_MOST_GROUPS = 6

_SAME = 0.5
"""Distance, in strand widths, up to which the borders of two sections count as the same: the levels
that are best for one layer are then taken for the other."""

_ENOUGH = 0.99
"""Share of a wanted length below which the design is made once more."""

_NEAR = 0.95
"""Share of the largest length above which shorter ones are cut from its design."""

_MORE = 1.03
"""By how much more it then asks for than by proportion."""


@dataclass(frozen=True)
class StreamFunction:
    """Fibre where and along which it makes the part stiffest.

    All layers share one field where the stress is about the same at all heights; otherwise the
    stack is divided into groups of layers with a field each. The fields are designed for somewhat
    too much fibre, and of their isocurves the stretches worth most are kept. The load is the one
    of the stress that the strategy is given; fibre is taken to carry tension only.

    Attributes
    ----------
    coverage : float, default 0.45
        Fibre length times strand width over area of the layers, in (0, 1].
    overfill : float, default 1.15
        Fibre length of the design over that kept, at least 1.
    rho : float, mm^2, default 4
        Axial stiffness of a strand over Young's modulus of the matrix.
    evaluations : int, default 50
        Of the stiffness, in the design.
    groups : int, default 0
        Number of fields over the height of the part; 0 for one, or for at most six where the
        stress differs over the height.
    grid : float, default 2
        Side of the squares of the field, in strand widths; never finer than the cells of the mesh.
    cap : float, default 90
        Percentile of the stress above which the density of the first field grows no more.
    phases : int, default 5
        Positions of the levels of which the best is taken, for all layers of the same section.
    link_limit : float, default 10
        Largest distance of two ends that are linked, in strand widths. Links keep the machine's
        minimum radius; those with corners join only what is too short to be cut alone, and are
        marked as links.
    inset : float, default 0.5
        Least distance of strands from the boundary, in strand widths. 0.5 keeps them in, and their
        ends still meet the links along the boundary; at 0 they may run along it with half of their
        width outside.
    """

    coverage: float = 0.45
    overfill: float = 1.15
    rho: float = RHO
    evaluations: int = 50
    groups: int = 0
    grid: float = 2.0
    cap: float = 90.0
    phases: int = 5
    link_limit: float = 10.0
    inset: float = 0.5

    amount: ClassVar[Amount] = Amount("coverage", most=0.85, least=0.1)
    flat_layers_only: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "border": {"inset": 0.0, "evaluations": 5},
        "groups": {"groups": 2, "evaluations": 5},
    }

    def __post_init__(self) -> None:
        check_fields(self, "coverage", above=0.0, at_most=1.0)
        check_fields(self, "overfill", "evaluations", "phases", at_least=1)
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "grid", above=0.0, unit="fibre widths")
        check_fields(self, "cap", above=0.0, at_most=100.0)
        check_fields(self, "groups", "link_limit", "inset", at_least=0)

    def natural_length(self, layers: Sequence[Layer], machine: Machine) -> float:
        """Length that the coverage asks for, mm per layer."""
        return self.coverage * full_length(layers, machine)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Design the fields of the whole part and plan all its layers.

        Layers that are not given are taken to be filled like the nearest one that is.

        Raises
        ------
        InputError
            When no layer has a tensile direction.
        """
        length = self.natural_length(layers, machine)
        return WholePart(self._cut(stress, layers, machine, (length,))[0])

    def to_lengths(
        self,
        stress: PartStress,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[tuple["StreamFunction", LayerPlanner]]:
        """Design for the largest of some lengths, mm per layer, and cut that to those near it.

        Lengths above the most of the coverage are taken for that. Where the paths of the design
        are too short in all it is made once more, with as much more fibre. Much shorter lengths
        are designed for anew: a design that is cut to less than it was made for ends strands
        where they carry.

        Raises
        ------
        InputError
            As `for_part`.
        """
        full = full_length(layers, machine)
        most = max(self.amount.most, self.coverage) * full
        lengths = [min(length, most) for length in lengths]
        longest = max(lengths)
        short = [k for k, length in enumerate(lengths) if length < _NEAR * longest]
        if short:
            anew = self.to_lengths(stress, layers, machine, [lengths[k] for k in short])
            near = [length for length in lengths if length >= _NEAR * longest]
            cut = iter(self.to_lengths(stress, layers, machine, near))
            of = dict(zip(short, anew, strict=True))
            return [of[k] if k in of else next(cut) for k in range(len(lengths))]
        told = replace(self, coverage=longest / full)
        found = told._cut(stress, layers, machine, lengths)
        laid = max(float(paths.lengths.sum()) for paths in found) / len(layers)
        if 0.0 < laid < _ENOUGH * longest and self.overfill * told.coverage < DENSEST:
            more = replace(told, overfill=min(_MORE * longest / laid, 2.0) * self.overfill)
            again = more._cut(stress, layers, machine, lengths)
            if max(float(paths.lengths.sum()) for paths in again) > laid * len(layers):
                told, found = more, again
        designed = told.overfill * told.coverage
        return [
            (_designed_for(told, length / full, designed), WholePart(paths))
            for length, paths in zip(lengths, found, strict=True)
        ]

    def _cut(
        self,
        stress: PartStress,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[Toolpaths]:
        """Design for this coverage, and cut the paths to each of some lengths, mm per layer."""
        if not any(layer_tension(stress_on(layer, stress)).defined.any() for layer in layers):
            largest = float(np.linalg.eigvalsh(stress.stress).max())
            raise InputError(
                "expected tension that fibre can carry; the largest tensile stress found is "
                f"{largest:.3g} MPa, outweighed by compression: turn the load round"
            )
        field = solved(stress, "stream_function")
        problem, group, found = self.designed(field, layers, machine)
        extraction = _Extraction(self, problem, found, field, machine)
        return extraction.plan(layers, group, [length * len(layers) for length in lengths])

    def designed(
        self, stress: StressField, layers: Sequence[Layer], machine: Machine
    ) -> tuple[StreamProblem, IntArray, StreamDesign]:
        """Design the fields: the problem, the group of each layer, and the design."""
        part = SmearedPart.of(stress, layers[0].plane.frame)
        linear = part.specimen.unreinforced
        mesh = part.mesh
        centres = part.centroids @ part.frame[:2].T
        size = max(self.grid * machine.fibre_width, float(np.cbrt(6.0 * mesh.volumes.mean())))
        groups = self.groups
        if not groups:
            alike = alike_share(part, linear.stress, size)
            groups = 1 if alike > _ALIKE else _MOST_GROUPS
        group = group_layers(layers, groups)
        corners = mesh.points[np.unique(mesh.corners)] @ part.frame[:2].T
        points = [corners, centres]
        for layer in layers:
            points += [_refined(layer)[0], layer.plane.points[layer.triangles].mean(axis=1)]
        energy = mesh.volumes * np.einsum("cij,cij->c", linear.stress, linear.stress)
        grid = SplineGrid.over(np.concatenate(points), *plane_axes(part, energy), size)
        capacity = fibre_capacity(part, layers, machine)
        problem = StreamProblem(
            part=part,
            grid=grid,
            group=group[nearest_layer(part, layers)],
            centres=centres,
            capacity=capacity,
            width=machine.fibre_width,
            axial_stiffness=self.rho * part.modulus,
            budget=self.overfill * self.coverage * float(mesh.volumes @ capacity),
        )
        chosen = [layers[_middle(np.flatnonzero(group == k))] for k in range(group.max() + 1)]
        start = start_field(problem, stress, chosen, self.cap)
        return problem, group, design(problem, start, self.evaluations)


def _designed_for(strategy: StreamFunction, coverage: float, designed: float) -> StreamFunction:
    """Strategy that lays a coverage of what is designed for another, overfill included."""
    return replace(strategy, coverage=coverage, overfill=max(designed / coverage, 1.0))


def _middle(numbers: IntArray) -> int:
    return int(numbers[len(numbers) // 2])


@dataclass(frozen=True)
class _Extraction:
    """Paths from designed fields."""

    strategy: StreamFunction
    problem: StreamProblem
    design: StreamDesign
    stress: StressField
    machine: Machine

    def plan(
        self, layers: Sequence[Layer], group: IntArray, lengths: Sequence[float]
    ) -> list[Toolpaths]:
        """Paths of all layers, cut to each of some lengths, mm in all."""
        alike = _alike(layers, group, self.problem.width)
        fields = [self.field(k) for k in range(self.problem.groups)]
        drawn: dict[tuple[int, int], Toolpaths] = {}

        def paths(number: int, phase: int) -> Toolpaths:
            if (number, phase) not in drawn:
                shift = (phase + 0.5) / self.strategy.phases
                field = fields[group[number]]
                drawn[number, phase] = self.layer_paths(layers[number], field, shift)
            return drawn[number, phase]

        tried = [
            [self.profiles(paths(_middle(numbers), phase)) for phase in range(self.strategy.phases)]
            for numbers in alike
        ]
        counts = [len(numbers) for numbers in alike]
        chosen = [self.phases(tried, counts, length) for length in lengths]
        planned: dict[tuple[int, ...], tuple[Toolpaths, list[Profile]]] = {}
        for phases in chosen:
            if phases not in planned:
                of = {k: p for some, p in zip(alike, phases, strict=True) for k in some.tolist()}
                whole = Toolpaths.concatenate([paths(k, of[k]) for k in range(len(layers))])
                planned[phases] = whole, self.profiles(whole)
        least = self.machine.minimum_length
        return [
            shorten(*planned[phases], length, least, _CUT_COST)
            for phases, length in zip(chosen, lengths, strict=True)
        ]

    def phases(
        self, tried: list[list[list[Profile]]], counts: Sequence[int], length: float
    ) -> tuple[int, ...]:
        """For each kind of layers the position of the levels that is worth most.

        Parameters
        ----------
        tried : list of list of list of Profile
            Of one layer of each kind at each position of the levels.
        counts : sequence of int
            Layers of each kind.
        length : float, mm
            Of all layers together.
        """
        minimum = self.machine.minimum_length
        middle = [one[self.strategy.phases // 2] for one in tried]
        along = [p for one, count in zip(middle, counts, strict=True) for p in count * one]
        price = least_price(along, length, minimum, _CUT_COST) if along else 0.0

        def gain(along: list[Profile]) -> float:
            return sum(one.kept(price, minimum, _CUT_COST)[1] for one in along)

        return tuple(int(np.argmax([gain(along) for along in one])) for one in tried)

    def field(self, group: int) -> FloatArray:
        """Coefficients of one field, with the sign that does not depend on the axes."""
        count = len(self.problem.grid)
        field = self.design.field[group * count : (group + 1) * count]
        inside = self.problem.group == group
        values = self.problem.grid.values(self.problem.centres[inside]) @ field
        weight = self.problem.part.mesh.volumes[inside]
        values = values - weight @ values / weight.sum()
        return field if weight @ values**3 >= 0.0 else -field

    def layer_paths(self, layer: Layer, field: FloatArray, shift: float) -> Toolpaths:
        """Paths of one layer along unit levels, the first one `shift` above the lowest value."""
        width, section = self.problem.width, layer.plane.polygon
        points, triangles = _refined(layer)
        values = self.problem.grid.values(points) @ field
        curves = isocontours(points, triangles, values, float(values.min()) + shift, 1.0)
        lines = keep_off_border(curves.lines(), section, self.strategy.inset * width)
        lines = trim_to_clearance(lines, _CLEARANCE * width, _SHORTEST * width)
        limit, least = self.strategy.link_limit * width, self.machine.minimum_length
        radius = self.machine.minimum_radius
        found = linked_paths(lines, section, width, limit, least, radius=radius)
        return Toolpaths.from_plane(found.lines, layer, link=found.link)

    def profiles(self, toolpaths: Toolpaths) -> list[Profile]:
        """Value of the paths at the strains of the designed part."""
        if not len(toolpaths):
            return []
        mesh = self.problem.part.mesh
        strands = cut_strands(toolpaths, mesh)
        displacement = self.design.objective.solution.displacement
        strain = bars(strands, mesh).strain(displacement)
        return profiles(toolpaths, strands, np.maximum(strain, 0.0) ** 2)


def _alike(layers: Sequence[Layer], group: IntArray, width: float) -> list[IntArray]:
    """Numbers of the layers of each kind: of one field, and of about the same section."""
    kinds: list[list[int]] = []
    borders = [shapely.boundary(layer.plane.polygon) for layer in layers]
    for k, border in enumerate(borders):
        for kind in kinds:
            same = group[kind[0]] == group[k]
            if same and shapely.hausdorff_distance(borders[kind[0]], border) < _SAME * width:
                kind.append(k)
                break
        else:
            kinds.append([k])
    return [np.array(kind) for kind in kinds]


def _refined(layer: Layer) -> tuple[FloatArray, IntArray]:
    """Points (n, 2) and triangles (t, 3) of a layer, each triangle cut in four."""
    points, corners = layer.plane.points, layer.triangles
    edges, opposite = triangle_edges(corners)
    a, b, c = corners.T
    x, y, z = opposite.T + len(points)
    four = [np.stack(three, axis=1) for three in ((a, z, y), (z, b, x), (y, x, c), (x, y, z))]
    middle = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    return np.concatenate([points, middle]), np.concatenate(four)
