"""The engine of every comparison: solve, slice, plan each run, judge it, and put it in one table.

`answer` carries out a `Request` from top to bottom. A comparison of strategies, one over slicings,
a plan to a stiffness, a run of a study and a front of fibre are all requests; none has an engine of
its own.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from inspect import signature
from typing import Any

import numpy as np

from ccfem.base.checks import member_name, refuse_keywords
from ccfem.base.errors import InputError, SolveError
from ccfem.base.parallel import beside, has_room_beside, one_blas_thread, processors
from ccfem.base.progress import Progress, silent
from ccfem.cases.case import Case
from ccfem.cases.load_cases import weighted_cases
from ccfem.comparison.bounds import bounded, bounds_of
from ccfem.comparison.curve import Curve, along_curve, one_length_suits
from ccfem.comparison.effort import LONGEST_CURVE, Counts, curve_steps
from ccfem.comparison.expected import Schedule, expected_steps, steps_before_solving
from ccfem.comparison.plan_to_stiffness import plan_to_stiffness
from ccfem.comparison.request import (
    DEFAULT_STRAND,
    STRATEGIES,
    ForeignStress,
    InAll,
    PerLayer,
    Request,
    Shortest,
    Spread,
    Stiffness,
    Wanted,
)
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import (
    Ahead,
    Part,
    Tests,
    all_planned,
    judged,
    natural,
    planned,
    planned_to_lengths,
    side_by_side,
    timed,
    to_length,
    with_breaking_load,
    with_test,
)
from ccfem.fem.elasticity.plausibility import on_quadratic
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import GivenStress, PartStress, StressField, WeightedCases
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad, breaking_load
from ccfem.judging.virtual_testing.several_cases import specimens
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.planning.strategy import Strategy, full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.before_solving import check_support
from ccfem.printing.course import WITHOUT_HALT, Course
from ccfem.printing.line_counts import check_strands
from ccfem.printing.support import SupportLayers, slice_with_support
from ccfem.slicing.layers.layer import curved_layers
from ccfem.slicing.layers.slicer import (
    NO_FIELD,
    Slicer,
    always_curved,
    has_field,
    slicer_remarks,
)
from ccfem.strategies.fibre_aware.smeared import on_linear_cells
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

_REPLACED = {
    "slicing": "layers, a slicer or its name",
    "heights": "layers, a list of heights in mm",
    "machine": "that of the case, dataclasses.replace(case, machine=...)",
    "parameters": "strategies, made with their parameters",
}
"""What takes the place of keywords of the command line that `compare` does not have."""

_ALIKE = 0.005
"""Share by which two lengths differ at least to be two plans."""

_LEAST = 1.0 / 16.0
"""Least of several lengths over the largest: twice as much fibre says the same at every length."""


@dataclass(frozen=True)
class Solved:
    """A case with its stress: what all slicings share."""

    case: Case
    # The load cases that paths are planned for: one, or several with their weights.
    cases: WeightedCases
    given: GivenStress | None = None  # stress of another program to plan and evaluate on
    tests: Tests | None = None  # None if nothing is tested
    # As of `Request`, the last one as of `Part`.
    every_layer: bool = False
    longest_test: float = float("inf")
    course: Course = WITHOUT_HALT
    limits_only: bool = False

    @property
    def field(self) -> StressField:
        """Solution of the load case that counts most."""
        return self.cases.heaviest

    @property
    def planned_on(self) -> PartStress:
        """Stress that paths are planned and evaluated on."""
        return self.field if self.given is None else self.given

    def cut(self, slicer: Slicer | None = None, support: bool = False) -> Part:
        """Cut the part into the layers that get fibre, with support below them if wanted.

        Raises
        ------
        InputError
            Where the part cannot be cut or its layers would have too many strands, or support is
            wanted below flat layers that need none, or below curved ones of a slicer that does not
            say the field of its layers (`slice`).
        """
        case, stress = self.case, self.planned_on
        chosen = case.slicing if slicer is None else slicer
        below: SupportLayers | bool = support
        if support and has_field(chosen):
            layers, below = slice_with_support(chosen, stress, case.build, case.machine)
            if case.fibre is not None:
                layers = case.fibre.on(layers, stress.mesh, case.machine)
        else:
            layers = case.fibre_layers(stress, chosen)
        check_strands(layers, case.machine)
        if support and not curved_layers(layers):
            below = True
            check_support(stress.mesh, layers, case.machine)
        elif below is True:
            raise InputError(NO_FIELD)
        strand = None if self.tests is None else self.tests.strand
        remarks = slicer_remarks(chosen, stress)
        stack = tuple(layers)
        about = (strand, case.build, below, remarks, self.every_layer, self.limits_only)
        more = (self.longest_test, case.bed, self.course, case.plastic, case.scatter)
        return Part(stress, stack, case.machine, self.cases, *about, *more)


@one_blas_thread
def solved(
    request: Request, seconds: dict[str, float] | None = None, progress: Progress = silent
) -> Solved:
    """Solve what is asked for, and prepare what virtual tests need.

    Parameters
    ----------
    seconds : dict of stage to float, optional
        Gets the time of each stage.
    progress : callable, optional
        As of `ccfem.solve`; hears of the solve when nothing is refused any more.

    Raises
    ------
    InputError
        For layers that cannot be cut, a problem that cannot be solved, and stress on another mesh.
    SolveError
        When the solve misses its tolerance.
    """
    seconds = {} if seconds is None else seconds
    case, strand, backend = request.case, request.strand, request.backend
    check_slicings(request)
    foreign = request.stress
    if isinstance(progress, Schedule):
        progress.expect(steps_before_solving(request, progress.command))
    with timed(seconds, "solve"):
        problem = case.printed_problem(request.only_slicer)
        given = None if foreign is None else _stress_on(foreign, problem)
        progress(f"solving {case.name}", 0.0)
        fields = solve(problem, backend=backend, progress=progress, keep=strand is not None)
        if request.all_cases:
            cases = weighted_cases(case, fields)
        else:
            name = request.load_case or case.problem.cases[0]
            cases = WeightedCases.of({name: fields[name]})
    field = cases.heaviest
    if foreign is not None:  # quadratic cells may have been solved instead
        if given is None or field.mesh is not given.mesh:
            given = foreign.on(field.mesh, field.held_or_loaded)
        given = replace(given, material=field.material)
    about = (request.every_layer, request.longest_test, request.course)
    if strand is None:
        return Solved(case, cases, given, None, *about)
    alternative = None
    if case.alternative_supports and len(cases) == 1:
        with timed(seconds, "solve, alternative supports"):
            alternative = otherwise_held(case, field, backend)
    with timed(seconds, "specimens"):
        if len(cases) > 1:
            specimens(cases, backend)  # one factorisation for all
        tests = Tests.of(field, alternative, strand, backend)
    return Solved(case, cases, given, tests, *about)


def _stress_on(foreign: ForeignStress, problem: Problem) -> GivenStress:
    """Stress of another program on the cells of a problem, or on quadratic ones made of them."""
    try:
        return foreign.on(problem.mesh, problem.held_or_loaded)
    except InputError:
        if problem.order != 1 and problem.mesh.order == 1:
            with suppress(InputError):
                return foreign.on(on_quadratic(problem).mesh, problem.held_or_loaded)
        raise


def otherwise_held(case: Case, field: StressField, backend: str) -> StressField:
    """Solution of the same load case under the alternative supports."""
    loads = {field.case: field.problem.loads[field.case]}
    supports = case.alternative_supports
    try:
        problem = replace(field.problem, supports=supports, loads=loads, combinations={})
        return solve(problem, backend)[field.case]
    except InputError as error:
        raise InputError(f"alternative supports: {error}") from None


@one_blas_thread
def answer(
    request: Request,
    progress: Progress = silent,
    known: Solved | None = None,
    parts: Mapping[str, Part] | None = None,
) -> Comparison:
    """Carry out a request.

    Parameters
    ----------
    progress : callable, optional
        Receives what is being done, and the share of the work that is done.
    known : Solved, optional
        The case with its stress, if it is solved already.
    parts : mapping of slicing to Part, optional
        The part with its layers, if it is cut already.

    Raises
    ------
    InputError
        When the part cannot be solved or sliced, or nothing can reach the stiffness asked for. A
        strategy that fails stays in the table, with the reason.
    SolveError
        When the solve misses its tolerance.
    """
    seconds: dict[str, float] = {}
    processors()  # a wrong number is refused here, not as the failure of a strategy
    tell = progress if isinstance(progress, Schedule) else Schedule(progress)
    basis = solved(request, seconds, tell) if known is None else known
    refused: dict[str, str] = {}
    if parts is None:
        with timed(seconds, "slice"):
            parts, refused = _cut(request, basis)
    known_of = {
        name: Counts.of(part.stress.mesh, part.layers, part.machine) for name, part in parts.items()
    }
    tell.expect(expected_steps(request, known_of, len(basis.cases), tell.command))
    early = _Early(request, basis)
    parts, runs, wanted = _planned(request, basis, parts, tell, early)
    tell.expect(_steps_of_curve(request, basis, runs, wanted, tell) or {})
    # One that is left alone has all processors for its layers.
    left = [run for run in runs if run.evaluation is None]
    done = iter(side_by_side("judging {}", early.judged, left, parts, tell))
    runs = [next(done) if run.evaluation is None else run for run in runs]
    bare = None
    if request.breaking_load:
        runs, bare = _broken(request, basis, parts, runs, tell, seconds)
    curve = None
    if _steps_of_curve(request, basis, runs, wanted, tell) is not None:
        curve = _curve(request, basis, parts[""], runs, wanted, tell, seconds)
    about = (request, basis.cases, basis.tests, parts, runs, wanted)
    seconds |= early.seconds
    bounds = bounds_of(*about, tell, seconds, early.bounds)
    runs = [bounded(run, bounds, wanted) for run in runs]
    stacks = {name: part.layers for name, part in parts.items()}
    remarks = tuple(
        f"{name}: {line}" if name else line for name, part in parts.items() for line in part.remarks
    )
    return Comparison(
        request,
        basis.cases,
        stacks,
        tuple(runs),
        wanted,
        seconds,
        refused,
        given=basis.given,
        bounds=bounds,
        curve=curve,
        of_slicers=remarks,
        bare=bare,
    )


@dataclass(frozen=True)
class _Early:
    """Judges runs, also while others are being planned: then with what bounds them."""

    request: Request
    basis: Solved
    # by length, mm: what is bounded already
    bounds: dict[float, UpperBound] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)  # by stage: that this took

    @property
    def judged(self) -> Callable[[Run, Part], Run]:
        """What takes a planned run as far as its virtual test."""
        return partial(judged, prints=self.request.print_plans, tests=self.basis.tests)

    def on(self, part: Part, wanted: Wanted, tell: Schedule) -> Ahead:
        """Judge runs on a part in another process, and bound what any of their length reach."""

        @contextmanager
        def ahead(runs: Sequence[Run]) -> Iterator[Callable[[Sequence[Run]], Sequence[Run]]]:
            def work() -> tuple[list[Run], dict[float, UpperBound], dict[str, float]]:
                done, spent = [self.judged(run, part) for run in runs], dict[str, float]()
                basis = self.basis
                about = (self.request, basis.cases, basis.tests, {"": part}, done, wanted)
                known = {} if wanted is None else bounds_of(*about, lambda _: None, spent)
                return done, known, spent

            names = [f"judging {run.name}" for run in runs]

            def outcome(late: Sequence[Run]) -> Sequence[Run]:
                parts = {run.slicing: part for run in late}
                judged_late = side_by_side("judging {}", self.judged, late, parts, tell)
                for name in dict.fromkeys(names):  # in all, where there was no room before
                    tell(name)
                done, bounds, spent = result()
                self.bounds.update(bounds)
                self.seconds.update(spent)
                return [*done, *judged_late]

            if has_room_beside():
                tell.beside([*names, *["bounding"] * (wanted is not None)])
            with beside(work, shared=[runs, part, self.basis]) as result:
                yield outcome

        return ahead


def _broken(
    request: Request,
    basis: Solved,
    parts: Mapping[str, Part],
    runs: list[Run],
    tell: Schedule,
    seconds: dict[str, float],
) -> tuple[list[Run], BreakingLoad | None]:
    """Break every run, and the part without fibre."""
    assert request.strand is not None
    try:
        with timed(seconds, "breaking load without fibre"):
            specimen = Specimen.of(on_linear_cells(basis.field, request.backend))
            # Without fibre the part has no layers of its own: those of the runs, if they are one's.
            (first, *others) = parts.values()
            layers = () if others else first.layers
            bare = breaking_load(None, specimen, request.strand, layers=layers)
    except (InputError, SolveError) as error:
        return [replace(run, unbroken=str(error)) for run in runs], None
    test = partial(with_breaking_load, specimen=specimen, strand=request.strand)
    return side_by_side("breaking {}", test, runs, parts, tell), bare


def _cut(request: Request, basis: Solved) -> tuple[dict[str, Part], dict[str, str]]:
    """Part cut in each way, and why it cannot be cut in others.

    The only way to cut a part is not optional: its error is raised.
    """
    if not request.named:
        return {"": basis.cut(request.slicings[""].slicer, request.support)}, {}
    thickness = _own_thickness(request, basis)
    parts: dict[str, Part] = {}
    refused: dict[str, str] = {}
    for name, slicing in request.slicings.items():
        slicer: Any = slicing.slicer
        if slicing.as_thick:
            slicer = replace(slicer, count=None, thickness=thickness)
        try:
            part = basis.cut(slicer)
        except InputError as error:
            refused[name] = str(error)
            continue
        if part.layers:
            parts[name] = part
        else:
            refused[name] = "it has no layer"
    if not parts:
        raise _no_slicing(request, refused)
    return parts, refused


def check_slicings(request: Request) -> None:
    """Refuse layers that cannot be cut or planned on, before anything is solved.

    Raises
    ------
    InputError
        For the only way to cut the part; of several, where none can.
    """
    refused: dict[str, str] = {}
    for name, slicing in request.slicings.items():
        try:
            if not slicing.as_thick:  # of which the part's own layers decide
                request.case.check_layers(slicing.slicer)
                _check_curved(request, slicing.slicer)
        except InputError as error:
            # What is read from files is what the request names, not what the part allows.
            if not request.named or (slicing.slicer and always_curved(slicing.slicer)):
                raise
            refused[name] = str(error)
    if len(refused) == len(request.slicings):
        raise _no_slicing(request, refused)


def _check_curved(request: Request, slicer: Slicer | None) -> None:
    """Refuse layers that are curved where no strategy plans on such."""
    chosen = request.case.slicing if slicer is None else slicer
    planners = request.strategies.values()
    if always_curved(chosen) and all(getattr(s, "flat_layers_only", False) for s in planners):
        raise InputError(
            f"{', '.join(request.strategies)} plans on flat layers only, and those of "
            f"{member_name(chosen)} are curved: choose a planar slicing, or a strategy for curved "
            "layers"
        )


def _no_slicing(request: Request, refused: Mapping[str, str]) -> InputError:
    reasons = "; ".join(f"{name}: {why}" for name, why in refused.items())
    return InputError(f"no slicing could cut '{request.case.name}': {reasons}")


def _own_thickness(request: Request, basis: Solved) -> float:
    """Mean thickness of the layers of the part's own slicing, mm; NaN where nobody asks for it."""
    if not any(slicing.as_thick for slicing in request.slicings.values()):
        return float("nan")
    case = request.case
    layers = case.slicing(basis.planned_on, case.build, case.machine)
    return float(np.mean([layer.thickness for layer in layers]))


_Plans = tuple[Mapping[str, Part], list[Run], Wanted]
"""The part as it is cut, its runs, and the length that all are held to."""


def _planned(
    request: Request, basis: Solved, parts: Mapping[str, Part], tell: Schedule, early: _Early
) -> _Plans:
    """Plan every strategy on every slicing to the amount that is asked for.

    A stiffness chooses among numbers of layers; every other amount leaves the slicings as they are.
    """
    amount = request.amount
    if isinstance(amount, Stiffness):
        part, run, held = plan_to_stiffness(request, parts[""], basis.cut, tell)
        return {"": part}, [run], held
    unplanned = {name: _unplanned(request, name, part) for name, part in parts.items()}
    if isinstance(amount, Spread):
        return parts, _spread(unplanned, parts, amount.points, tell, early), None
    if isinstance(amount, Shortest):
        return parts, *_to_the_shortest(request, unplanned, parts, tell, early)
    wanted, runs = _per_layer(amount, parts), list[Run]()
    for name, part in parts.items():
        plan = partial(planned, part=part, wanted=wanted[name], tell=tell)
        runs += all_planned(unplanned[name], plan, early.on(part, wanted[name], tell))
    if not request.named:
        return parts, runs, wanted[""]
    return parts, runs, amount if isinstance(amount, InAll) else None


def _to_the_shortest(
    request: Request,
    unplanned: Mapping[str, Sequence[Run]],
    parts: Mapping[str, Part],
    tell: Schedule,
    early: _Early,
) -> tuple[list[Run], Wanted]:
    """Plan all runs to the shortest natural length of any; with them that length."""
    alone = {name: natural(unplanned[name], part, tell) for name, part in parts.items()}
    lengths = {
        name: runs[setter].length_per_layer * len(parts[name].layers)
        for name, (runs, setter) in alone.items()
        if setter is not None
    }
    if not lengths:
        return [run for runs, _ in alone.values() for run in runs.values()], None
    first = min(lengths, key=lengths.__getitem__)
    in_all, runs = lengths[first], []
    for name, (of_slicing, setter) in alone.items():
        sets = setter if name == first else None
        length = in_all / len(parts[name].layers)
        if sets is not None:
            least = length = of_slicing[sets].length_per_layer
        part = parts[name]
        runs += to_length(of_slicing, sets, length, part, tell, early.on(part, length, tell))
    return runs, InAll(in_all) if request.named else least


def _spread(
    unplanned: Mapping[str, Sequence[Run]],
    parts: Mapping[str, Part],
    points: int,
    tell: Schedule,
    early: _Early,
) -> list[Run]:
    """Plan every strategy on every slicing to several lengths, the largest filling most layers.

    Fewer layers reach less at their most: a plan that lays its most is one run, however much more
    was asked for. Runs on one slicing are judged while those on the next are planned.
    """
    most = max(len(part.layers) * full_length(part.layers, part.machine) for part in parts.values())
    lengths = np.geomspace(_LEAST * most, most, points)
    done: list[Callable[[], Sequence[Run]]] = []
    *_, last = parts
    with ExitStack() as judging:
        for name, part in parts.items():
            per_layer, runs = (lengths / len(part.layers)).tolist(), list[Run]()
            for run in unplanned[name]:
                tell(f"planning {run.name}")
                length = -1.0
                for longer in planned_to_lengths(run, part, per_layer):
                    if longer.length_per_layer > (1.0 + _ALIKE) * length:
                        length = longer.length_per_layer
                        runs.append(longer)
            if name == last:
                done.append(partial(list[Run], runs))
            else:
                done.append(partial(judging.enter_context(early.on(part, None, tell)(runs)), ()))
        return [run for outcome in done for run in outcome()]


def _unplanned(request: Request, slicing: str, part: Part) -> list[Run]:
    """Make the runs of all strategies on one slicing, before anything is planned."""
    return [
        Run(
            request.on_slicing(name, slicing),
            strategy.on(part.layers) if isinstance(strategy, GivenPaths) else strategy,
            Toolpaths.empty(),
            None,
            slicing=slicing,
        )
        for name, strategy in request.strategies.items()
    ]


def _per_layer(amount: Any, parts: Mapping[str, Part]) -> dict[str, float | None]:
    """Length per layer, mm, that is asked for on each slicing; None for the natural amount."""
    if isinstance(amount, InAll):
        return {name: amount.length / max(len(part.layers), 1) for name, part in parts.items()}
    length = amount.length if isinstance(amount, PerLayer) else None
    return dict.fromkeys(parts, length)


def _steps_of_curve(
    request: Request, basis: Solved, runs: Sequence[Run], wanted: Wanted, tell: Schedule
) -> dict[str, float] | None:
    """Expect a curve where it is asked for, or where one length suits not all; else None.

    On large parts only where it is asked for.
    """
    if request.named or basis.tests is None or request.curve is False or len(basis.cases) > 1:
        return None
    planned = [name for name, s in request.strategies.items() if not isinstance(s, GivenPaths)]
    steps = curve_steps(tell.steps, planned)
    long = sum(steps.values()) > LONGEST_CURVE
    return None if request.curve is None and (long or one_length_suits(runs, wanted)) else steps


def _curve(
    request: Request,
    basis: Solved,
    part: Part,
    runs: Sequence[Run],
    wanted: Wanted,
    tell: Schedule,
    seconds: dict[str, float],
) -> Curve:
    """Compare at several lengths."""
    tests, held = basis.tests, None if isinstance(wanted, InAll) else wanted
    assert tests is not None
    with timed(seconds, "curve"):
        unchanged = [
            replace(run, strategy=before.strategy)
            for run, before in zip(runs, _unplanned(request, "", part), strict=True)
        ]
        return along_curve(unchanged, part, held, partial(with_test, tests=tests), tell)


def compare(
    case: Case | str | os.PathLike[str],
    strategies: Mapping[str, Strategy] | Sequence[str | Strategy] = STRATEGIES,
    layers: int | Sequence[float] | str | Slicer | None = None,
    fibre_per_layer: float | None = None,
    natural: bool = False,
    strand: Strand | None = DEFAULT_STRAND,
    load_case: str | None = None,
    backend: str = "auto",
    print_plans: bool = False,
    support: bool = False,
    stress: ForeignStress | None = None,
    curve: bool | None = None,
    progress: Progress = silent,
    slicings: Mapping[str, Slicer] | Sequence[str | Slicer] | None = None,
    fibre: float | None = None,
    stiffness: str | None = None,
    course: Course = WITHOUT_HALT,
    breaking_load: bool = False,
    **unknown: Any,
) -> Comparison:
    """Solve a case once, and plan and evaluate each strategy on it.

    Strategies are compared at equal length of fibre, since more fibre wins almost any comparison.
    If no length is given, it is the shortest natural length of any strategy. All others are thinned
    to it, each by its own parameter (`LayerStrategy.amount`). Paths of another program
    (`GivenPaths`) are never changed: the shortest of their lengths then applies to all, and their
    heights are those of the layers if no others are given. A strategy that fails stays in the
    result, with the reason. With `slicings` all lay the same length in all, whatever the number of
    layers.

    Parameters
    ----------
    case : Case, str or path
        A case, the name of one, or a part file.
    strategies : sequence of str or Strategy, or mapping of name to Strategy
        Strategies given by name take the parameters of the case.
    layers : int, sequence of float, str or Slicer, optional
        Instead of the case's own slicing: a number of flat layers, their heights along the build
        direction in mm, the name of a slicer, or a slicer.
    slicings : sequence of str or Slicer, or mapping of name to Slicer, optional
        Ways to cut the part, instead of `layers`, such as ``["planar:z", "planar:x", "spatial"]``.
    fibre_per_layer, fibre : float, mm, optional
        Length that every strategy is held to, as a mean over the layers or in all of them.
    natural : bool, default False
        Let every strategy lay its own amount instead.
    stiffness : str, optional
        Lay the least fibre that reaches it, by one strategy: a ratio to the stiffness of the part
        without fibre as ``"2.5"``, or ``"1200N/mm"``.
    strand, load_case, stress, backend, curve, print_plans, support, course, breaking_load
        As in `Request`.
    progress : callable, optional
        Receives what is being done, and the share of the work that is done.
    **unknown
        Refused: a keyword that there is not.

    Raises
    ------
    InputError
        When the case, the name of a strategy or its parameters are invalid, for what does not go
        together, or when a print is asked for that the machine cannot do.
    SolveError
        When the solve misses its tolerance.
    """
    refuse_keywords("compare", unknown, list(signature(compare).parameters)[:-1], _REPLACED)
    request = Request.of(
        case,
        strategies,
        layers,
        slicings,
        fibre_per_layer,
        fibre,
        natural,
        stiffness,
        load_case=load_case,
        strand=strand,
        stress=stress,
        backend=backend,
        curve=curve,
        print_plans=print_plans,
        support=support,
        course=course,
        breaking_load=breaking_load,
    )
    return answer(request, progress)
