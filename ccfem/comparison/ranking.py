"""Ranking of the runs of a comparison, and cases in which no order can be stated."""

from collections.abc import Sequence

import numpy as np

from ccfem.comparison.headline import HEADLINE, cell_text, headline_values
from ccfem.comparison.runs import InAll, Run, Wanted
from ccfem.planning.equal_fibre import TOLERANCE
from ccfem.virtual_testing.stiffer import FIRST, RESOLUTION, SAME, UNDECIDED, stiffer

__all__ = [
    "best_values",
    "merit",
    "off_length",
    "order_of",
    "ranking",
    "stiffness_ratio",
    "stiffness_ratios",
]

_SAME = TOLERANCE * (1.0 + 1e-9)
"""Share of the wanted length by which a run may differ and still count as equal."""

_STIFFNESSES = (
    "stiffness",
    "stiffness_ratio_tension",
    "stiffness_ratio_bonded",
    "displacement",
)
"""Columns whose best value is that of the stiffest run, if there is one."""


def ranking(runs: Sequence[Run], wanted: Wanted) -> tuple[Run, ...]:
    """Return the runs from the best to the worst, failed ones last.

    Runs are ranked by the predicted stiffness with fibres that carry tension only; with several
    load cases, by the case that is farthest below its bound. Runs without a virtual test come
    after these, by efficiency. Runs that cannot be printed as they are rank below all that can.
    Among printable runs, those that lay more or less than the wanted fibre rank below the others.

    Parameters
    ----------
    runs : sequence of Run
    wanted : float, mm, InAll or None
        Length of fibre per layer, or in all, that all were held to; None where each laid its own.
    """

    def score(run: Run) -> tuple[bool, bool, bool, bool, float, float]:
        ratio, efficiency = merit(run), headline_values(run).get("efficiency", np.nan)
        return (
            run.evaluation is None,
            not run.printable,
            off_length(run, wanted),
            not np.isfinite(ratio),
            -np.nan_to_num(ratio),
            -np.nan_to_num(efficiency),
        )

    return tuple(sorted(runs, key=score))


def best_values(runs: Sequence[Run], wanted: Wanted) -> dict[str, float]:
    """Best value of each headline column, if a run is really better than another.

    Runs that cannot be printed, lay another length than the wanted one, or leave layers empty have
    no best value. A stiffness is best only if its run is stiffer than every other by more than the
    resolution of the test, whatever fibres in compression do. A load at first failure is best if it
    is the largest by more than that. What another run shows with the same digits is not best.
    """
    equal = [
        run
        for run in runs
        if run.printable and not off_length(run, wanted) and not run.empty_layers
    ]
    order = ranking(equal, wanted)
    stiffest = len(order) > 1 and all(order_of(order[0], other) == FIRST for other in order[1:])
    best = {}
    for head in HEADLINE:
        values = [headline_values(run).get(head.column, np.nan) for run in equal]
        known = sorted(value for value in values if np.isfinite(value))
        if not head.better or len(known) < 2 or known[0] == known[-1]:
            continue
        if head.column in _STIFFNESSES and not stiffest:
            continue
        found = known[-1] if head.better == "high" else known[0]
        if head.column == "first_failure_load" and not _strongest(equal, found):
            continue
        texts = [
            cell_text(run, head)[0]
            for run in runs
            if run.evaluation is not None and headline_values(run).get(head.column) != found
        ]
        own = next(
            cell_text(run, head)[0]
            for run in equal
            if headline_values(run).get(head.column) == found
        )
        if own not in texts:
            best[head.column] = found
    return best


def _strongest(runs: Sequence[Run], load: float) -> bool:
    """Whether the run that fails last, at a load, does so by a margin and under all supports."""
    columns = ("first_failure_load", "first_failure_load_alternative")
    first, again = ([headline_values(run).get(name, np.nan) for run in runs] for name in columns)
    best = first.index(load)
    return not any(
        loads[best] < (1.0 + RESOLUTION) * other
        for loads in (first, again)
        for k, other in enumerate(loads)
        if k != best
    )


def off_length(run: Run, wanted: Wanted) -> bool:
    """Whether a run lays more or less fibre than all were held to."""
    if wanted is None:
        return False
    if isinstance(wanted, InAll):
        laid, length = run.length, wanted.length
    else:
        laid, length = run.length_per_layer, wanted
    return not (1.0 - _SAME) * length <= laid <= (1.0 + _SAME) * length


def stiffness_ratio(run: Run, mode: str = "tension") -> float:
    """Stiffness over that without fibre, "tension" only or "bonded"; NaN where untested."""
    return headline_values(run).get(f"stiffness_ratio_{mode}", np.nan)


def merit(run: Run, mode: str = "tension") -> float:
    """Return the value that ranks runs: the ratio, or `TestedCases.merit` of several load cases."""
    if run.tested is not None and run.tested.cases is not None:
        return run.tested.cases.merit(mode)
    return stiffness_ratio(run, mode)


def stiffness_ratios(one: Run, other: Run) -> tuple[float, float]:
    """Stiffness of one run over that of another, tension only and bonded; NaN where untested."""
    return (
        stiffness_ratio(one) / stiffness_ratio(other),
        stiffness_ratio(one, "bonded") / stiffness_ratio(other, "bonded"),
    )


def order_of(better: Run, other: Run) -> str:
    """Say whether a run is stiffer than one ranked below it.

    Returns
    -------
    str
        FIRST, SAME or UNDECIDED of `ccfem.virtual_testing.stiffer`. It is also undecided if only
        bonded fibres, or only the alternative supports, tell the runs apart, or tell the opposite.
        SAME if one run is untested.
    """
    if better.tested is None or other.tested is None:
        return SAME
    if better.tested.cases is not None and other.tested.cases is not None:
        return _order_in_cases(better, other)
    found = stiffer(better.tested.bracket, other.tested.bracket)
    again = (better.tested.alternative, other.tested.alternative)
    if again[0] is not None and again[1] is not None:
        second = stiffer(again[0].bracket, again[1].bracket)
        if second not in (found, SAME):
            found = second if found == SAME else UNDECIDED
    if found == FIRST and stiffness_ratios(better, other)[0] <= 1.0 + RESOLUTION:
        return UNDECIDED
    return found if found in (FIRST, SAME) else UNDECIDED


def _order_in_cases(better: Run, other: Run) -> str:
    """Order by the worst of several load cases, as `order_of`."""
    gains = [merit(better, mode) / merit(other, mode) - 1.0 for mode in ("tension", "bonded")]
    ahead, behind = gains[0] > RESOLUTION, min(gains) < -RESOLUTION
    if behind or (max(gains) > RESOLUTION and not ahead):
        return UNDECIDED
    return FIRST if ahead else SAME
