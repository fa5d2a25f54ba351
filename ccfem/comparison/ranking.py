"""Ranking of the runs of a comparison, and cases in which no order can be stated."""

from collections.abc import Sequence

import numpy as np

from ccfem.comparison.headline import HEADLINE, TEST_COLUMNS, headline_values, value_text
from ccfem.comparison.request import InAll, Wanted
from ccfem.comparison.runs import Run
from ccfem.judging.virtual_testing.equilibrium import IN_COMPRESSION, PARTIAL, TENSION
from ccfem.judging.virtual_testing.stiffness_test import FIRST, RESOLUTION, SAME, SECOND, UNDECIDED
from ccfem.paths.planning.equal_fibre import TOLERANCE

_SAME = TOLERANCE * (1.0 + 1e-9)
"""Share of the wanted length by which a run may differ and still count as equal."""

_MODES = (TENSION, PARTIAL)
"""Modes of the test that order runs: between them lies what was measured on published prints."""

ALTERNATIVES = tuple(f"{mode}_alternative" for mode in _MODES)
"""Modes under alternative supports; missing where the part has none, or their test failed."""

_DIGITS = 2
"""Decimals with which tables show a ratio of stiffnesses."""

_SURE = 2.0
"""Standard deviations of the scatter between two runs that an order has to exceed."""

_STIFFNESSES = ("stiffness", "stiffness_ratio_tension", "displacement")
"""Columns whose best value is that of the stiffest run, if there is one."""


def ranking(runs: Sequence[Run], wanted: Wanted) -> tuple[Run, ...]:
    """Return the runs from the best to the worst, failed ones last.

    Runs are ranked by the predicted stiffness with fibres that carry tension only; with several
    load cases, by the case that is farthest below its bound. Runs without a virtual test come
    after these, by efficiency. Runs that cannot be printed as they are rank below all that can.
    Among printable runs, those that lay more or less than the wanted fibre rank below the others.

    Parameters
    ----------
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
    no best value. Stiffnesses are best of the run that is stiffer than every other (`order_of`), if
    there is one. A load at first failure is best if it is the largest by more than the resolution
    of the test. What another run shows with the same digits is not best.
    """
    equal = [
        run
        for run in runs
        if run.printable and not off_length(run, wanted) and not run.empty_layers
    ]
    order = ranking(equal, wanted)
    stiffest = len(order) > 1 and all(order_of(order[0], other) == FIRST for other in order[1:])
    shown = [headline_values(run) for run in runs if run.evaluation is not None]
    best, columns = {}, [headline_values(run) for run in equal]
    for head in HEADLINE:
        values = [of_run.get(head.column, np.nan) for of_run in columns]
        known = sorted(value for value in values if np.isfinite(value))
        if not head.better or len(known) < 2 or known[0] == known[-1]:
            continue
        winner = known[-1] if head.better == "high" else known[0]
        if head.column in _STIFFNESSES:
            if not stiffest:
                continue
            winner = headline_values(order[0])[head.column]
        if head.column == "first_failure_load" and not _strongest(equal, winner):
            continue
        others = [of_run for of_run in shown if of_run.get(head.column) != winner]
        measured = value_text({head.column: winner}, head)
        if measured not in [value_text(of_run, head) for of_run in others]:
            best[head.column] = winner
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
        planned, length = run.length, wanted.length
    else:
        planned, length = run.length_per_layer, wanted
    return not (1.0 - _SAME) * length <= planned <= (1.0 + _SAME) * length


def stiffness_ratio(run: Run, mode: str = TENSION) -> float:
    """Stiffness over that without fibre, in a mode of the test; NaN where untested."""
    if run.evaluation is None or run.tested is None:
        return float("nan")
    ratio = _RATIOS[mode](run.tested)
    return float("nan") if ratio is None else ratio


_RATIOS = {
    index.name.removeprefix("stiffness_ratio_"): index.value
    for index in TEST_COLUMNS
    if index.name.startswith("stiffness_ratio_")
}
"""What takes the ratio of each mode from a test; None under supports that were not tested."""


def merit(run: Run, mode: str = TENSION) -> float:
    """Return the value that ranks runs: the ratio, or `TestedCases.merit` of several load cases.

    Modes are those of the test and, under alternative supports, `ALTERNATIVES`, which several load
    cases do not have.
    """
    if mode in IN_COMPRESSION and run.cases:
        return run.cases.merit(mode)
    return stiffness_ratio(run, mode)


def stiffness_ratios(first: Run, other: Run) -> tuple[float, float]:
    """Stiffness of one run over another's, without and with some compression in fibre."""
    tension, partial = (stiffness_ratio(first, m) / stiffness_ratio(other, m) for m in _MODES)
    return tension, partial


def is_tested(run: Run) -> bool:
    """Whether a run has the stiffnesses that order runs."""
    return run.tested is not None and all(np.isfinite(merit(run, m)) for m in _MODES)


def all_have(runs: Sequence[Run], mode: str) -> bool:
    """Whether the table shows a stiffness of a mode for every run."""
    return all(np.isfinite(merit(run, mode)) for run in runs)


def scatter_between(one: Run, other: Run) -> float:
    """Return the standard deviation of ln(stiffness of one run over another's).

    Both are printed from the same spools. 0 where it is not known: of runs without a test, and of
    merits over several load cases.
    """
    first, second = (run.tested.scatter if run.tested else None for run in (one, other))
    if first is None or second is None or one.cases or other.cases:
        return 0.0
    return first.against(second)


def order_of(one: Run, other: Run) -> str:
    """Say which of two runs is stiffer, as far as their table shows it.

    Returns
    -------
    str
        FIRST or SECOND if one is stiffer than the other by more than `RESOLUTION` and more than
        twice the standard deviation of `scatter_between`, fibres carrying tension only, and the
        table shows none of its stiffnesses, with some compression or under alternative supports,
        below that of the other. SAME if no stiffness differs by more than `RESOLUTION`. Else
        UNDECIDED, and wherever a stiffness under the part's own supports is missing. What one of
        both lacks under alternative supports does not count.
    """
    return _order(one, other, float(np.exp(_SURE * scatter_between(one, other))))


def lost_in_scatter(one: Run, other: Run) -> bool:
    """Whether two runs have no order only because prints scatter."""
    return order_of(one, other) == UNDECIDED != _order(one, other, 1.0)


def _order(one: Run, other: Run, least: float) -> str:
    """Order of two runs as of `order_of`, one of which has to be `least` times as stiff."""
    modes = (*_MODES, *(mode for mode in ALTERNATIVES if all_have((one, other), mode)))
    first, second = (np.array([merit(run, mode) for mode in modes]) for run in (one, other))
    if not np.isfinite([first, second]).all():
        return UNDECIDED
    if np.maximum(first / second, second / first).max() <= 1.0 + RESOLUTION:
        return SAME
    for order, high, low in ((FIRST, first, second), (SECOND, second, first)):
        pairs = zip(high.tolist(), low.tolist(), strict=True)
        below = any(round(a, _DIGITS) < round(b, _DIGITS) for a, b in pairs)
        if high[0] > max(1.0 + RESOLUTION, least) * low[0] and not below:
            return order
    return UNDECIDED
