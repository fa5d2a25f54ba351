"""The order of the runs of a comparison, and where an order cannot be told."""

import numpy as np

from ccfem.comparison.headline import HEADLINE, headline_values
from ccfem.comparison.result import Comparison, Run
from ccfem.planning.equal_fibre import TOLERANCE
from ccfem.virtual_testing.stiffer import UNDECIDED, stiffer

__all__ = ["best_values", "ranking", "stiffness_ratio", "stiffness_ratios", "too_long", "undecided"]


def ranking(comparison: Comparison) -> tuple[Run, ...]:
    """Return the runs from the best to the worst, failed ones last.

    By the predicted stiffness with fibres that carry tension only; those without a virtual test
    come after, by efficiency. A run that lays more than the wanted fibre comes after all that do
    not.
    """

    def score(run: Run) -> tuple[bool, bool, float, bool, float]:
        ratio, efficiency = stiffness_ratio(run), headline_values(run).get("efficiency", np.nan)
        return (
            too_long(run, comparison),
            not np.isfinite(ratio),
            -np.nan_to_num(ratio),
            run.evaluation is None,
            -np.nan_to_num(efficiency),
        )

    return tuple(sorted(comparison.runs, key=score))


def best_values(comparison: Comparison) -> dict[str, float]:
    """Best value of each headline column where the runs differ; too much fibre does not count."""
    best = {}
    equal = [run for run in comparison.succeeded if not too_long(run, comparison)]
    for head in HEADLINE:
        values = [headline_values(run).get(head.column, np.nan) for run in equal]
        known = [value for value in values if np.isfinite(value)]
        if head.better and len(known) > 1 and min(known) < max(known):
            best[head.column] = max(known) if head.better == "high" else min(known)
    return best


def too_long(run: Run, comparison: Comparison) -> bool:
    """Whether a run lays more fibre than all were held to."""
    wanted = comparison.fibre_per_layer
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


def undecided(one: Run, other: Run) -> bool:
    """Whether tension-only and bonded fibres disagree on the order of two runs."""
    if one.tested is None or other.tested is None:
        return False
    return stiffer(one.tested.bracket, other.tested.bracket) == UNDECIDED
