"""What any paths of the lengths that runs lay could reach."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ccfem.base.parallel import in_processes
from ccfem.comparison.ranking import off_length
from ccfem.comparison.request import Request, Spread, Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Part, Tell, Tests, timed
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.elasticity.support_kinds import PressingSupport
from ccfem.strategies.fibre_aware.upper_bound import LOOSE, UpperBound, upper_bound

_SAME_BOUND, _SAME_CASES_BOUND = 1.002, 1.01
"""Largest length over the shortest for which one bound is taken, that of the largest; a bound of
several load cases takes several times as long as one of one."""


def bounds_of(
    request: Request,
    cases: WeightedCases,
    tests: Tests | None,
    parts: Mapping[str, Part],
    runs: Sequence[Run],
    wanted: Wanted,
    tell: Tell,
    seconds: dict[str, float],
    known: Mapping[float, UpperBound] = MappingProxyType({}),
) -> dict[float, UpperBound]:
    """Bound what any paths can reach, by the length of fibre in all, mm.

    Empty if no run of the wanted length was tested, for supports that hold in one sense only, and
    where slicings are compared. Slicings that differ in the number of flat layers alone, as those
    of several lengths do, are bounded on the most layers.

    Parameters
    ----------
    known : mapping of length, mm, to UpperBound
        Bounds that need not be computed again.
    """
    equal = [run for run in runs if run.tested is not None and not off_length(run, wanted)]
    several_lengths = isinstance(request.amount, Spread)
    if request.named and not several_lengths:
        return {}
    part = max(parts.values(), key=lambda part: len(part.layers))
    if not request.bound or tests is None or not equal or presses(cases):
        return {}
    several, strand = len(cases) > 1, tests.strand
    fibre = [float(run.toolpaths.lengths.sum()) for run in equal]
    lengths = [max(fibre)]
    if several_lengths:
        lengths = _lengths_to_bound(fibre, _SAME_CASES_BOUND if several else _SAME_BOUND)
    of = " in all load cases" if several else ""
    bounds = {length: known[length] for length in lengths if length in known}

    def bound(taken: Sequence[float], near: Sequence[Sequence[UpperBound]]) -> None:
        """Bound lengths, from the densities found for those beside each if there are some."""
        results = in_processes(
            lambda length, beside: upper_bound(
                *(cases, part.layers, length, part.machine, strand),
                # What lies between the runs is there for the curve alone.
                gap=LOOSE if beside and not several else None,
                start=np.sum([one.density for one in beside], axis=0) if beside else None,
            ),
            taken,
            near,
        )
        for length in taken:
            tell(f"bounding what any paths of {1e-3 * length:.3g} m could reach{of}")
            bounds[length] = next(results)

    with timed(seconds, "bound"):
        left = [length for length in lengths if length not in bounds]
        bound(left, [()] * len(left))
        if several_lengths:
            beside = {
                0.5 * (shorter + longer): [bounds[one] for one in (shorter, longer) if one]
                for shorter, longer in itertools.pairwise([0.0, *sorted(lengths)])
            }
            bound(list(beside), list(beside.values()))
    return {length: bounds[length] for length in sorted(bounds)}


def presses(cases: WeightedCases) -> bool:
    """Whether a support holds in one sense only, so that nothing is bounded."""
    supports = [support for field in cases.fields for support in field.problem.supports]
    return any(isinstance(support, PressingSupport) for support in supports)


def _lengths_to_bound(lengths: Sequence[float], alike: float) -> list[float]:
    """Lengths of runs to be bounded, mm; those within the factor `alike` share the largest."""
    taken: list[float] = []
    for length in sorted(lengths, reverse=True):
        if not taken or alike * length < taken[-1]:
            taken.append(length)
    return sorted(taken)


def bounded(run: Run, bounds: Mapping[float, UpperBound], wanted: Wanted) -> Run:
    """Run with the most that paths of its length can reach."""
    length = float(run.toolpaths.lengths.sum())
    enough = [longer for longer in bounds if longer >= length]
    if not enough or run.tested is None or off_length(run, wanted):
        return run
    bound = bounds[min(enough)]
    if run.cases:
        tested = replace(run.tested, cases=replace(run.cases, bound=bound))
    else:
        tested = replace(run.tested, most=bound.ratio)
    return replace(run, tested=tested)
