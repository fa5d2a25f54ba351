"""The verdict of a comparison: one sentence on which strategy is best, and in what respect."""

from collections.abc import Sequence

import numpy as np

from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import off_length, order_of, ranking, stiffness_ratio
from ccfem.comparison.request import InAll, Wanted
from ccfem.comparison.runs import Run
from ccfem.virtual_testing.stiffer import RESOLUTION, SAME, UNDECIDED

__all__ = ["verdict"]


def verdict(runs: Sequence[Run], wanted: Wanted) -> str:
    """Say in one sentence which strategy is best, in what respect, and at how much fibre.

    Only runs count that can be printed and have the wanted length. "No difference" is stated if the
    best differ by less than the resolution of the test. "Undecided" is stated if tension-only and
    bonded fibres, or the supports of the part and its alternative ones, disagree on the order of
    the best and any other.

    Parameters
    ----------
    runs : sequence of Run
    wanted : float, mm, InAll or None
        Length of fibre per layer, or in total, that all were held to; None if each laid its own.

    Returns
    -------
    str
        Empty if fewer than two runs are left.
    """
    order = [run for run in ranking(runs, wanted) if run.evaluation is not None]
    kept = [run for run in order if run.printable and not off_length(run, wanted)]
    if len(kept) < 2:
        return ""
    said = _of_printable(kept, wanted)
    off = [
        f"{run.name} (lays {_laid(run, wanted)})"
        for run in order
        if run.printable and off_length(run, wanted)
    ]
    if said and off:
        said += f" Not at that length: {', '.join(off)}."
    left = [run.name for run in order if not run.printable]
    return f"{said} Not printable as planned: {', '.join(left)}." if said and left else said


def _of_printable(order: Sequence[Run], wanted: Wanted) -> str:
    first, second = order[0], order[1]
    if first.tested is None or second.tested is None:
        return _by_efficiency(first, second, wanted)
    tested = [run for run in order[1:] if run.tested is not None]
    unclear = [run for run in tested if order_of(first, run) == UNDECIDED]
    same = [run for run in tested if order_of(first, run) == SAME]
    both = first.tested.alternative is not None
    if unclear:
        group = [first, *(run for run in tested if run in unclear or run in same)]
        return (
            f"Undecided between {_names(group)}, {_amount(wanted)}: "
            f"{_ratios(group)} times the unreinforced stiffness where fibres carry tension only, "
            f"{_ratios(group, 'bonded')} where they are bonded{_under_other(group)}."
        )
    if same:
        group = [first, *same]
        return (
            f"No difference between {_names(group)}, {_amount(wanted)}: "
            f"{_ratios(group)} times the unreinforced stiffness, within {RESOLUTION:.0%}, the "
            f"resolution of the test{', under both models of the supports' if both else ''}."
        )
    gain = stiffness_ratio(first) / stiffness_ratio(second)
    return (
        f"{first.name} makes the stiffest part, {_amount(wanted)}: "
        f"{stiffness_ratio(first):.2f} times the unreinforced one, and {gain:.2f} times "
        f"{second.name} (predicted, fibres carrying tension only; no other is stiffer with bonded "
        f"fibres{', or under the alternative supports' if both else ''})."
    )


def _by_efficiency(first: Run, second: Run, wanted: Wanted) -> str:
    best, following = (headline_values(run)["efficiency"] for run in (first, second))
    if not np.isfinite(best):
        return "No verdict: there is no virtual test, and no fibre lies in tension."
    then = f", then {second.name} with {following:.3f}" if np.isfinite(following) else ""
    return (
        f"By efficiency alone (no virtual test): {first.name} with {best:.3f}{then}, "
        f"{_amount(wanted)}."
    )


def _names(runs: Sequence[Run]) -> str:
    names = [run.name for run in runs]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _ratios(runs: Sequence[Run], mode: str = "tension") -> str:
    ratios = [f"{stiffness_ratio(run, mode):.2f}" for run in runs]
    return f"{', '.join(ratios[:-1])} and {ratios[-1]}"


def _under_other(runs: Sequence[Run]) -> str:
    """Say the same of the alternative supports, where there are some."""
    if not all(run.tested is not None and run.tested.alternative is not None for run in runs):
        return ""
    return (
        f"; under the alternative supports {_ratios(runs, 'tension_alternative')} (tension only), "
        f"{_ratios(runs, 'bonded_alternative')} (bonded)"
    )


def _laid(run: Run, wanted: Wanted) -> str:
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
