"""Planning a part with how much fibre on how many layers: what stiffness and strength follow."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from ccfem.cases.case import Case
from ccfem.checks import check_number
from ccfem.comparison.front_cases import PointCases
from ccfem.comparison.front_points import FibreFront, FrontPoint
from ccfem.comparison.judging import Solved
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import (
    Part,
    Tell,
    Tests,
    all_tested,
    attempted,
    counted,
    evaluated,
    with_plan,
)
from ccfem.elasticity.stress_field import StressField
from ccfem.elasticity.weighted_cases import WeightedCases
from ccfem.errors import InputError
from ccfem.fibre_aware.plan_cases import plan_cases_to_lengths
from ccfem.fibre_aware.upper_bound import UpperBound, upper_bound
from ccfem.layers.slicing.planar import Planar
from ccfem.planning.equal_fibre import plan_to_lengths
from ccfem.planning.strategy import Strategy
from ccfem.planning.whole_part import full_length
from ccfem.progress import Progress, silent
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.several_cases import specimens
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strength import matrix_peak

__all__ = ["counts_to_try", "fibre_front"]

_ALIKE = 0.005
"""Share by which two lengths differ at least to be two points."""

_LEAST = 1.0 / 16.0
"""Least length over the largest: twice as much fibre says the same at every length."""

_SAME_BOUND, _SAME_CASES_BOUND = 1.002, 1.01
"""Largest length over the shortest for which one bound is taken, that of the largest; a bound of
several load cases takes several times as long as one of one."""

_Bound = TypeVar("_Bound")


def counts_to_try(case: Case, stress: StressField) -> tuple[int, ...]:
    """Numbers of flat layers worth trying: the part's own, and twice as many where they have room.

    A layer has to be as high as a strand is (`Machine.strand_height`).
    """
    own = case.slicing(stress, case.build, case.machine)
    if any(layer.flat is None for layer in own):
        raise InputError(
            f"a front is of flat layers, those of '{case.name}' are curved: give --layers"
        )
    least = min(layer.thickness for layer in own)
    room = 0.5 * least >= case.machine.strand_height
    return (len(own), 2 * len(own)) if room else (len(own),)


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
    case : Case
    stress : StressField or WeightedCases
        Its solution under the load case that counts, or under several.
    name : str
        Of the strategy.
    strategy : Strategy
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
    progress : callable

    Raises
    ------
    InputError
        When a number makes no sense, or the strategy does not plan for strength or finds no plan
        on any number of layers.
    """
    check_number("points", points, at_least=2)
    if not counts:
        raise InputError("a front takes at least one number of layers; got none")
    for count in counts:
        check_number("number of layers", count, at_least=1)
    strand = Strand() if strand is None else strand
    field, cases = (stress, None) if isinstance(stress, StressField) else (stress.heaviest, stress)
    if cases is not None:
        specimens(cases, backend)  # one factorisation for all
    solved = Solved(case, field, None, Tests.of(field, None, strand, backend), cases)
    slices = {count: case.fibre_layers(field, Planar(count=count)) for count in sorted(set(counts))}
    parts = {count: solved.part(layers) for count, layers in slices.items()}
    most = max(count * full_length(part.layers, case.machine) for count, part in parts.items())
    lengths = np.geomspace(_LEAST * most, most, points)
    kinds = _kinds(name, strategy, strengths)
    tell = counted(progress, 0.1, (1 + 2 * points) * len(parts) * len(kinds) + 2 * points)
    runs: list[tuple[int, float, float, Run]] = []
    refused: dict[int, str] = {}
    for count, part in parts.items():
        for strength, kind in kinds.items():
            tell(f"planning {name} on {count} layers")
            bare = Run(name, kind, Toolpaths.empty(), None)
            planned = _planned(bare, part, (lengths / count).tolist())
            tested = all_tested(
                [evaluated(run, part, tell) for _, run in planned], _of(solved), part, tell, ()
            )
            kept = [
                (count, strength, asked, run)
                for (asked, _), run in zip(planned, tested, strict=True)
                if run.tested
            ]
            if not kept:
                refused[count] = next(
                    (said for run in tested for said in (run.failure, run.untested) if said),
                    "no fibre",
                )
            runs += kept
    if not runs:
        why = "; ".join(f"{count} layers: {reason}" for count, reason in refused.items())
        raise InputError(f"{name} finds no plan of '{case.name}': {why}")
    laid, finest = [run.length for *_, run in runs], parts[max(parts)]
    if cases is None:
        ratios = _bounds(laid, _SAME_BOUND, lambda length: _most(field, finest, length), tell)
        found, bounds = _points(runs, ratios), tuple(sorted(ratios.items()))
        return FibreFront(case.name, name, found, refused, _bare(field), bounds)
    together = _bounds(
        laid, _SAME_CASES_BOUND, lambda length: _most_of_cases(cases, finest, length), tell
    )
    found, several = _points(runs, together), tuple(sorted(together.items()))
    factor = min(_bare(each) / Specimen.of(each).force(each.reactions) for each in cases.fields)
    return FibreFront(case.name, name, found, refused, factor, cases_bounds=several)


def _kinds(name: str, strategy: Strategy, strengths: Sequence[float]) -> dict[float, Strategy]:
    """Strategies by how much strength counts in what they plan for."""
    own = getattr(strategy, "strength", None)
    if own is None and strengths:
        raise InputError(
            f"'{name}' does not plan for strength; stream_function and pruned do: choose one of "
            "them, or leave strengths out"
        )
    if not strengths:
        return {0.0 if own is None else own: strategy}
    changed: Any = strategy
    return {each: replace(changed, strength=each) for each in sorted(set(strengths))}


def _bounds(
    lengths: Sequence[float], alike: float, bound: Callable[[float], _Bound], tell: Tell
) -> dict[float, _Bound]:
    """Bound what no paths exceed, by length, mm: of every plan, and between them for the curve.

    Lengths within the factor `alike` share a bound, that of the largest.
    """
    taken: list[float] = []
    for length in sorted(lengths, reverse=True):
        if not taken or alike * length < taken[-1]:
            taken.append(length)
    between = [0.5 * (a + b) for a, b in itertools.pairwise([*taken, 0.0])]
    found = {}
    for length in sorted([*taken, *between]):
        tell(f"bounding {length / 1000.0:.3g} m")
        found[length] = bound(length)
    return found


def _bare(stress: StressField) -> float:
    """Load at which the part without fibre fails in the matrix, N; NaN where it is not known."""
    strength = stress.problem.material.tensile_strength
    if strength is None:
        return float("nan")
    return Specimen.of(stress).force(stress.reactions) * strength / matrix_peak(stress)[0]


def _most(stress: StressField, part: Part, length: float) -> float:
    """Ratio that no paths of a length, mm, exceed."""
    return upper_bound(stress, part.layers, length, part.machine, part.strand).ratio


def _most_of_cases(cases: WeightedCases, part: Part, length: float) -> UpperBound:
    """Return what no paths of a length, mm, exceed under several load cases."""
    return upper_bound(cases, part.layers, length, part.machine, part.strand)


def _of(solved: Solved) -> Tests:
    assert solved.tests is not None
    return solved.tests


def _planned(bare: Run, part: Part, lengths: Sequence[float]) -> list[tuple[float, Run]]:
    """Plans of different length, each with what was asked for; one that says why there is none."""
    found = []

    def work() -> Run:
        strategy, layers, machine, cases = bare.strategy, part.layers, part.machine, part.cases
        if cases is None:
            found.extend(plan_to_lengths(strategy, layers, part.stress, machine, lengths))
        else:
            several = plan_cases_to_lengths(strategy, layers, cases, machine, lengths, part.strand)
            found.extend(several)
        return bare

    done = attempted(bare, work)
    if done.failure:
        return [(lengths[0], done)]
    kept: list[tuple[float, Run]] = []
    for asked, each in zip(lengths, found, strict=True):
        last = kept[-1][1].length_per_layer if kept else 0.0
        if each.length_per_layer > (1.0 + _ALIKE) * last:
            kept.append((asked, with_plan(bare, each)))
    return kept or [(lengths[0], with_plan(bare, found[0]))]


def _points(
    runs: Sequence[tuple[int, float, float, Run]], bounds: Mapping[float, float | UpperBound]
) -> tuple[FrontPoint, ...]:
    """Points of runs, each with the bound of the least length that is no less than its own."""
    least = (min(each for each in bounds if each >= run.length) for *_, run in runs)
    return tuple(_point(*one, bounds[length]) for one, length in zip(runs, least, strict=True))


def _point(
    count: int, strength: float, asked: float, run: Run, bound: float | UpperBound
) -> FrontPoint:
    """Keep what the front shows of a run."""
    tested = run.tested
    assert tested is not None
    failure, ratio, cases = tested.failure, tested.bracket.tension.ratio, None
    if isinstance(bound, UpperBound):
        assert tested.cases is not None
        cases = PointCases.of(tested.cases, bound)
        ratio, most = float(cases.ratios[cases.worst]), float(bound.singles[cases.worst])
        every = tested.cases.failure
        failure = None if every is None else every.each[int(np.argmin(every.factors))]
    else:
        most = bound
    return FrontPoint(
        layers=count,
        asked=asked,
        length=run.length,
        ratio=ratio,
        failure=float("nan") if failure is None else failure.load,
        fails_in="" if failure is None else failure.what,
        bound=most,
        why_not=run.why_not,
        toolpaths=run.toolpaths,
        strength=strength,
        cases=cases,
    )
