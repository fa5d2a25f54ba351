"""The order of the runs of a comparison, and where an order cannot be told."""

from collections.abc import Sequence

import numpy as np

from ccfem.comparison.headline import HEADLINE, headline_values
from ccfem.comparison.runs import Run
from ccfem.planning.equal_fibre import TOLERANCE
from ccfem.virtual_testing.stiffer import FIRST, SAME, UNDECIDED, stiffer

__all__ = ["best_values", "order_of", "ranking", "stiffness_ratio", "stiffness_ratios", "too_long"]


def ranking(runs: Sequence[Run], wanted: float | None) -> tuple[Run, ...]:
    """Return the runs from the best to the worst, failed ones last.

    By the predicted stiffness with fibres that carry tension only; those without a virtual test
    come after, by efficiency. Runs that cannot be printed as they are stand below all that can,
    and among these a run that lays more than the wanted fibre below all that do not.

    Parameters
    ----------
    runs : sequence of Run
    wanted : float, mm, or None
        Length of fibre per layer that all were held to; None where each laid its own.
    """

    def score(run: Run) -> tuple[bool, bool, bool, bool, float, float]:
        ratio, efficiency = stiffness_ratio(run), headline_values(run).get("efficiency", np.nan)
        return (
            run.evaluation is None,
            not run.printable,
            too_long(run, wanted),
            not np.isfinite(ratio),
            -np.nan_to_num(ratio),
            -np.nan_to_num(efficiency),
        )

    return tuple(sorted(runs, key=score))


def best_values(runs: Sequence[Run], wanted: float | None) -> dict[str, float]:
    """Best value of each headline column where the runs differ.

    Runs that cannot be printed, lay too much fibre or leave layers empty have no best value.
    """
    best = {}
    equal = [
        run for run in runs if run.printable and not too_long(run, wanted) and not run.empty_layers
    ]
    for head in HEADLINE:
        values = [headline_values(run).get(head.column, np.nan) for run in equal]
        known = [value for value in values if np.isfinite(value)]
        if head.better and len(known) > 1 and min(known) < max(known):
            best[head.column] = max(known) if head.better == "high" else min(known)
    return best


def too_long(run: Run, wanted: float | None) -> bool:
    """Whether a run lays more fibre than all were held to."""
    return wanted is not None and run.length_per_layer > (1.0 + TOLERANCE) * wanted


def stiffness_ratio(run: Run, mode: str = "tension") -> float:
    """Stiffness over that without fibre, "tension" only or "bonded"; NaN where untested."""
    return headline_values(run).get(f"stiffness_ratio_{mode}", np.nan)


def stiffness_ratios(one: Run, other: Run) -> tuple[float, float]:
    """Stiffness of one run over that of another, tension only and bonded; NaN where untested."""
    return (
        stiffness_ratio(one) / stiffness_ratio(other),
        stiffness_ratio(one, "bonded") / stiffness_ratio(other, "bonded"),
    )


def order_of(better: Run, other: Run) -> str:
    """Say whether a run is stiffer than one that is placed below it.

    Returns
    -------
    str
        FIRST, SAME or UNDECIDED of `ccfem.virtual_testing.stiffer`: undecided also where only
        bonded fibres tell them apart, the other way round. SAME where one is untested.
    """
    if better.tested is None or other.tested is None:
        return SAME
    found = stiffer(better.tested.bracket, other.tested.bracket)
    return found if found in (FIRST, SAME) else UNDECIDED
