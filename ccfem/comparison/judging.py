"""What becomes of planned runs on one stack of layers: evaluated, printed, tested, bounded."""

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
from ccfem.errors import InputError
from ccfem.fibre_aware.upper_bound import UpperBound, upper_bound
from ccfem.layers import Layer
from ccfem.layers.slicer import Slicer
from ccfem.planning.given_paths import GivenPaths
from ccfem.support import SupportLayers, slice_with_support

__all__ = ["Solved", "judged"]

_BOUND_ITERATIONS = 7
"""The bound holds after any number of iterations; more than these lower it by half a per cent."""


@dataclass(frozen=True)
class Solved:
    """A case with its stress: what all stacks of layers share.

    Attributes
    ----------
    case : Case
    field : StressField
        Of the load case that counts.
    given : GivenStress, optional
        Stress of another program to plan and evaluate on.
    tests : Tests, optional
        None where nothing is tested.
    """

    case: Case
    field: StressField
    given: GivenStress | None = None
    tests: Tests | None = None

    @property
    def planned_on(self) -> PartStress:
        """Stress that paths are planned and evaluated on."""
        return self.field if self.given is None else self.given

    def cut(
        self, slicer: Slicer, support: bool = False
    ) -> tuple[tuple[Layer, ...], SupportLayers | None]:
        """Layers, and if wanted those of their support.

        Raises
        ------
        InputError
            Where the part cannot be cut, or support is wanted below flat layers.
        """
        stress, build, machine = self.planned_on, self.case.build, self.case.machine
        below = None
        if support and hasattr(slicer, "slice"):
            stack, below = slice_with_support(slicer, stress, build, machine)
        else:
            stack = slicer(stress, build, machine)
        if support and all(layer.flat is not None for layer in stack):
            raise InputError(
                "support is printed below curved layers alone; these are flat: leave out support, "
                "or choose curved layers (--slicing load_oriented or spatial)"
            )
        return stack, below

    def part(self, layers: Sequence[Layer], support: SupportLayers | None = None) -> Part:
        """Return what all runs on a stack of layers share."""
        strand = None if self.tests is None else self.tests.strand
        case = self.case
        return Part(self.planned_on, tuple(layers), case.machine, strand, case.build, support)


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
        The same with the strategies as they were asked for.
    wanted : float, mm, or None
        Length per layer that they were held to.
    tell : callable
    curve : bool, optional
        As in `ccfem.compare`.
    bounded : bool
        Whether to bound what any paths could reach.
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
        if curve or (curve is None and _misses(runs, wanted)):
            with timed(seconds, "curve"):
                along = _curve(runs, asked_for, part, wanted, solved.tests, tell)
    if bounded:
        bound = _bound(solved, part, runs, wanted, tell, seconds)
        if bound is not None:
            runs = [_bounded(run, bound, wanted) for run in runs]
    case, field, given = solved.case, solved.field, solved.given
    return Comparison(case, field, part.layers, tuple(runs), wanted, seconds, bound, given, along)


def _bounded(run: Run, bound: UpperBound, wanted: float | None) -> Run:
    """Run with the most that paths of its length can reach."""
    if run.tested is None or off_length(run, wanted):
        return run
    return replace(run, tested=replace(run.tested, most=bound.ratio))


def _misses(runs: Sequence[Run], wanted: float | None) -> bool:
    """Whether a strategy lays another length than the wanted one, since it cannot lay that."""
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
    """Bound the stiffness that any paths could reach with as much fibre as the runs lay.

    None where no run of the wanted length was tested, for curved layers, and for supports that do
    not hold both ways.
    """
    equal = [run for run in runs if run.tested is not None and not off_length(run, wanted)]
    field, layers = solved.field, part.layers
    pressing = any(isinstance(each, PressingSupport) for each in field.problem.supports)
    flat = all(layer.flat is not None for layer in layers)
    if solved.tests is None or not equal or pressing or not flat:
        return None
    tell("bounding what any paths could reach")
    longest = max(float(run.toolpaths.lengths.sum()) for run in equal)
    with timed(seconds, "bound"):
        return upper_bound(
            field, layers, longest, part.machine, solved.tests.strand, iterations=_BOUND_ITERATIONS
        )
