"""Stages of a comparison: each returns a more complete `Run`, or one with the reason of failure."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ccfem.base.arrays import IntArray
from ccfem.base.errors import InputError, SolveError
from ccfem.base.parallel import give_back, has_room_beside, in_processes
from ccfem.comparison.request import MOST_LAYERS
from ccfem.comparison.runs import Run, Tested
from ccfem.comparison.tested_cases import ENERGY, RESIDUAL, in_all_cases
from ccfem.fem.elasticity.stress_field import PartStress, StressField, WeightedCases
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.evaluation import layer_indices
from ccfem.judging.evaluation.strand_rules import StrandVerdict, strand_verdict, why_not
from ccfem.judging.virtual_testing.anchorage import Anchorage
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.pinned_joints import pinned_joints, pins_not_judged
from ccfem.judging.virtual_testing.progressive_failure import breaking_load
from ccfem.judging.virtual_testing.scatter import DEFAULT_SCATTER, Scatter, ratio_scatter
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_bracket
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import Strands, carrying_strands
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.machine.machine import Machine
from ccfem.paths.planning.alike import alike_layers
from ccfem.paths.planning.equal_fibre import (
    TOLERANCE,
    length_per_layer,
    plan_to_length,
    plan_to_lengths,
    sampled_length,
)
from ccfem.paths.planning.given_paths import GivenPaths, pattern_that_folds
from ccfem.paths.planning.layer_plans import plan, plans_alike
from ccfem.paths.planning.strategy import LengthStrategy, Planned, Strategy
from ccfem.paths.plastic.plastic import SOLID, Plastic
from ccfem.paths.splitting.printed_strands import printed_strands
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import AS_IT_STANDS, BedLayout
from ccfem.printing.before_solving import in_air, refusal
from ccfem.printing.course import WITHOUT_HALT, Course, on_course
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import plan_print
from ccfem.printing.print_totals import print_totals
from ccfem.printing.support import SupportLayers
from ccfem.printing.together import arranged
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import curved_layers
from ccfem.strategies.fibre_aware.plan_cases import plan_cases, plan_cases_to_lengths

Tell = Callable[[str], None]
"""Receives what is done next."""

_UNLIKE = 1.3
"""Factor on the least length of all, on a few layers, above which a strategy is not planned to its
own amount."""

_AHEAD = 4
"""Runs that are judged while others are being planned: it takes about as long."""


@dataclass(frozen=True)
class Part:
    """A part cut into layers, with all that its runs share."""

    # That paths are planned and evaluated on; of several load cases that of the heaviest.
    stress: PartStress
    layers: tuple[Layer, ...]
    machine: Machine
    # The load cases that paths are planned for and tested under: one, or several.
    cases: WeightedCases
    strand: Strand | None = None
    build: tuple[float, float, float] | None = None
    # Printed below curved layers; of flat ones, whether it is printed below what they would lay in
    # air.
    support: SupportLayers | bool = False
    remarks: tuple[str, ...] = ()  # of the slicer, one line each
    # Whether all indices are taken on every layer, and every layer is planned.
    every_layer: bool = False
    # Whether indices that no limit of the machine bounds are taken on one layer: nobody asks for
    # them.
    limits_only: bool = False
    # mm: length of fibre above which a run is not tested virtually
    longest_test: float = float("inf")
    layout: BedLayout = AS_IT_STANDS  # turn, place and copies on the bed
    course: Course = WITHOUT_HALT  # where a print begins and halts
    plastic: Plastic = SOLID  # walls, skins, infill and seam of its print
    scatter: Scatter = DEFAULT_SCATTER  # how far prints of it differ

    @property
    def flat_layers(self) -> tuple[Layer, ...]:
        """Its layers, if they are flat."""
        return () if curved_layers(self.layers) else self.layers

    @cached_property
    def refusal(self) -> str:
        """Why no print of it is planned, whatever its paths are; else empty."""
        build = self.build or (0.0, 0.0, 1.0)
        return refusal(self.stress.mesh, build, self.machine, self.flat_layers, self.layout)

    @cached_property
    def why_not_printable(self) -> tuple[str, ...]:
        """What keeps it from being printed, whatever is planned."""
        layers = () if self.support else self.flat_layers
        air = in_air(self.stress.mesh, self.machine, layers)
        return tuple(filter(None, (self.refusal, air)))

    @cached_property
    def alike(self) -> IntArray | None:
        """Position of the layer whose paths each may take; None where every layer is planned."""
        if self.every_layer or len(self.layers) <= MOST_LAYERS or self.several_cases:
            return None
        return alike_layers(self.layers, self.stress)

    @cached_property
    def layer_indices(self) -> list[dict[str, float]]:
        """Indices that its layers have whatever the paths are."""
        return layer_indices(**self.evaluated_on)

    @property
    def evaluated_on(self) -> dict[str, Any]:
        """What `evaluate` takes beside the paths."""
        return {
            "layers": self.layers,
            "stress": self.stress,
            "machine": self.machine,
            "strand": self.strand,
            "build": self.build,
            "most": 1 if self.limits_only else None if self.every_layer else MOST_LAYERS,
            "filled": self.cases.heaviest.problem.filled,
        }

    def tests(self, run: Run) -> bool:
        """Whether a run is tested virtually."""
        return self.strand is not None and run.toolpaths.lengths.sum() <= self.longest_test

    @property
    def several_cases(self) -> bool:
        """Whether paths are planned for more than one load case."""
        return len(self.cases) > 1


def side_by_side(
    what: str, work: Callable[..., Run], runs: Sequence[Run], parts: Mapping[str, Part], tell: Tell
) -> list[Run]:
    """Carry runs further, in processes where there are several.

    Parameters
    ----------
    what : str
        What is done with a run, as in "evaluating {}".
    work : callable
        Takes a run and the part.
    """
    done: list[Run] = []
    results = in_processes(work, runs, [parts[run.slicing] for run in runs], shared=[work])
    for run in runs:
        tell(what.format(run.name))
        done.append(next(results))
    give_back()
    return done


def planned(
    run: Run, part: Part, wanted: float | None, tell: Tell, start: Planned | None = None
) -> Run:
    """Plan a strategy to a length per layer, mm, from a known plan, or to its natural amount."""
    if run.failure:
        return run
    tell(f"planning {run.name}" + ("" if wanted is None else f" to {wanted:.0f} mm a layer"))

    def work() -> Run:
        layers, stress, machine = part.layers, part.stress, part.machine
        if isinstance(run.strategy, GivenPaths):
            paths = run.strategy.toolpaths
            length = length_per_layer(paths, layers)
            outcome = Planned(run.strategy, paths, length, _as_given(length, wanted))
        elif part.several_cases:
            outcome = plan_cases(run.strategy, layers, part.cases, machine, wanted, part.strand)
        elif wanted is None:
            paths = plan(run.strategy, layers, stress, machine, part.alike)
            outcome = Planned(run.strategy, paths, length_per_layer(paths, layers))
        else:
            outcome = plan_to_length(
                *(run.strategy, layers, stress, machine, wanted, start),
                sampled=run.sampled,
                alike=part.alike,
            )
        return with_plan(run, outcome, part)

    bare = replace(run, toolpaths=Toolpaths.empty(), length_per_layer=0.0)
    done = _stage(bare, "plan", work)
    give_back()
    return done


def with_plan(run: Run, plan: Planned, part: Part) -> Run:
    """Run with the strands that are printed of a plan, and their length."""
    run = replace(
        run,
        strategy=plan.strategy,
        toolpaths=plan.toolpaths,
        length_per_layer=plan.length_per_layer,
        strands=None,
        strand_verdict=StrandVerdict(),
        unprinted="",
        note=plan.note,
        planned_layers=_planned_layers(plan.strategy, part),
    )
    if not len(plan.toolpaths):
        return run
    try:
        strands = printed_strands(plan.toolpaths, part.layers, part.stress.mesh, part.machine)
    except InputError as error:
        return replace(run, unprinted=str(error))
    run = replace(run, strands=strands)
    if not strands.warnings:
        return run
    length = length_per_layer(strands.fibre, part.layers)
    return replace(run, toolpaths=strands.fibre, length_per_layer=length)


def _planned_layers(strategy: Strategy, part: Part) -> int:
    """Count the layers that are planned, where others take their paths; else 0."""
    if part.alike is None or not plans_alike(strategy):
        return 0
    count = len(set(part.alike.tolist()))
    return count if count < len(part.layers) else 0


def attempted(run: Run, work: Callable[[], Run]) -> Run:
    """Run returned by `work`; if it fails, `run` with the reason."""
    return _stage(run, "plan", work)


def planned_to_lengths(
    run: Run, part: Part, lengths: Sequence[float], known: Sequence[Planned] = ()
) -> list[Run]:
    """Plan a strategy to several lengths per layer, mm; a failure is in all of the runs.

    Parameters
    ----------
    run : Run
        Unplanned.
    lengths : sequence of float, mm
    known : sequence of Planned
        Plans that exist already, as of `plan_to_lengths`; not used with several load cases.
    """
    plans: list[Planned] = []
    layers, machine = part.layers, part.machine

    def work() -> Run:
        if part.several_cases:
            about = (run.strategy, layers, part.cases, machine, lengths, part.strand)
            plans.extend(plan_cases_to_lengths(*about))
        else:
            plans.extend(
                plan_to_lengths(
                    *(run.strategy, layers, part.stress, machine, lengths, known), alike=part.alike
                )
            )
        return run

    done = attempted(run, work)
    if done.failure:
        return [replace(done, asked=length) for length in lengths]
    return [
        replace(with_plan(done, plan, part), asked=length)
        for plan, length in zip(plans, lengths, strict=True)
    ]


def _as_given(length: float, wanted: float | None) -> str:
    """Note on given paths, which are not changed, if they miss the wanted length, mm per layer."""
    if wanted is None or abs(length / wanted - 1.0) <= TOLERANCE:
        return ""
    return f"given paths stay as they are: lays {length:.0f} of {wanted:.0f} mm per layer"


def natural(runs: Sequence[Run], part: Part, tell: Tell) -> tuple[dict[str, Run], str | None]:
    """Plan runs to their natural amounts; return them by name, and the name of the least one.

    Strategies that take the length itself, and those that lay much more than others on a few
    layers, are planned only if they lay least. The name is None if no run lays fibre.
    """
    natural_runs: dict[str, Run] = {}
    for run in runs:
        some = any(len(one.toolpaths) for one in natural_runs.values())
        natural_runs[run.name] = _sampled(run, part, tell) if some else _by_itself(run, part, tell)
    return natural_runs, _setter(natural_runs, part, tell)


def _by_itself(run: Run, part: Part, tell: Tell) -> Run:
    """Run planned to its natural amount, unless its strategy takes the length itself."""
    by_length = isinstance(run.strategy, LengthStrategy)
    return run if by_length else planned(run, part, None, tell)


def _sampled(run: Run, part: Part, tell: Tell) -> Run:
    """Run with the length it lays on a few layers; fully planned if these are all layers."""
    if isinstance(run.strategy, LengthStrategy | GivenPaths) or run.failure:
        return _by_itself(run, part, tell)
    tell(f"planning {run.name} on a few layers")

    def work() -> Run:
        length = sampled_length(run.strategy, part.layers, part.stress, part.machine)
        return replace(run, sampled=length)

    sampled = _stage(run, "plan", work)
    # Layers that stay empty tell nothing about others.
    return sampled if sampled.failure or sampled.sampled else _by_itself(sampled, part, tell)


Ahead = Callable[[Sequence[Run]], AbstractContextManager[Callable[[Sequence[Run]], Sequence[Run]]]]
"""Judges planned runs in another process; given more, judges these here, and gives all back."""


def all_planned(runs: Sequence[Run], plan: Callable[[Run], Run], ahead: Ahead) -> list[Run]:
    """Plan runs; those whose strategy takes the length itself, which takes longest, come last.

    Beside these, some of the others are judged; then all are that this is done for.
    """
    late = {run.name for run in runs if isinstance(run.strategy, LengthStrategy)}
    done = {run.name: plan(run) for run in runs if run.name not in late}
    first = list(done.values())[:_AHEAD]
    if late and first and has_room_beside():
        with ahead(first) as judged_ahead:
            done |= {
                run.name: run
                for run in judged_ahead([plan(run) for run in runs if run.name in late])
            }
    else:
        done |= {run.name: plan(run) for run in runs if run.name in late}
    return [done[run.name] for run in runs]


def to_length(
    natural: Mapping[str, Run],
    setter: str | None,
    length: float | None,
    part: Part,
    tell: Tell,
    ahead: Ahead,
) -> list[Run]:
    """Plan runs to a length per layer, mm, from their natural amounts.

    Parameters
    ----------
    natural : mapping of name to Run
        Planned to their natural lengths.
    setter : str, optional
        Name of the run whose natural length this is; it is not planned again.
    length : float, mm, optional
        None if no run lays fibre.
    """

    def level(run: Run) -> Run:
        if run.name == setter:
            given = isinstance(run.strategy, GivenPaths)
            how = "given" if given else "has the shortest natural length"
            return replace(run, note=f"{how}, so all are compared at this length")
        start = Planned(run.strategy, run.toolpaths, run.length_per_layer)
        return planned(run, part, length, tell, start if len(run.toolpaths) else None)

    runs = list(natural.values())
    return runs if length is None else all_planned(runs, level, ahead)


def _setter(natural_runs: dict[str, Run], part: Part, tell: Tell) -> str | None:
    """Name of the run whose natural length applies to all; it is planned afterwards."""
    while True:
        natural, least = {}, {}  # least: the length that the run may turn out to lay
        for name, run in natural_runs.items():
            if len(run.toolpaths):
                natural[name] = least[name] = run.length_per_layer
            elif isinstance(run.strategy, LengthStrategy) and not run.failure:
                natural[name] = run.strategy.natural_length(part.layers, part.machine)
                least[name] = natural[name]
            elif run.sampled and not run.failure:
                natural[name], least[name] = run.sampled, run.sampled / _UNLIKE
        given = [name for name in natural if isinstance(natural_runs[name].strategy, GivenPaths)]
        setter = min(given or natural, key=least.__getitem__, default=None)
        if setter is None or len(natural_runs[setter].toolpaths):
            return setter
        by_length = isinstance(natural_runs[setter].strategy, LengthStrategy)
        run = planned(natural_runs[setter], part, natural[setter] if by_length else None, tell)
        nothing = not run.failure and not len(run.toolpaths)
        natural_runs[setter] = replace(run, failure=_no_fibre(part.machine)) if nothing else run


def _no_fibre(machine: Machine) -> str:
    return (
        "laid no fibre: the layers, or their areas in tension, are too small for the shortest "
        f"strand of the machine, {machine.shortest_strand:g} mm: check that all lengths are in mm"
    )


def judged(run: Run, part: Part, prints: bool, tests: "Tests | None") -> Run:
    """Evaluate what was planned, plan its print if that is wanted, and test it; once."""
    if run.evaluation is not None:
        return run
    run = evaluated(run, part)
    give_back()
    run = with_print(run, part) if prints else run
    return run if tests is None else with_test(run, part, tests)


def evaluated(run: Run, part: Part) -> Run:
    """Evaluate what was planned, or say why there is nothing to evaluate."""
    if run.failure:
        return run
    if not len(run.toolpaths):
        lost = () if run.strands is None else run.strands.warnings
        why = f"no strand is left to print: {lost[0]}" if lost else _no_fibre(part.machine)
        return replace(run, failure=why)

    def work() -> Run:
        evaluation = evaluate(run.toolpaths, **part.evaluated_on, of_layers=part.layer_indices)
        # Who planned given paths is not known, but where their file says so.
        by_design = bool(pattern_that_folds(run.strategy, run.name))
        what = (run.toolpaths, part.layers, part.machine, by_design)
        rules = strand_verdict(*what, with_parts=part.tests(run))
        reasons = [
            *filter(None, [run.unprinted]),
            *part.why_not_printable,
            *(rule.words for rule in rules.broken),
            *why_not(evaluation.total, part.machine),
        ]
        why = "; ".join(reasons)
        return replace(run, evaluation=evaluation, strand_verdict=rules, why_not=why)

    return _stage(run, "evaluate", work)


def with_print(run: Run, part: Part) -> Run:
    """Plan the print of the whole part, or say why it cannot be printed."""
    if run.evaluation is None or run.strands is None:
        return run
    if part.refusal:
        return replace(run, unprinted=part.refusal)  # said in `why_not` since the evaluation
    try:
        plan = plan_print(
            run.strands,
            part.layers,
            part.stress.mesh,
            part.machine,
            part.support,
            part.layout.spin,
            part.plastic,
            part.build or (0.0, 0.0, 1.0),
        )
        give_back()
        plan = on_course(arranged([plan], [part.layout], part.machine), part.course, part.machine)
        # Before there are moves: this takes as much memory for a moment.
        share = plan.volume(part.machine) / (plan.copies * float(part.stress.mesh.volumes.sum()))
        moves = part_moves(plan, part.machine)
        give_back()
    except InputError as error:
        why = "; ".join(filter(None, (str(error), run.why_not)))
        return replace(run, unprinted=str(error), why_not=why)
    totals = print_totals(moves, part.machine)
    plan = replace(plan, warnings=(*plan.warnings, *totals.words))
    return replace(run, print_plan=plan, moves=moves, print_totals=totals, printed_volume=share)


@dataclass(frozen=True)
class Tests:
    """Data for the virtual tests of a part, made once, with one factorisation for each model."""

    strand: Strand
    # The part under its supports, and under alternative ones if there are any, each with the peak
    # of the averaged von Mises stress without fibre, MPa.
    models: Sequence[tuple[Specimen, float]] = ()
    refused: str = ""  # why the part cannot be tested; else empty

    @classmethod
    def of(
        cls, stress: StressField, alternative: StressField | None, strand: Strand, backend: str
    ) -> "Tests":
        """Make the specimens of a solution, and of that under alternative supports."""
        fields = [stress] if alternative is None else [stress, alternative]
        try:
            return cls(strand, [(Specimen.of(field, backend), _peak(field)) for field in fields])
        except InputError as error:
            return cls(strand, refused=str(error))


def _peak(stress: StressField) -> float:
    """Peak of the averaged von Mises stress, MPa; NaN where it cannot be judged."""
    try:
        return matrix_peak(stress)[0]
    except InputError:
        return float("nan")


def with_test(run: Run, part: Part, tests: Tests) -> Run:
    """Test a run virtually under one or two models of the supports, or say why it cannot be."""
    if tests.refused:
        return replace(run, untested=tests.refused)
    if run.evaluation is None:
        return run
    if not part.tests(run):
        metres = run.toolpaths.lengths.sum() / 1000.0
        most = part.longest_test / 1000.0
        why = f"{metres:.0f} m of fibre, above {most:.0f} m only by --virtual-test"
        return replace(run, untested=why)

    def work() -> Run:
        mesh = tests.models[0][0].unreinforced.mesh
        about = (run.strategy, part.layers, mesh, part.machine, run.strand_verdict.parts)
        strands = carrying_strands(run.toolpaths, *about)
        tests_done = [_test(strands, *model, tests.strand, part) for model in tests.models]
        both = replace(tests_done[0], alternative=[*tests_done[1:], None][0])
        if part.several_cases:
            every = in_all_cases(strands, part.cases, tests.strand, part.layers, part.machine)
            both = replace(both, cases=every)
        return replace(run, tested=both)

    return _stage(run, "virtual test", work, reason="untested")


def _test(
    strands: Strands, specimen: Specimen, before: float, strand: Strand, part: Part
) -> Tested:
    """Test strands in every mode, and find what fails first."""
    bracket = virtual_bracket(strands, specimen, strand, (), tolerance=RESIDUAL, energy=ENERGY)
    test = bracket.tension
    scatter = ratio_scatter(test, part.scatter, part.build or (0.0, 0.0, 1.0))
    try:
        failure = first_failure(test, strand, layers=part.layers)
    except InputError as error:
        return Tested(bracket, None, str(error), scatter=scatter)
    limits = Limits.of(test.solution.problem.material, strand)
    pins = test.solution, specimen.forces, test.force
    return Tested(
        bracket,
        failure,
        matrix_before=before,
        scatter=scatter,
        joints=pinned_joints(*pins, limits, Anchorage.of(strands, part.machine)),
        pins_not_judged=pins_not_judged(*pins),
    )


def with_breaking_load(run: Run, part: Part, specimen: Specimen, strand: Strand) -> Run:
    """Break a run's part on linear cells, or say why it cannot be broken."""
    if run.evaluation is None or run.untested:
        return run

    def work() -> Run:
        mesh = specimen.unreinforced.mesh
        about = (run.strategy, part.layers, mesh, part.machine, run.strand_verdict.parts)
        strands = carrying_strands(run.toolpaths, *about)
        return replace(run, broken=breaking_load(strands, specimen, strand, layers=part.layers))

    return _stage(run, "breaking load", work, reason="unbroken")


def _stage(run: Run, stage: str, work: Callable[[], Run], reason: str = "failure") -> Run:
    """Run returned by `work`; if it fails, `run` with the reason in that field."""
    seconds = dict(run.seconds)
    try:
        with timed(seconds, stage):
            done = work()
    except (InputError, SolveError) as error:
        outcome: Any = {reason: str(error)}
        done = replace(run, **outcome)
    return replace(done, seconds=seconds)


@contextmanager
def timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Add the time of the block to the seconds of a stage."""
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
