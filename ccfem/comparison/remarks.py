"""What is said of a comparison: remarks beside the table, and the verdict in one sentence."""

from collections.abc import Mapping, Sequence

import numpy as np

from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import ranking, stiffness_ratio, too_long, undecided
from ccfem.comparison.result import Comparison, Run
from ccfem.evaluation.evaluation import Evaluation

__all__ = ["bound_remark", "remarks", "verdict"]


_EQUAL = 0.02
"""Difference in length up to which two runs count as laying equally much."""


def remarks(comparison: Comparison) -> list[str]:
    """Say what has to stand next to the numbers, a line each."""
    lines: dict[str, list[str]] = {}
    for run in ranking(comparison):
        for line in _about(run, comparison):
            lines.setdefault(line, []).append(run.name)
    found = [f"{', '.join(names)}: {line}" for line, names in lines.items()]
    if comparison.given is not None:
        found.append("paths are planned and evaluated on the stress of another program")
    found += _about_orders([run for run in ranking(comparison) if run.tested is not None])
    return [*found, bound_remark(comparison)] if comparison.bound is not None else found


def _about(run: Run, comparison: Comparison) -> list[str]:
    """Say what has to stand next to the numbers of one run."""
    reasons = {
        "failed": run.failure,
        "no virtual test": run.untested,
        "cannot be printed as planned": run.unprinted,
        "no first-failure load": run.tested.note if run.tested is not None else "",
    }
    lines = [f"{what}: {reason}" for what, reason in reasons.items() if reason]
    if run.evaluation is not None:
        lines += _about_links(run.evaluation.total)
        if getattr(run.strategy, "crosses", False):
            lines += _about_crossings(run.evaluation, comparison.bound is not None)
    if run.note:
        placed = ", so it is placed last" if too_long(run, comparison) else ""
        lines.append(f"{run.note}{placed}")
    return lines


def _about_orders(tested: Sequence[Run]) -> list[str]:
    """Say which runs, best first, cannot be put in an order."""
    lines = []
    for k, run in enumerate(tested):
        unclear = [other.name for other in tested[k + 1 :] if undecided(run, other)]
        if unclear:
            lines.append(
                f"{run.name}: undecided against {', '.join(unclear)}, for tension-only and bonded "
                "fibres do not agree on an order"
            )
    return lines


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
    name, share = tested[0].name, comparison.bound.share(stiffness_ratio(tested[0]))
    bonded = max(stiffness_ratio(run, "bonded") for run in tested)
    free = "; bonded fibres are not bounded" if bonded > comparison.bound.ratio else ""
    most = (
        f"paths of {length:.0f} mm a layer in {len(comparison.layers)} layers can make the part "
        f"more than {comparison.bound.ratio:.2f} times as stiff (fibres carrying tension only"
        f"{free})"
    )
    if share > 1.0:
        return f"only where strands overlap, as those of {name} do, {most}"
    return f"no {most}: {name} reaches {share:.0%} of that gain"


def verdict(comparison: Comparison) -> str:
    """One sentence that says which strategy is best, by what, and at how much fibre.

    Empty where fewer than two strategies kept to the wanted length.
    """
    order = [run for run in ranking(comparison) if run.evaluation is not None]
    order = [run for run in order if not too_long(run, comparison)]
    if len(order) < 2:
        return ""
    first, second = order[0], order[1]
    amount = _amounts(first, second, comparison.fibre_per_layer)
    if first.tested is None or second.tested is None:
        best, following = (headline_values(run)["efficiency"] for run in (first, second))
        return (
            f"By efficiency alone (no virtual test): {first.name} with {best:.3f}, then "
            f"{second.name} with {following:.3f}, {amount}."
        )
    if undecided(first, second):
        return (
            f"Undecided between {first.name} and {second.name}, {amount}: "
            f"{stiffness_ratio(first):.2f} and {stiffness_ratio(second):.2f} times the "
            f"unreinforced stiffness where fibres carry tension only, "
            f"{stiffness_ratio(first, 'bonded'):.2f} and "
            f"{stiffness_ratio(second, 'bonded'):.2f} where they are bonded."
        )
    return (
        f"{first.name} makes the stiffest part, {amount}: {stiffness_ratio(first):.2f} times the "
        f"unreinforced one, and {stiffness_ratio(first) / stiffness_ratio(second):.2f} times "
        f"{second.name} (predicted, fibres carrying tension only; bonded fibres agree on the "
        "order)."
    )


def _amounts(first: Run, second: Run, wanted: float | None) -> str:
    """Say how much fibre two runs lay, mm per layer, where they were held to a length."""
    more = first.length_per_layer / second.length_per_layer - 1.0
    if wanted is None:
        return "each with its own amount of fibre"
    if abs(more) <= _EQUAL:
        return f"at {wanted:.0f} mm of fibre per layer"
    return f"with {abs(more):.0%} {'more' if more > 0.0 else 'less'} fibre than {second.name}"
