"""Isocurves of a field that is optimised for the stiffness of the part with its fibre.

Not from a paper: as in `isocurve`, the gradient of one scalar field sets the density and direction
of the fibre. But the field is not fitted to the stress of the part without fibre: it minimises the
compliance of the part with the fibre that its isocurves lay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.fem.elasticity.stress_field import StressField, solved
from ccfem.fem.elasticity.weighted_cases import WeightedCases
from ccfem.judging.virtual_testing.strand import RHO, Strand
from ccfem.machine.machine import Machine
from ccfem.paths.fields.layer_tension import layer_tension
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.planning.whole_part import WholePart, full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import stress_on
from ccfem.strategies.fibre_aware.cut_and_move import prune_and_move
from ccfem.strategies.fibre_aware.design_lengths import designed_to_lengths
from ccfem.strategies.fibre_aware.heights import (
    alike_share,
    fibre_capacity,
    group_layers,
    layer_counts,
    layers_by_case,
    middle_layers,
    nearest_layer,
)
from ccfem.strategies.fibre_aware.judges import Goal
from ccfem.strategies.fibre_aware.shortening import TIGHT_SHARES
from ccfem.strategies.fibre_aware.smeared import SmearedPart, smeared_cases
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.strand_moves import kept_radius
from ccfem.strategies.fibre_aware.stream_design import (
    DESIGN_POWERS,
    StreamDesign,
    StreamModel,
    StreamProblem,
    designed_in_steps,
)
from ccfem.strategies.fibre_aware.stream_paths import Extraction, refined
from ccfem.strategies.fibre_aware.stream_start import plane_axes, start_fields
from ccfem.strategies.fibre_aware.strength_design import design_for_strength
from ccfem.strategies.fibre_aware.upper_bound import measures

_ALIKE = 0.8
"""Share of the stress common to all heights above which all layers get one field."""

_MOST_GROUPS = 6

_ROUNDS = 3
"""Virtual tests that decide what to cut."""

_CASES_OVERFILL = 1.15
"""Least overfill for several load cases: their tests then have more fibre to choose from."""

_WIDE = {"tight": 0.0, "cut": 1.3}
"""Radius, in machine radii, below which bends of the field have a cost."""


@dataclass(frozen=True)
class StreamFunction:
    """Fibre placed and directed so that the part becomes as stiff as possible.

    All layers share one field where the stress is about the same at all heights; otherwise the
    layers form groups over the height with one field each. The fields are designed for slightly too
    much fibre; of their isocurves, the stretches that are worth most are kept. The load is that of
    the stress given to the strategy. Fibre is taken to carry tension only.

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
        stress differs over the height.
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
        Number of steps in which strands are moved sideways (`moved`), each step tested.
    turns : {"tight", "cut"}
        Whether more than 1 % of the fibre may turn more tightly than the machine's minimum radius.
        With "cut", fibre that needs such turns is left out, so less may be laid than asked for.
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
    flat_layers_only: ClassVar[bool] = True
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

    def natural_length(self, layers: Sequence[Layer], machine: Machine) -> float:
        """Length that the coverage asks for, mm per layer."""
        return self.coverage * full_length(layers, machine)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Design the fields of the whole part and plan all its layers.

        Layers that are not given are assumed to be filled like the nearest given layer.

        Raises
        ------
        InputError
            When no layer has a tensile direction.
        """
        cases = WeightedCases.of(solved(stress, "stream_function"))
        length = self.natural_length(layers, machine)
        return WholePart(self._cut(cases, layers, machine, (length,))[0])

    def to_lengths(
        self,
        stress: PartStress,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[tuple["StreamFunction", LayerPlanner]]:
        """Plan for one load case by `for_cases`.

        Raises
        ------
        InputError
            As `for_part`.
        """
        cases = WeightedCases.of(solved(stress, "stream_function"))
        return self.for_cases(cases, layers, machine, lengths)

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
        paths of the design are too short in total, it is repeated with proportionally more fibre.
        Much shorter lengths get a design of their own: a design cut far below its length would end
        strands where they carry load.

        Raises
        ------
        InputError
            When no layer has a tensile direction in any case.
        """
        least = 1.0 if len(cases) == 1 else _CASES_OVERFILL
        return designed_to_lengths(
            replace(self, overfill=max(self.overfill, least)),
            layers,
            machine,
            lengths,
            lambda one, some: one._cut(cases, layers, machine, some),
            again=self.turns == "tight",
        )

    def _cut(
        self,
        cases: WeightedCases,
        layers: Sequence[Layer],
        machine: Machine,
        lengths: Sequence[float],
    ) -> list[Toolpaths]:
        """Design for this coverage, and cut by tests of all cases to lengths, mm per layer."""
        _check_tension(cases.fields, layers)
        in_all, strand = [length * len(layers) for length in lengths], Strand(self.rho)
        bounds = measures(self.objective, cases, layers, max(in_all), machine, strand)
        problem, group, found = self.designed(cases, layers, machine, bounds)
        specimens = tuple(part.specimen for part in problem.parts)
        goal = Goal(specimens, cases.weights, bounds, self.objective)
        fields_of = layers_by_case(cases.weights, layers) * problem.model.groups + group

        def candidates(design: StreamDesign) -> list[list[Toolpaths]]:
            counts, solutions = goal.counts(design.objective.ratio), design.objective.solution
            strained = [
                (float(share) / one.work, one.displacement)
                for share, one in zip(counts, solutions, strict=True)
            ]
            drawn = self.extraction(problem.model, tuple(design.fields), strained, machine)
            return drawn.candidates(layers, fields_of, in_all)

        tried = candidates(found)
        if self.strength:
            fields, solutions = found.fields.ravel(), found.objective.solution
            how = (self.strength, self.evaluations)
            strong = design_for_strength(problem, fields, solutions, *how)
            tried = _with_first(candidates(strong), tried)
        cut_by = (_ROUNDS, self.strength, self.moves, TIGHT_SHARES[self.turns])
        return [
            prune_and_move(some, layers, goal, length, machine, strand, *cut_by)
            for some, length in zip(tried, in_all, strict=True)
        ]

    def extraction(
        self,
        model: StreamModel,
        fields: Sequence[FloatArray],
        strains_of: Sequence[tuple[float, FloatArray]],
        machine: Machine,
    ) -> Extraction:
        """Paths along the fields; each field has a block of coefficients for every group."""
        blocks = [model.signed(field, group) for field in fields for group in range(model.groups)]
        mesh, widths = model.part.mesh, (self.inset, self.link_limit)
        radius = kept_radius(machine, TIGHT_SHARES[self.turns])
        return Extraction(
            tuple(blocks), model.grid, mesh, strains_of, machine, self.phases, *widths, radius
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
        parts = smeared_cases(cases.fields, layers[0].plane.frame)
        model, group = self._model(parts, layers, machine)
        shares = layer_counts(cases.weights, len(layers)) / len(layers)
        measured = np.ones(len(cases)) if bounds is None else bounds
        power = DESIGN_POWERS[self.objective]
        problem = StreamProblem(model, parts, cases.weights, measured, shares, power)
        chosen = middle_layers(layers, group)

        def start(posed: StreamProblem) -> FloatArray:
            return start_fields(posed, cases.fields, chosen, self.cap, self.tilt)

        found = designed_in_steps(problem, start, self.evaluations, self.coverage)
        return problem, group, found

    def _model(
        self, parts: Sequence[SmearedPart], layers: Sequence[Layer], machine: Machine
    ) -> tuple[StreamModel, IntArray]:
        """Return the fibre of one field, and each layer's group."""
        part, mesh = parts[0], parts[0].mesh
        centres = part.centroids @ part.frame[:2].T
        size = max(self.grid * machine.fibre_width, float(np.cbrt(6.0 * mesh.volumes.mean())))
        stresses = [each.specimen.unreinforced.stress for each in parts]
        groups = self.groups
        if not groups:
            alike = min(alike_share(part, each, size) for each in stresses)
            groups = 1 if alike > _ALIKE else _MOST_GROUPS
        group = group_layers(layers, groups)
        corners = mesh.points[np.unique(mesh.corners)] @ part.frame[:2].T
        points = [corners, centres]
        for layer in layers:
            points += [refined(layer)[0], layer.plane.points[layer.triangles].mean(axis=1)]
        energies = [mesh.volumes * np.einsum("cij,cij->c", each, each) for each in stresses]
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
            radius=_WIDE[self.turns] * machine.minimum_radius,
        )
        return model, group


def _with_first(
    strong: Sequence[Sequence[Toolpaths]], stiff: Sequence[Sequence[Toolpaths]]
) -> list[list[Toolpaths]]:
    """Candidates for each length: the first design for strength, and all designs for stiffness.

    Each sequence holds the candidates for one length.
    """
    return [[one[0], *others] for one, others in zip(strong, stiff, strict=True)]


def _check_tension(stresses: Sequence[StressField], layers: Sequence[Layer]) -> None:
    """Refuse a part that is under tension nowhere, in no load case."""
    for stress in stresses:
        if any(layer_tension(stress_on(layer, stress)).defined.any() for layer in layers):
            return
    largest = max(float(np.linalg.eigvalsh(stress.stress).max()) for stress in stresses)
    raise InputError(
        "expected tension that fibre can carry; the largest tensile stress found is "
        f"{largest:.3g} MPa, outweighed by compression: turn the load round"
    )
