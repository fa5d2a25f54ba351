"""Isocurves of a field that is optimised for the stiffness of the part with its fibre.

Not from a paper: as in `isocurve`, the gradient of one scalar field sets the density and direction
of the fibre. But the field is not fitted to the stress of the part without fibre: it minimises the
compliance of the part with the fibre that its isocurves lay.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, Literal, Protocol, TypeVar

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.base.parallel import beside, in_processes
from ccfem.fem.elasticity import PartStress, StressField
from ccfem.fem.elasticity.stress_field import WeightedCases, solved
from ccfem.judging.virtual_testing import RHO, Strand, specimens
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of, flat_view
from ccfem.paths.fields.tensile import layer_tension
from ccfem.paths.planning.strategy import Amount, ByCoverage, LayerPlanner, WholePart, full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.strategies.fibre_aware.cut_and_move import Cutting, prune_and_move
from ccfem.strategies.fibre_aware.heights import (
    fibre_capacity,
    group_layers,
    grouped_by_stress,
    layer_counts,
    layers_by_case,
    middle_layers,
    nearest_layer,
)
from ccfem.strategies.fibre_aware.judges import POWERS, Goal
from ccfem.strategies.fibre_aware.layer_axes import frames_in_cells
from ccfem.strategies.fibre_aware.plain_plans import plain_plans
from ccfem.strategies.fibre_aware.shortening import TIGHT_SHARES
from ccfem.strategies.fibre_aware.smeared import SmearedPart, smeared_cases
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.strand_moves import check_moves, kept_radius
from ccfem.strategies.fibre_aware.stream_design import (
    DENSEST,
    DESIGN_POWERS,
    StreamDesign,
    StreamModel,
    StreamProblem,
    design,
    designed_in_steps,
    first_step,
    in_two_steps,
)
from ccfem.strategies.fibre_aware.stream_paths import Extraction, refined
from ccfem.strategies.fibre_aware.stream_start import plane_axes, start_fields
from ccfem.strategies.fibre_aware.strength_design import design_for_strength
from ccfem.strategies.fibre_aware.upper_bound import WORST, measures

_ROUNDS = 3
"""Virtual tests that decide what to cut."""

_CASES_OVERFILL = 1.15
"""Least overfill for several load cases: their tests then have more fibre to choose from."""

_GO_ON = 0.5
"""Evaluations of the design that counts several cases as tests do, over those of the first one."""

_PLAIN_INSET = 0.5
"""Distance of plain plans from the border, in strand widths: none are tested above it."""

_Result = TypeVar("_Result")

_WIDE = {"tight": 0.0, "cut": 1.3}
"""Radius, in machine radii, below which bends of the field have a cost."""


@dataclass(frozen=True)
class StreamFunction(ByCoverage):
    """Fibre placed and directed so that the part becomes as stiff as possible.

    All layers share one field where the stress is about the same at all heights; otherwise the
    layers form groups over the height with one field each. The fields are designed for slightly too
    much fibre; of their isocurves, the stretches that are worth most are kept. `stripes`,
    `isocurve`, straight rows along the mean tension and contours are cut to the same length and
    tested too, and the best is taken. If it was cut from much more fibre or for several load cases,
    it takes over stretches of the others where there is room and it becomes stiffer. The load is
    that of the stress given to the strategy. Fibre is taken to carry tension only.

    On more than 50,000 cells, flat layers under one load case are planned in fewer ways: contours
    and `isocurve` are left out, one position of the levels is tested (unless turns are cut), and
    both of the two best plans take over stretches.

    On curved layers the field is one of space, of which each layer has the values along its
    surface: neighbouring layers get about the same strands. Rows and contours are left out there.

    Attributes
    ----------
    coverage : float, default 0.45
        Fibre length times strand width over area of the layers, in (0, 1].
    overfill : float, default 1.1
        Fibre length of the design over the length kept, at least 1; with several load cases at
        least 1.15.
    rho : float, mm^2, default 4
        Axial stiffness of a strand over Young's modulus of the matrix.
    evaluations : int, default 80
        Evaluations of the stiffness in the design. If the coverage is above 0.45, 0.6 times as many
        follow for one load case (`ccfem.strategies.fibre_aware.stream_design.designed_in_steps`).
    groups : int, default 0
        Number of fields over the height of the part; 0 for one field, or for at most six where the
        stress differs over the height. Curved layers have one, which changes over the height.
    grid : float, default 2
        Side of the squares of the field, in strand widths; never finer than the cells of the mesh.
    cap : float, default 90
        Percentile of the stress above which the density of the initial field no longer increases.
    phases : int, default 5
        Number of positions of the levels that are tried; layers of the same section share the best.
    link_limit : float, default 10
        Largest distance between two ends that are linked, in strand widths. Links keep the
        machine's minimum radius. Links with corners join only strands too short to be cut alone,
        and are marked as links.
    inset : float, default 0.5
        Least distance between strands or links and the boundary, in strand widths. At 0.5 whole
        strands lie inside; at 0 they may run along the boundary with half their width outside.
        Straight rows, tested up to 0.5, lie inside with their width and may end on the boundary.
    objective : {"worst", "sum", "least"}
        How several load cases count: the case farthest from its own stiffest design, the weighted
        mean over the cases, or the case that gains least over the part without fibre.
    tilt : float, default 0.6
        With several load cases: weight of a layer's own case in its initial field, in (0, 1]; the
        other cases share the rest.
    strength : float, default 0
        Weight of the load at first failure against the stiffness, in [0, 1]: the objective is
        ``stiffness^(1 - strength) * load^strength``. Of several load cases, the load is that of the
        case that fails first, at the least multiple of its load.
    moves : int, default 0
        Number of steps in which strands are moved sideways (`moved`), each step tested; on flat
        layers only.
    turns : {"tight", "cut"}
        Whether more than 1 % of the fibre may turn more tightly than the machine's minimum radius.
        With "cut", fibre that needs such turns is left out, so less may be laid than asked for; on
        flat layers the design then avoids them too.
    """

    coverage: float = 0.45
    overfill: float = 1.1
    rho: float = RHO
    evaluations: int = 80
    groups: int = 0
    grid: float = 2.0
    cap: float = 90.0
    phases: int = 5
    link_limit: float = 10.0
    inset: float = 0.5
    objective: Literal["worst", "sum", "least"] = "worst"
    tilt: float = 0.6
    strength: float = 0.0
    moves: int = 0
    turns: Literal["tight", "cut"] = "tight"

    amount: ClassVar[Amount] = Amount("coverage", most=0.85, least=0.1)
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "border": {"inset": 0.0, "evaluations": 5},
        "groups": {"groups": 2, "evaluations": 5},
        "moves": {"moves": 2, "evaluations": 5},
        "cut": {"turns": "cut", "evaluations": 5},
    }

    def __post_init__(self) -> None:
        check_fields(self, "coverage", above=0.0, at_most=1.0)
        check_fields(self, "overfill", "evaluations", "phases", at_least=1)
        check_fields(self, "rho", above=0.0, unit="mm^2")
        check_fields(self, "grid", above=0.0, unit="fibre widths")
        check_fields(self, "cap", above=0.0, at_most=100.0)
        check_fields(self, "groups", "link_limit", "inset", at_least=0)
        check_fields(self, "tilt", above=0.0, at_most=1.0)
        check_fields(self, "strength", at_least=0.0, at_most=1.0)
        check_fields(self, "moves", at_least=0)
        check_choices(self)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Design the fields of the whole part and plan all its layers.

        Layers that are not given are assumed to be filled like the nearest given layer.

        Raises
        ------
        InputError
            When no layer has a tensile direction, or the strength that is wanted is not known.
        """
        cases = WeightedCases.of(solved(stress, "stream_function"))
        length = self.natural_length(layers, machine)
        common = _Common(self, cases, tuple(layers), machine)
        return WholePart(self._cut_to_lengths(common, (length,))[0][0])

    def for_cases(
        self,
        cases: WeightedCases,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[tuple["StreamFunction", LayerPlanner]]:
        """Design one field for each load case, all together, and cut by tests under all cases.

        Each layer follows the field of one case. The number of layers of a case follows from its
        weight, and they are spread evenly over the height.

        The design is for the largest of the lengths, mm per layer, and cut to lengths near that
        one. Lengths that need more than the largest coverage are reduced to that coverage. If the
        paths of the design are too short in total, it is repeated with proportionally more fibre,
        unless plans that cost little lay more than twice as much as they do.
        Much shorter lengths get a design of their own: a design cut far below its length would end
        strands where they carry load.

        Raises
        ------
        InputError
            As `for_part`, where no layer has a tensile direction in any case.
        """
        least = 1.0 if len(cases) == 1 else _CASES_OVERFILL
        common = _Common(self, cases, tuple(layers), machine)
        if len(lengths) > 1:
            # Before each is designed for in a process of its own: what at least two need.
            full = full_length(layers, machine)
            second = replace(self, coverage=min(sorted(lengths)[-2] / full, 1.0))
            common.beside_plain(lambda: second._known_first(common, second._posed(common)[0]))
        return designed_to_lengths(
            replace(self, overfill=max(self.overfill, least)),
            layers,
            machine,
            lengths,
            lambda strategy, some, whole: strategy._cut_to_lengths(common, some, whole),
            again=self.turns == "tight",
        )

    def _cut_to_lengths(
        self, common: "_Common", lengths: Sequence[float], whole: bool = False
    ) -> tuple[list[Toolpaths], float]:
        """Design for this coverage, and cut by tests of all cases to lengths, mm per layer.

        With `whole`, plans that lay the length go before stiffer ones that do not. Returned with
        the plans is the length, mm in all, that plain plans, or a design with the most fibre that
        is asked for again, could lay.
        """
        cases, layers, machine = common.cases, common.layers, common.machine
        check_moves(self.moves, layers)
        _check_tension(cases.fields, layers)
        in_all, strand = [length * len(layers) for length in lengths], Strand(self.rho)
        bounds = measures(self.objective, cases, layers, max(in_all), machine, strand)
        problem, group, designed = common.beside_plain(lambda: self._designed(common, bounds))
        parts = tuple(part.specimen for part in problem.parts)
        goal = Goal(parts, cases.weights, bounds, self.objective)
        fields_of = layers_by_case(cases.weights, layers) * problem.model.groups + group

        def candidates(design: StreamDesign) -> list[list[Toolpaths]]:
            counts, solutions = goal.counts(design.objective.ratio), design.objective.solution
            strained = [
                (float(share) / one.work, one.displacement)
                for share, one in zip(counts, solutions, strict=True)
            ]
            drawn = self.extraction(problem.model, tuple(design.fields), strained, machine, layers)
            return drawn.candidates(layers, fields_of, in_all)

        designs = [designed]
        if len(cases) > 1 and self.objective == WORST:
            # Go on from there with the cases counted as tests count them.
            counted = replace(problem, power=POWERS[WORST])
            more = int(np.ceil(_GO_ON * self.evaluations))
            designs.append(design(counted, designed.fields.ravel(), more))
        tried = [list(chain(*some)) for some in zip(*map(candidates, designs), strict=True)]
        if self.strength:
            fields, solutions = designed.fields.ravel(), designed.objective.solution
            weight, most = self.strength, self.evaluations
            strong = design_for_strength(problem, fields, solutions, weight, most)
            # Of each length: the first design for strength, and all designs for stiffness.
            pairs = zip(candidates(strong), tried, strict=True)
            tried = [[first, *stiff] for (first, *_), stiff in pairs]
        how = Cutting(_ROUNDS, self.strength, self.moves, TIGHT_SHARES[self.turns])
        # Fields are designed on linear cells; moves gain less than those may be off.
        last = replace(goal, parts=specimens(cases)) if self.moves else None
        plans = []
        for some, length in zip(tried, in_all, strict=True):
            offered = [*some, *common.plain]
            enough = [paths for paths in offered if float(paths.lengths.sum()) >= _WHOLE * length]
            offered = enough if whole and enough else offered
            plans.append(prune_and_move(offered, layers, goal, length, machine, strand, how, last))
        drawn = max(float(paths.lengths.sum()) for some in tried for paths in some)
        plain = max((float(paths.lengths.sum()) for paths in common.plain), default=0.0)
        return plans, max(_AT_MOST * drawn, plain)

    def extraction(
        self,
        model: StreamModel,
        fields: Sequence[FloatArray],
        strains_of: Sequence[tuple[float, FloatArray]],
        machine: Machine,
        layers: Sequence[Layer] = (),
    ) -> Extraction:
        """Paths along the fields; each field has a block of coefficients for every group."""
        blocks = [model.signed(field, group) for field in fields for group in range(model.groups)]
        mesh, widths = model.part.mesh, (self.inset, self.link_limit)
        radius = kept_radius(machine, TIGHT_SHARES[self.turns])
        curved = layers if model.part.axes.curved else ()
        charts = {layer.index: chart_of(layer) for layer in curved}
        return Extraction(
            tuple(blocks),
            model.grid,
            mesh,
            strains_of,
            machine,
            self.phases,
            *widths,
            radius,
            charts,
        )

    def designed(
        self,
        stress: StressField | WeightedCases,
        layers: Sequence[Layer],
        machine: Machine,
        bounds: FloatArray | None = None,
    ) -> tuple[StreamProblem, IntArray, StreamDesign]:
        """Design for stiffness; return the problem, the group of each layer, and the design.

        `bounds` (n,) are the stiffness ratios that the cases are measured by
        (`ccfem.strategies.fibre_aware.upper_bound.measures`), by default 1.
        """
        cases = WeightedCases.of(stress)
        return self._designed(_Common(self, cases, tuple(layers), machine), bounds)

    def _designed(
        self, common: "_Common", bounds: FloatArray | None
    ) -> tuple[StreamProblem, IntArray, StreamDesign]:
        """Design as `designed` does, from a first step that is known."""
        problem, group, start = self._posed(common, bounds)
        first = self._known_first(common, problem)
        designs = designed_in_steps(problem, start, self.evaluations, self.coverage, first)
        return problem, group, designs

    def _known_first(self, common: "_Common", problem: StreamProblem) -> StreamDesign | None:
        """First step of a design in two steps; None for a design in one."""
        return common.first if in_two_steps(problem, self.coverage) else None

    def _posed(
        self, common: "_Common", bounds: FloatArray | None = None
    ) -> tuple[StreamProblem, IntArray, Callable[[StreamProblem], FloatArray]]:
        """Return the problem, the group of each layer, and what makes the first fields."""
        cases, layers = common.cases, common.layers
        parts = smeared_cases(cases.fields, frames_in_cells(cases.mesh.centres, layers))
        model, group = self._model(parts, layers, common.machine)
        shares = layer_counts(cases.weights, len(layers)) / len(layers)
        measured = np.ones(len(cases)) if bounds is None else bounds
        power = DESIGN_POWERS[self.objective]
        problem = StreamProblem(model, parts, cases.weights, measured, shares, power)
        chosen = middle_layers(layers, group)

        def start(posed: StreamProblem) -> FloatArray:
            return start_fields(posed, cases.fields, chosen, self.cap, self.tilt)

        return problem, group, start

    def _model(
        self, parts: Sequence[SmearedPart], layers: Sequence[Layer], machine: Machine
    ) -> tuple[StreamModel, IntArray]:
        """Return the fibre of one field, and each layer's group."""
        part, mesh, axes = parts[0], parts[0].mesh, parts[0].axes
        centres = axes.places(part.centroids)
        size = max(self.grid * machine.fibre_width, float(np.cbrt(6.0 * mesh.volumes.mean())))
        stresses = [specimen_part.specimen.unreinforced.stress for specimen_part in parts]
        if axes.curved:  # a field in space may change from layer to layer
            group = np.zeros(len(layers), dtype=np.int64)
        elif self.groups:
            group = group_layers(layers, self.groups)
        else:
            group = grouped_by_stress(mesh, stresses, layers, size)
        points = [axes.places(mesh.points[np.unique(mesh.corners)]), centres]
        for layer in layers:
            fine = refined(layer, in_space=axes.curved)[0]
            points += [fine, fine[layer.triangles].mean(axis=1)]
        energies = [
            mesh.volumes * np.einsum("cij,cij->c", specimen_part, specimen_part)
            for specimen_part in stresses
        ]
        grid = SplineGrid.over(np.concatenate(points), *plane_axes(part, energies), size)
        capacity = fibre_capacity(part, layers, machine)
        model = StreamModel(
            part=part,
            grid=grid,
            group=group[nearest_layer(part, layers)],
            centres=centres,
            capacity=capacity,
            width=machine.fibre_width,
            axial_stiffness=self.rho * part.modulus,
            budget=self.overfill * self.coverage * float(mesh.volumes @ capacity),
            radius=0.0 if axes.curved else _WIDE[self.turns] * machine.minimum_radius,
        )
        return model, group


@dataclass(frozen=True)
class _Common:
    """What designs for one part share, whatever their amount of fibre: each is made once."""

    strategy: StreamFunction
    cases: WeightedCases
    layers: tuple[Layer, ...]
    machine: Machine

    def __post_init__(self) -> None:
        if self.strategy.strength > 0.0:  # before anything is designed
            Limits.of(self.cases.fields[0].problem.material)

    @cached_property
    def plain(self) -> list[Toolpaths]:
        """Plans that are tested beside the designed ones."""
        if self.strategy.inset > _PLAIN_INSET:
            return []
        return plain_plans(self.cases, self.layers, self.machine)

    def beside_plain(self, work: Callable[[], _Result]) -> _Result:
        """Do some work; where the plain plans are not known, another process makes them."""
        if "plain" in self.__dict__:
            return work()
        with beside(lambda: self.plain, shared=[self.cases, self.layers]) as plain:
            result = work()
            self.__dict__["plain"] = plain()
        return result

    @cached_property
    def first(self) -> StreamDesign:
        """First step of all designs that take two."""
        problem, _, start = self.strategy._posed(self)
        return first_step(problem, start, self.strategy.evaluations)


def _check_tension(stresses: Sequence[StressField], layers: Sequence[Layer]) -> None:
    """Refuse a part that is under tension nowhere, in no load case."""
    for stress in stresses:
        views = map(flat_view, layers)
        if any(layer_tension(stress_on(view, stress)).defined.any() for view in views):
            return
    largest = max(float(np.linalg.eigvalsh(stress.stress).max()) for stress in stresses)
    raise InputError(
        "expected tension that fibre can carry; the largest tensile stress found is "
        f"{largest:.3g} MPa, outweighed by compression: turn the load round"
    )


# Paths of several lengths from as few designs as possible.


_ENOUGH = 0.99
"""Share of a wanted length below which the design is repeated."""

_WHOLE = 0.995
"""Share of a wanted length from which a plan, before it is cut, lays it."""

_NEAR = 0.95
"""Share of the largest length above which shorter lengths are cut from its design."""

_MORE = 1.03
"""Factor on the length asked for in the repeated design, on top of the proportional increase."""

_AT_MOST = 2.0
"""Fibre of the repeated design over that of the first, at most."""


class _Strategy(Protocol):
    """A strategy that designs fields for a coverage, and for more fibre by its overfill."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    amount: ClassVar[Amount]

    @property
    def coverage(self) -> float: ...
    @property
    def overfill(self) -> float: ...


Designed = TypeVar("Designed", bound=_Strategy)


def designed_to_lengths(
    strategy: Designed,
    layers: Sequence[Layer],
    machine: Machine,
    lengths: Sequence[float],
    cut: Callable[[Designed, Sequence[float], bool], tuple[list[Toolpaths], float]],
    again: bool = True,
) -> list[tuple[Designed, LayerPlanner]]:
    """Design for the largest length, and again for much shorter ones.

    Parameters
    ----------
    lengths : sequence of float, mm per layer
        Lengths that need more than the largest coverage are reduced to that coverage, of which the
        stiffest plan is taken, however much it lays.
    cut : callable
        Designs for the coverage of a strategy and cuts the paths to each of the lengths, given
        whether plans that lay a length go before stiffer ones that do not. Returns the plans, and
        the length, mm in all, that it could lay at most when it is asked again.
    again : bool, default True
        Whether to design for more fibre where the paths are too short, and to take the longer ones.
        Not where the plans are the longest already: a design draws about in proportion to its
        fibre.

    Returns
    -------
    list of (StreamFunction, LayerPlanner)
        For each length the strategy with parameters that lay it, and the plan.
    """
    full = full_length(layers, machine)
    most = max(strategy.amount.most, strategy.coverage) * full
    lengths = [min(length, most) for length in lengths]

    def designed(near: Sequence[float]) -> list[tuple[Designed, LayerPlanner]]:
        longest = max(near)
        asked = replace(strategy, coverage=longest / full)
        plans, reach = cut(asked, near, False)
        longest_plan = max(float(paths.lengths.sum()) for paths in plans) / len(layers)
        # At the largest coverage the stiffest plan counts, however much of that it lays.
        short_of = longest < most and 0.0 < longest_plan < _ENOUGH * longest
        in_reach = longest_plan * len(layers) < reach
        if again and short_of and in_reach and strategy.overfill * asked.coverage < DENSEST:
            overfill = min(_MORE * longest / longest_plan, _AT_MOST) * strategy.overfill
            more = replace(asked, overfill=overfill)
            longer, _ = cut(more, near, True)
            if max(float(paths.lengths.sum()) for paths in longer) > longest_plan * len(layers):
                asked, plans = more, longer
        whole = asked.overfill * asked.coverage
        return [
            (_designed_for(asked, length / full, whole), WholePart(paths))
            for length, paths in zip(near, plans, strict=True)
        ]

    # Lengths near the longest share its design; the others are designed for anew.
    groups: list[list[float]] = []
    for length in sorted(set(lengths), reverse=True):
        if groups and length >= _NEAR * groups[-1][0]:
            groups[-1].append(length)
        else:
            groups.append([length])
    of_groups = in_processes(designed, groups, shared=[strategy, layers, machine])
    plan_of = {
        length: plan
        for group, plans in zip(groups, of_groups, strict=True)
        for length, plan in zip(group, plans, strict=True)
    }
    return [plan_of[length] for length in lengths]


def _designed_for(strategy: Designed, coverage: float, designed: float) -> Designed:
    """Strategy that lays a coverage from a design for `designed`, overfill included."""
    return replace(strategy, coverage=coverage, overfill=max(designed / coverage, 1.0))
