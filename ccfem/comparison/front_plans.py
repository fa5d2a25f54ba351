"""Planning a part with how much fibre on how many layers: what stiffness and strength follow."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.parallel import one_blas_thread
from ccfem.base.progress import Progress, silent
from ccfem.cases.case import Case
from ccfem.comparison.bounds import presses
from ccfem.comparison.engine import Solved, answer, solved
from ccfem.comparison.expected import Schedule
from ccfem.comparison.front_cases import PointCases
from ccfem.comparison.front_points import FibreFront, FrontPoint
from ccfem.comparison.plan_to_stiffness import counts_to_try
from ccfem.comparison.request import Request, Slicing, Spread
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Tests
from ccfem.fem.elasticity.stress_field import StressField, WeightedCases
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak
from ccfem.judging.virtual_testing.several_cases import specimens
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.paths.planning.strategy import Strategy
from ccfem.slicing.slicers.planar import Planar


@one_blas_thread
def fibre_front(
    case: Case,
    stress: StressField | WeightedCases,
    name: str,
    strategy: Strategy,
    counts: Sequence[int],
    points: int = 5,
    strand: Strand | None = None,
    backend: str = "auto",
    strengths: Sequence[float] = (),
    progress: Progress = silent,
) -> FibreFront:
    """Plan a part to several lengths of fibre on several numbers of layers, and test every plan.

    The largest length fills the largest number of layers; the others follow by one factor down to
    a sixteenth of it. Fewer layers carry more on each at the same length, and reach less at their
    most: a plan that lays its most is one point, however much more was asked for.

    Several load cases are planned for at once and each plan is tested under all. What counts is the
    case that is farthest below what no paths of that length exceed in it alone.

    Parameters
    ----------
    stress : StressField or WeightedCases
        Its solution under the load case that counts, or under several.
    name : str
        Of the strategy.
    counts : sequence of int
        Numbers of flat layers, at least 1 each.
    points : int, default 5
        Lengths, at least 2.
    strand : Strand, optional
        Stiffness and strength of a strand; default rho = EA/E = 4 mm^2.
    backend : str, default "auto"
        As in `solve`.
    strengths : sequence of float in [0, 1], optional
        Plan every length with each of these shares of the load at first failure in what is planned
        for, too; default the strategy as it is.

    Raises
    ------
    InputError
        When a number makes no sense, or the strategy does not plan for strength or finds no plan
        on any number of layers.
    """
    strand = Strand() if strand is None else strand
    cases = WeightedCases.of({stress.case: stress}) if isinstance(stress, StressField) else stress
    if len(cases) > 1:
        specimens(cases, backend)  # one factorisation for all
    known = Solved(case, cases, None, Tests.of(cases.heaviest, None, strand, backend))
    request = Request(case, {name: strategy}, load_case=cases.names[0], strand=strand)
    return front_of(request, counts, points, strengths, progress, known)


def front_of(
    request: Request,
    counts: Sequence[int] | None = None,
    points: int = 5,
    strengths: Sequence[float] = (),
    progress: Progress = silent,
    known: Solved | None = None,
) -> FibreFront:
    """Front of the one strategy of a request.

    Parameters
    ----------
    request : Request
        Its slicings and amount are those of the front.
    counts : sequence of int, optional
        Numbers of flat layers; default those of the part, and twice as many where a strand has
        room in layers half as high.
    points, strengths, progress
        As of `fibre_front`.
    known : Solved, optional
        The case with its stress, if it is solved already.
    """
    ((name, strategy),) = request.strategies.items()
    spread, kinds = Spread(points), _kinds(name, strategy, strengths)
    if counts is not None:
        _check_counts(counts)
    # A front shows the supports of the part alone, and is a curve itself.
    alone = replace(request.case, alternative_supports=())
    request = replace(request, case=alone, curve=False)
    if counts is not None:
        request = replace(request, slicings=_slicings(counts), amount=spread)
    tell = Schedule(progress)
    basis = solved(request, progress=tell) if known is None else known
    if len(basis.cases) > 1 and presses(basis.cases):
        raise InputError(
            "a front over several load cases measures each by its bound, and supports that only "
            "press have none: hold the part otherwise, or name one load case"
        )
    if counts is None:
        counts = counts_to_try(request.case, basis.planned_on)
    slicings = _slicings(counts)
    request = replace(request, strategies=kinds, slicings=slicings, amount=spread)
    tell.steps.clear()  # those of the one number of layers that was solved
    return _front(name, answer(request, tell, replace(basis, limits_only=True)))


def _slicings(counts: Sequence[int]) -> dict[str, Slicing]:
    return {f"{count} layers": Slicing(Planar(count=count)) for count in sorted(set(counts))}


def _check_counts(counts: Sequence[int]) -> None:
    if not counts:
        raise InputError("a front takes at least one number of layers; got none")
    for count in counts:
        check_number("number of layers", count, at_least=1)


def _kinds(name: str, strategy: Strategy, strengths: Sequence[float]) -> dict[str, Strategy]:
    """Strategies that differ in how much strength counts in what they plan for."""
    for_strength = getattr(strategy, "strength", None)
    if for_strength is None and strengths:
        raise InputError(
            f"'{name}' does not plan for strength; stream_function and pruned do: choose one of "
            "them, or leave strengths out"
        )
    if not strengths:
        return {name: strategy}
    changed: Any = strategy
    return {
        f"{name}, strength {strength:g}": replace(changed, strength=strength)
        for strength in sorted(set(strengths))
    }


def _front(name: str, comparison: Comparison) -> FibreFront:
    """Show a comparison of several lengths as a front."""
    counts = _counts(comparison.request)
    refused = {counts[slicing]: reason for slicing, reason in comparison.refused.items()}
    for slicing in comparison.stacks:
        runs = [run for run in comparison.runs if run.slicing == slicing]
        if not any(run.tested for run in runs):
            reasons = (text for run in runs for text in (run.failure, run.untested) if text)
            refused[counts[slicing]] = next(reasons, "no fibre")
    case = comparison.case.name
    tested = [run for run in comparison.runs if run.tested is not None]
    if not tested:
        why = "; ".join(f"{count} layers: {reason}" for count, reason in refused.items())
        raise InputError(f"{name} finds no plan of '{case}': {why}")
    points = tuple(_point(run, comparison) for run in tested)
    fields = comparison.cases.fields
    findings = (*comparison.case.findings, *comparison.stress.findings)
    if not comparison.several_cases:
        alone = ((length, bound.ratio) for length, bound in comparison.bounds.items())
        bare = _bare(fields[0])
        return FibreFront(case, name, points, refused, bare, tuple(alone), (), findings)
    together = tuple(comparison.bounds.items())
    factor = min(_bare(field) / Specimen.of(field).force(field.reactions) for field in fields)
    return FibreFront(case, name, points, refused, factor, (), together, findings)


def _counts(request: Request) -> dict[str, int]:
    """Count the flat layers of each slicing, those without fibre included."""
    slicers: dict[str, Any] = {name: slicing.slicer for name, slicing in request.slicings.items()}
    return {name: int(slicer.count) for name, slicer in slicers.items()}


def _bare(stress: StressField) -> float:
    """Load at which the part without fibre fails in the matrix, N; NaN where it is not known."""
    strength = stress.problem.material.tensile_strength
    if strength is None:
        return float("nan")
    return Specimen.of(stress).force(stress.reactions) * strength / matrix_peak(stress)[0]


def _point(run: Run, comparison: Comparison) -> FrontPoint:
    """Keep what a front shows of a run."""
    tested = run.tested
    assert tested is not None
    assert run.asked is not None
    failure, ratio, bound, cases = tested.failure, tested.bracket.tension.ratio, tested.most, None
    if run.cases and run.cases.bound:
        cases = PointCases.of(run.cases, run.cases.bound)
        ratio = float(cases.ratios[cases.worst])
        bound = float(run.cases.bound.singles[cases.worst])
        every = run.cases.failure
        failure = None if every is None else every.each[int(np.argmin(every.factors))]
    return FrontPoint(
        layers=_counts(comparison.request)[run.slicing],
        asked=run.asked,
        length=run.length,
        ratio=ratio,
        failure=float("nan") if failure is None else failure.load,
        fails_in="" if failure is None else failure.what,
        bound=bound,
        why_not=run.why_not,
        toolpaths=run.toolpaths,
        strength=getattr(run.strategy, "strength", 0.0),
        cases=cases,
        with_fibre=len(comparison.stacks[run.slicing]),
    )
