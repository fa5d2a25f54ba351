"""Evaluation, printing, testing and bounding of planned runs on one stack of layers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ccfem.cases.case import Case
from ccfem.comparison.curve import Curve
from ccfem.comparison.curve_stages import along_curve
from ccfem.comparison.ranking import off_length
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import (
    Part,
    Tell,
    Tests,
    all_tested,
    evaluated,
    timed,
    with_print,
)
from ccfem.elasticity.part_stress import GivenStress, PartStress
from ccfem.elasticity.stress_field import StressField
from ccfem.elasticity.support_kinds import PressingSupport
from ccfem.elasticity.weighted_cases import WeightedCases
from ccfem.errors import InputError
from ccfem.fibre_aware.upper_bound import UpperBound, upper_bound
from ccfem.layers import Layer
from ccfem.layers.slicer import Slicer
from ccfem.layers.slicing.planar import Planar
from ccfem.planning.given_paths import GivenPaths
from ccfem.support import SupportLayers, slice_with_support

__all__ = ["Solved", "check_propped", "judged"]

_FLAT = (
    "support is printed below curved layers alone; these are flat: leave out support, or choose "
    "curved layers (--slicing load_oriented or spatial)"
)


def check_propped(slicer: Slicer, support: bool) -> None:
    """Raise where support is wanted below layers that are flat, before anything is solved."""
    if support and isinstance(slicer, Planar):
        raise InputError(_FLAT)


@dataclass(frozen=True)
class Solved:
    """A case with its stress: the data shared by all stacks of layers.

    Attributes
    ----------
    case : Case
    field : StressField
        Of the load case that counts.
    given : GivenStress, optional
        Stress of another program to plan and evaluate on.
    tests : Tests, optional
        None if nothing is tested.
    cases : WeightedCases, optional
        If paths are planned for several load cases.
    """

    case: Case
    field: StressField
    given: GivenStress | None = None
    tests: Tests | None = None
    cases: WeightedCases | None = None

    @property
    def planned_on(self) -> PartStress:
        """Stress that paths are planned and evaluated on."""
        return self.field if self.given is None else self.given

    def cut(
        self, slicer: Slicer | None = None, support: bool = False
    ) -> tuple[tuple[Layer, ...], SupportLayers | None]:
        """Layers that get fibre, by the part's own slicer or another, and their support if wanted.

        Raises
        ------
        InputError
            Where the part cannot be cut, or support is wanted below flat layers, or below curved
            ones of a slicer that does not say the field of its layers (`slice`).
        """
        case, stress, below = self.case, self.planned_on, None
        chosen = case.slicing if slicer is None else slicer
        check_propped(chosen, support)
        if support and hasattr(chosen, "slice"):
            stack, below = slice_with_support(chosen, stress, case.build, case.machine)
            if case.fibre is not None:
                stack = case.fibre.on(stack, stress.mesh, case.machine)
        else:
            stack = case.fibre_layers(stress, chosen)
        if support and all(layer.flat is not None for layer in stack):
            raise InputError(_FLAT)
        if support and below is None:
            raise InputError(
                "support continues the field whose levels the layers are, and these layers were "
                "given without one: leave out support, or choose --slicing load_oriented or spatial"
            )
        return stack, below

    def part(self, layers: Sequence[Layer], support: SupportLayers | None = None) -> Part:
        """Return what all runs on a stack of layers share."""
        strand = None if self.tests is None else self.tests.strand
        case = self.case
        stack, cases = tuple(layers), self.cases
        return Part(self.planned_on, stack, case.machine, strand, case.build, cases, support)


def judged(
    solved: Solved,
    part: Part,
    runs: Sequence[Run],
    asked_for: Sequence[Run],
    wanted: float | None,
    tell: Tell,
    curve: bool | None = None,
    bounded: bool = True,
    print_plans: bool = False,
    seconds: dict[str, float] | None = None,
) -> Comparison:
    """Evaluate and test planned runs on one stack of layers.

    Parameters
    ----------
    solved : Solved
    part : Part
    runs : sequence of Run
        Planned.
    asked_for : sequence of Run
        The same runs, with the strategies as they were asked for.
    wanted : float, mm, or None
        Length per layer that the runs were held to.
    tell : callable
    curve : bool, optional
        As in `ccfem.compare`.
    bounded : bool
        Whether to compute the bound on what any paths can reach.
    print_plans : bool
    seconds : dict of stage to float, optional
        Of the stages before.
    """
    seconds = {} if seconds is None else seconds
    runs = [evaluated(run, part, tell) for run in runs]
    if print_plans:
        runs = [with_print(run, part, tell) for run in runs]
    along, bound = None, None
    if solved.tests is not None:
        runs = all_tested(runs, solved.tests, part, tell)
        one_case = solved.cases is None
        if curve or (curve is None and one_case and _misses(runs, wanted)):
            with timed(seconds, "curve"):
                along = _curve(runs, asked_for, part, wanted, solved.tests, tell)
    together = None
    if bounded and solved.cases is not None:
        together = _bound_of_cases(solved, solved.cases, part, runs, wanted, tell, seconds)
        if together is not None:
            runs = [_bounded_cases(run, together, wanted) for run in runs]
    elif bounded:
        bound = _bound(solved, part, runs, wanted, tell, seconds)
        if bound is not None:
            runs = [_bounded(run, bound, wanted) for run in runs]
    case, field, given = solved.case, solved.field, solved.given
    stack, cases = part.layers, solved.cases
    return Comparison(
        case, field, stack, tuple(runs), wanted, seconds, bound, given, along, cases, together
    )


def _bounded_cases(run: Run, bound: UpperBound, wanted: float | None) -> Run:
    """Run with the bound of several load cases."""
    if run.tested is None or run.tested.cases is None or off_length(run, wanted):
        return run
    return replace(run, tested=replace(run.tested, cases=replace(run.tested.cases, bound=bound)))


def _bounded(run: Run, bound: UpperBound, wanted: float | None) -> Run:
    """Run with the most that paths of its length can reach."""
    if run.tested is None or off_length(run, wanted):
        return run
    return replace(run, tested=replace(run.tested, most=bound.ratio))


def _misses(runs: Sequence[Run], wanted: float | None) -> bool:
    """Whether a strategy lays a length other than the wanted one, since it cannot lay that."""
    return any(
        off_length(run, wanted) and not isinstance(run.strategy, GivenPaths)
        for run in runs
        if run.evaluation is not None
    )


def _curve(
    runs: Sequence[Run],
    asked_for: Sequence[Run],
    part: Part,
    wanted: float | None,
    tests: Tests,
    tell: Tell,
) -> Curve:
    """Compare at several lengths, with the strategies as they were asked for."""
    asked = [
        replace(run, strategy=each.strategy) for run, each in zip(runs, asked_for, strict=True)
    ]
    return along_curve(
        asked, part, wanted, lambda some: all_tested(some, tests, part, tell, ()), tell
    )


def _bound(
    solved: Solved,
    part: Part,
    runs: Sequence[Run],
    wanted: float | None,
    tell: Tell,
    seconds: dict[str, float],
) -> UpperBound | None:
    """Bound the stiffness that any paths can reach with as much fibre as the runs lay.

    None if no run of the wanted length was tested, for curved layers, and for supports that hold in
    one sense only.
    """
    longest = _longest_bounded(solved, part, runs, wanted)
    if longest is None or solved.tests is None:
        return None
    tell("bounding what any paths could reach")
    with timed(seconds, "bound"):
        return upper_bound(solved.field, part.layers, longest, part.machine, solved.tests.strand)


def _bound_of_cases(
    solved: Solved,
    cases: WeightedCases,
    part: Part,
    runs: Sequence[Run],
    wanted: float | None,
    tell: Tell,
    seconds: dict[str, float],
) -> UpperBound | None:
    """Bound what any paths can reach in all load cases together; None as in `_bound`."""
    longest = _longest_bounded(solved, part, runs, wanted)
    if longest is None or solved.tests is None:
        return None
    tell("bounding what any paths could reach in all load cases")
    with timed(seconds, "bound"):
        return upper_bound(cases, part.layers, longest, part.machine, solved.tests.strand)


def _longest_bounded(
    solved: Solved, part: Part, runs: Sequence[Run], wanted: float | None
) -> float | None:
    """Most fibre of the runs that a bound holds for, mm; None where there is no bound."""
    equal = [run for run in runs if run.tested is not None and not off_length(run, wanted)]
    fields = (solved.field,) if solved.cases is None else solved.cases.fields
    supports = [support for field in fields for support in field.problem.supports]
    pressing = any(isinstance(each, PressingSupport) for each in supports)
    flat = all(layer.flat is not None for layer in part.layers)
    if solved.tests is None or not equal or pressing or not flat:
        return None
    return max(float(run.toolpaths.lengths.sum()) for run in equal)
