"""The headline of a comparison: the few indices that tables show first, order, and verdict."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ccfem.comparison import Comparison, Run
from ccfem.equal_fibre import TOLERANCE
from ccfem.evaluate import Column, Evaluation
from ccfem.evaluate.virtual_test.verdict import UNDECIDED
from ccfem.evaluate.virtual_test.verdict import verdict as verdict_of_pair

__all__ = [
    "HEADLINE",
    "TEST_COLUMNS",
    "Headline",
    "best_values",
    "cell_text",
    "headline_values",
    "ranking",
    "remarks",
    "stiffness_ratios",
    "verdict",
]

_RATIO = "stiffness of the part with its fibres over that without"

TEST_COLUMNS = (
    Column(
        "stiffness_ratio_tension",
        "1",
        f"The {_RATIO}, fibres in compression carrying nothing; default EA/E = 4 mm^2.",
        ">= 1, higher is better; missing where there was no virtual test",
    ),
    Column(
        "stiffness_ratio_low",
        "1",
        f"The {_RATIO}, tension only, at the lowest EA/E of the span (2 mm^2).",
        "as stiffness_ratio_tension",
    ),
    Column(
        "stiffness_ratio_high",
        "1",
        f"The {_RATIO}, tension only, at the highest EA/E of the span (6 mm^2).",
        "as stiffness_ratio_tension",
    ),
    Column(
        "stiffness_ratio_bonded",
        "1",
        f"The {_RATIO}, all fibres bonded and carrying tension and compression.",
        "as stiffness_ratio_tension",
    ),
    Column(
        "stiffness",
        "N/mm",
        "Size of the load squared over its work, fibres carrying tension only.",
        "> 0, higher is better",
    ),
    Column(
        "gain_per_metre",
        "1/m",
        "(stiffness_ratio_tension - 1) over the length of fibre inside the part.",
        ">= 0, higher is better",
    ),
    Column(
        "strain_energy",
        "N mm",
        "Strain energy of matrix and fibres under the load, fibres carrying tension only.",
        "> 0, lower is better under forces",
    ),
    Column(
        "first_failure_load",
        "N",
        "Load at which the matrix (von Mises stress averaged over a 2 mm ball, away from loads and "
        "supports) or the fibre (99th percentile of the axial force by length) first reaches its "
        "strength, fibres carrying tension only.",
        "> 0, higher is better; missing where a strength is unknown",
    ),
)
"""Indices of the virtual test, described as those of the evaluator are."""

_EQUAL = 0.02
"""Difference in length up to which two runs count as laying equally much."""


@dataclass(frozen=True)
class Headline:
    """One column of the headline table.

    Attributes
    ----------
    column : str
        Name of the index.
    title : str
        What tables print above it.
    better : str
        "high", "low", or "" where neither is better.
    pattern : str
        How a value is printed, for `str.format`.
    """

    column: str
    title: str
    better: str
    pattern: str


HEADLINE = (
    Headline("stiffness_ratio_tension", "stiffness ×, tension only", "high", "{:.2f}"),
    Headline("stiffness_ratio_bonded", "stiffness ×, bonded", "high", "{:.2f}"),
    Headline("first_failure_load", "first failure, N", "high", "{:.0f}"),
    Headline("fibre_per_layer", "fibre, mm a layer", "", "{:.0f}"),
    Headline("efficiency", "efficiency", "high", "{:.3f}"),
    Headline("aligned_stress_10", "within 10°, by stress", "high", "{:.1%}"),
    Headline("coverage_top_20", "coverage of top 20 % stress", "high", "{:.1%}"),
    Headline("curvature_95", "curvature 95 %, 1/mm", "low", "{:.3f}"),
    Headline("paths_per_layer", "paths a layer", "low", "{:.1f}"),
    Headline("spacing_below", "nearer than W", "low", "{:.1%}"),
    Headline("outside_length", "outside, mm", "low", "{:.2f}"),
    Headline("all_crossings", "crossings", "low", "{:.0f}"),
)
"""The columns of the headline table; those that no run has are left out."""


def headline_values(run: Run) -> Mapping[str, float]:
    """Every total index of a run, with some per layer; empty where it failed."""
    if run.evaluation is None:
        return {}
    total, layers = run.evaluation.total, max(len(run.evaluation.layers), 1)
    return {
        **_test_values(run),
        **total,
        "fibre_per_layer": total["fibre_length"] / layers,
        "paths_per_layer": total["paths"] / layers,
        "all_crossings": total["crossings"] + total["self_crossings"],
    }


def _test_values(run: Run) -> dict[str, float]:
    if run.tested is None:
        return {}
    tension, bonded = run.tested.bracket.tension, run.tested.bracket.bonded
    values = {
        "stiffness_ratio_tension": tension.ratio,
        "stiffness_ratio_bonded": bonded.ratio,
        "stiffness": tension.stiffness,
        "gain_per_metre": tension.gain_per_metre,
        "strain_energy": tension.solution.strain_energy,
    }
    if tension.span:
        ratios = [ratio for _, ratio in tension.span]
        values["stiffness_ratio_low"] = min(ratios)
        values["stiffness_ratio_high"] = max(ratios)
    if run.tested.failure is not None:
        values["first_failure_load"] = run.tested.failure.load
    return values


def cell_text(run: Run, head: Headline) -> tuple[str, str]:
    """Text of a cell of the headline table, and what to add to it in smaller letters."""
    values = headline_values(run)
    value, extra = values.get(head.column, np.nan), ""
    if not np.isfinite(value):
        return "–", ""
    if head.column == "stiffness_ratio_tension" and "stiffness_ratio_low" in values:
        extra = f"{values['stiffness_ratio_low']:.2f}–{values['stiffness_ratio_high']:.2f}"
    if head.column == "first_failure_load" and run.tested is not None and run.tested.failure:
        extra = run.tested.failure.what
    return head.pattern.format(value), extra


def best_values(comparison: Comparison) -> dict[str, float]:
    """Best value of each headline column where the runs differ; too much fibre does not count."""
    best = {}
    equal = [run for run in comparison.succeeded if not _too_long(run, comparison)]
    for head in HEADLINE:
        values = [headline_values(run).get(head.column, np.nan) for run in equal]
        known = [value for value in values if np.isfinite(value)]
        if head.better and len(known) > 1 and min(known) < max(known):
            best[head.column] = max(known) if head.better == "high" else min(known)
    return best


def ranking(comparison: Comparison) -> tuple[Run, ...]:
    """Return the runs from the best to the worst, failed ones last.

    By the predicted stiffness with fibres that carry tension only; those without a virtual test
    come after, by efficiency. A run that lays more than the wanted fibre comes after all that do
    not.
    """

    def score(run: Run) -> tuple[bool, bool, float, bool, float]:
        ratio, efficiency = _ratio(run), headline_values(run).get("efficiency", np.nan)
        return (
            _too_long(run, comparison),
            not np.isfinite(ratio),
            -np.nan_to_num(ratio),
            run.evaluation is None,
            -np.nan_to_num(efficiency),
        )

    return tuple(sorted(comparison.runs, key=score))


def remarks(comparison: Comparison) -> list[str]:
    """Say what has to stand next to the numbers, a line each."""
    lines: dict[str, list[str]] = {}
    for run in ranking(comparison):
        about = [f"failed: {run.failure}"] if run.failure else []
        if run.untested:
            about.append(f"no virtual test: {run.untested}")
        if run.tested is not None and run.tested.note:
            about.append(f"no first-failure load: {run.tested.note}")
        if run.evaluation is not None:
            about += _about_links(run.evaluation.total)
            if getattr(run.strategy, "crosses", False):
                about += _about_crossings(run.evaluation, comparison.bound is not None)
        if run.note:
            placed = ", so it is placed last" if _too_long(run, comparison) else ""
            about.append(f"{run.note}{placed}")
        for line in about:
            lines.setdefault(line, []).append(run.name)
    found = [f"{', '.join(names)}: {line}" for line, names in lines.items()]
    tested = [run for run in ranking(comparison) if run.tested is not None]
    for k, run in enumerate(tested):
        unclear = [other.name for other in tested[k + 1 :] if _undecided(run, other)]
        if unclear:
            found.append(
                f"{run.name}: undecided against {', '.join(unclear)}, for tension-only and bonded "
                "fibres do not agree on an order"
            )
    return [*found, bound_remark(comparison)] if comparison.bound is not None else found


def _about_links(total: Mapping[str, float]) -> list[str]:
    """Say how much fibre joins strands where no part holds it, from a millimetre on."""
    places = {
        "link_outside": "lie outside the part, to be cut off",
        "link_over_void": "hang over voids, where nothing holds the fibre",
    }
    return [
        f"{total[name]:.0f} mm of links {where}"
        for name, where in places.items()
        if total[name] >= 1.0
    ]


def _about_crossings(evaluation: Evaluation, bounded: bool) -> list[str]:
    """Say how often strands that cross by intention lie over each other, and what that means."""
    crossings = evaluation.values["crossings"] + evaluation.values["self_crossings"]
    if not crossings[-1]:
        return []
    line = (
        f"strands cross in the joints: {crossings[-1]:.0f} crossings on "
        f"{np.count_nonzero(crossings[:-1])} of {len(evaluation.layers)} layers, thicker there"
    )
    bound = "; the bound does not hold for strands laid over each other"
    return [line + bound if bounded else line]


def bound_remark(comparison: Comparison) -> str:
    """Say how far the best run is from what any paths could reach; empty without a bound.

    The bound is for strands beside each other that carry tension only: strands that overlap may
    exceed it, and so may bonded ones.
    """
    tested = [run for run in ranking(comparison) if run.tested is not None]
    if comparison.bound is None or not tested:
        return ""
    length = max(run.length_per_layer for run in tested)
    name, share = tested[0].name, comparison.bound.share(_ratio(tested[0]))
    bonded = max(_ratio(run, "bonded") for run in tested)
    free = "; bonded fibres are not bounded" if bonded > comparison.bound.ratio else ""
    most = (
        f"paths of {length:.0f} mm a layer in {len(comparison.layers)} layers can make the part "
        f"more than {comparison.bound.ratio:.2f} times as stiff (fibres carrying tension only"
        f"{free})"
    )
    if share > 1.0:
        return f"only where strands overlap, as those of {name} do, {most}"
    return f"no {most}: {name} reaches {share:.0%} of that gain"


def stiffness_ratios(one: Run, other: Run) -> tuple[float, float]:
    """Stiffness of one run over that of another, tension only and bonded; NaN where untested."""
    return (
        _ratio(one) / _ratio(other),
        _ratio(one, "bonded") / _ratio(other, "bonded"),
    )


def verdict(comparison: Comparison) -> str:
    """One sentence that says which strategy is best, by what, and at how much fibre.

    Empty where fewer than two strategies kept to the wanted length.
    """
    order = [run for run in ranking(comparison) if run.evaluation is not None]
    order = [run for run in order if not _too_long(run, comparison)]
    if len(order) < 2:
        return ""
    first, second = order[0], order[1]
    more = first.length_per_layer / second.length_per_layer - 1.0
    if comparison.fibre_per_layer is None:
        amount = "each with its own amount of fibre"
    elif abs(more) <= _EQUAL:
        amount = f"at {comparison.fibre_per_layer:.0f} mm of fibre per layer"
    else:
        amount = f"with {abs(more):.0%} {'more' if more > 0.0 else 'less'} fibre than {second.name}"
    if first.tested is None or second.tested is None:
        best, following = (headline_values(run)["efficiency"] for run in (first, second))
        return (
            f"By efficiency alone (no virtual test): {first.name} with {best:.3f}, then "
            f"{second.name} with {following:.3f}, {amount}."
        )
    if _undecided(first, second):
        return (
            f"Undecided between {first.name} and {second.name}, {amount}: "
            f"{_ratio(first):.2f} and {_ratio(second):.2f} times the unreinforced stiffness where "
            f"fibres carry tension only, {_ratio(first, 'bonded'):.2f} and "
            f"{_ratio(second, 'bonded'):.2f} where they are bonded."
        )
    return (
        f"{first.name} makes the stiffest part, {amount}: {_ratio(first):.2f} times the "
        f"unreinforced one, and {_ratio(first) / _ratio(second):.2f} times {second.name} "
        "(predicted, fibres carrying tension only; bonded fibres agree on the order)."
    )


def _too_long(run: Run, comparison: Comparison) -> bool:
    wanted = comparison.fibre_per_layer
    return wanted is not None and run.length_per_layer > (1.0 + TOLERANCE) * wanted


def _ratio(run: Run, mode: str = "tension") -> float:
    return headline_values(run).get(f"stiffness_ratio_{mode}", np.nan)


def _undecided(one: Run, other: Run) -> bool:
    if one.tested is None or other.tested is None:
        return False
    return verdict_of_pair(one.tested.bracket, other.tested.bracket) == UNDECIDED
