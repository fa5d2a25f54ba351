"""The verdict of a comparison: one sentence on which strategy is best, and in what respect."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import (
    ALTERNATIVES,
    all_have,
    is_tested,
    lost_in_scatter,
    merit,
    off_length,
    order_of,
    ranking,
    scatter_between,
    stiffness_ratio,
)
from ccfem.comparison.request import InAll, Wanted
from ccfem.comparison.runs import Run
from ccfem.judging.virtual_testing.equilibrium import PARTIAL, TENSION
from ccfem.judging.virtual_testing.stiffness_test import FIRST, RESOLUTION, SAME


def verdict(runs: Sequence[Run], wanted: Wanted) -> str:
    """Say in one sentence which strategy is best, in what respect, and at how much fibre.

    Only runs count that can be printed and have the wanted length. One is the stiffest if it is
    stiffer than every other of them by more than the resolution of the test and twice the scatter
    between them, fibres carrying tension only, and none is stiffer with some compression in them or
    under the alternative supports, as the table shows them (`order_of`). "No difference" is stated
    if all stiffnesses of the best agree within the resolution; else the best are "undecided". Runs
    that do not count are named, with those that are stiffer than the best.

    Parameters
    ----------
    wanted : float, mm, InAll or None
        Length of fibre per layer, or in total, that all were held to; None if each laid its own.

    Returns
    -------
    str
        Empty if fewer than two runs are left.
    """
    kept = comparable(runs, wanted)
    if len(kept) < 2:
        return ""
    tested = [run for run in kept if is_tested(run)]
    if len(tested) < 2:
        return _by_efficiency(kept, wanted) + left_out(runs, wanted)
    return _by_stiffness(tested, wanted) + left_out(runs, wanted, tested[0])


def comparable(runs: Sequence[Run], wanted: Wanted) -> list[Run]:
    """Select the runs that can be printed and have the wanted length, the best first."""
    return [run for run in ranking(runs, wanted) if run.printable and not off_length(run, wanted)]


def left_out(runs: Sequence[Run], wanted: Wanted, best: Run | None = None) -> str:
    """Name the runs that a verdict does not count, and which of them are stiffer than the best.

    Parameters
    ----------
    wanted : float, mm, InAll or None
    best : Run, optional
        Best of the runs that count; without it no run is called stiffer or untested.
    """
    order = [run for run in ranking(runs, wanted) if run.evaluation is not None]
    reasons = {
        "Not tested": [run.name for run in comparable(runs, wanted) if best and not is_tested(run)],
        "Not at that length": [
            f"{run.name} (lays {_fibre(run, wanted)}{', stiffer' if _stiffer(run, best) else ''})"
            for run in order
            if run.printable and off_length(run, wanted)
        ],
        "Not printable as planned": [
            f"{run.name}{' (stiffer)' if _stiffer(run, best) else ''}"
            for run in order
            if not run.printable
        ],
    }
    return "".join(f" {what}: {', '.join(names)}." for what, names in reasons.items() if names)


def _stiffer(run: Run, best: Run | None) -> bool:
    """Whether a run that does not count is stiffer than the best, in tension only."""
    if best is None or run.tested is None or best.tested is None:
        return False
    cases = [compared.cases for compared in (run, best)]
    if len({case is None or case.bound is None for case in cases}) > 1:
        return False  # a share of the bound, which another length has none of, against a ratio
    return merit(run) > merit(best)


def _by_stiffness(order: Sequence[Run], wanted: Wanted) -> str:
    first, second = order[0], order[1]
    both, group = all_have(order, ALTERNATIVES[0]), not_behind(order)
    if len(group) == 1:
        gain = stiffness_ratio(first) / stiffness_ratio(second)
        return (
            f"{first.name} makes the stiffest part, {_amount(wanted)}: "
            f"{stiffness_ratio(first):.2f} times the unreinforced one, and {gain:.2f} times "
            f"{second.name} (predicted, fibres carrying tension only; no other is stiffer with "
            f"some compression{', or under the alternative supports' if both else ''})."
        )
    if all_same(group):
        return (
            f"No difference between {_names(group)}, {_amount(wanted)}: "
            f"{_ratios(group)} times the unreinforced stiffness, within {RESOLUTION:.0%}, the "
            f"resolution of the test{', under both models of the supports' if both else ''}."
        )
    return (
        f"Undecided between {_names(group)}, {_amount(wanted)}: "
        f"{_ratios(group)} times the unreinforced stiffness where fibres carry tension only, "
        f"{_ratios(group, PARTIAL)} with some compression{_under_other(group)}{_lost(group)}."
    )


def not_behind(order: Sequence[Run]) -> list[Run]:
    """First of the ranked runs, and all that it is not clearly ahead of."""
    return [*order[:1], *(run for run in order[1:] if order_of(order[0], run) != FIRST)]


def all_same(runs: Sequence[Run]) -> bool:
    """Whether no two of some runs differ."""
    return all(order_of(*pair) == SAME for pair in combinations(runs, 2))


def _by_efficiency(runs: Sequence[Run], wanted: Wanted) -> str:
    known = {run.name: headline_values(run)["efficiency"] for run in runs}
    order = sorted((name for name in known if np.isfinite(known[name])), key=lambda n: -known[n])
    why = "fewer than two have a virtual test" if any(map(is_tested, runs)) else "no virtual test"
    if not order:
        reason = why if any(map(is_tested, runs)) else "there is no virtual test"
        return f"No verdict: {reason}, and no fibre lies in tension."
    then = f", then {order[1]} with {known[order[1]]:.3f}" if len(order) > 1 else ""
    best = f"{order[0]} with {known[order[0]]:.3f}"
    return f"By efficiency alone ({why}): {best}{then}, {_amount(wanted)}."


def _names(runs: Sequence[Run]) -> str:
    names = [run.name for run in runs]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _ratios(runs: Sequence[Run], mode: str = TENSION) -> str:
    ratios = [f"{stiffness_ratio(run, mode):.2f}" for run in runs]
    return f"{', '.join(ratios[:-1])} and {ratios[-1]}"


def _under_other(runs: Sequence[Run]) -> str:
    """Say the same of the alternative supports, where the table shows it."""
    names = dict(zip(ALTERNATIVES, ("tension only", "some compression"), strict=True))
    sentences = [
        f"{_ratios(runs, mode)} ({name})" for mode, name in names.items() if all_have(runs, mode)
    ]
    return f"; under the alternative supports {', '.join(sentences)}" if sentences else ""


def _lost(runs: Sequence[Run]) -> str:
    """Say which of the best runs the first is ahead of, but for what prints scatter."""
    first, *others = runs
    sentences = [
        f"{stiffness_ratio(first) / stiffness_ratio(run):.2f} ± {scatter_between(first, run):.1%} "
        f"times {run.name}"
        for run in others
        if lost_in_scatter(first, run)
    ]
    return f"; prints scatter too much: {first.name} is {', '.join(sentences)}" if sentences else ""


def _fibre(run: Run, wanted: Wanted) -> str:
    """Say how much fibre a run lays, in the terms of what was wanted."""
    if isinstance(wanted, InAll):
        return f"{1e-3 * run.length:.2f} m"
    return f"{run.length_per_layer:.0f} mm"


def _amount(wanted: Wanted) -> str:
    """Say how much fibre runs lay, where they were held to a length."""
    if wanted is None:
        return "each with its own amount of fibre"
    if isinstance(wanted, InAll):
        return f"with {1e-3 * wanted.length:.2f} m of fibre in all"
    return f"at {wanted:.0f} mm of fibre per layer"
