"""Remarks on a comparison, to be shown beside the table."""

from collections.abc import Mapping, Sequence

import numpy as np

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
from ccfem.comparison.request import Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.verdict import all_same, comparable, left_out, not_behind
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.evaluation.evaluation import Evaluation
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.judging.evaluation.open_places import open_places
from ccfem.judging.virtual_testing.equilibrium import BONDED
from ccfem.judging.virtual_testing.pinned_joints import COUNTED, said_of_pins
from ccfem.judging.virtual_testing.stiffness_test import RESOLUTION, SAME, UNDECIDED
from ccfem.paths.planning.alike import ALIKE
from ccfem.slicing.layers.layer import Layer, flat_layers
from ccfem.strategies.fibre_aware.upper_bound import LEAST, LOOSE, UpperBound

_IMPORTANT = (
    ("failed: ", "cannot cut the part: ", "cannot be printed as planned"),
    ("not printable as planned: ",),
    ("no virtual test: ", "undecided against", "no difference to"),
    ("experiment: ", "no breaking load: "),
    ("linear theory", " are usual", "held nodes"),
    ("no paths of", "trust neither number", "bring the worst case above"),
    ("planned for ", "takes ", "the stress of another program"),
    (" copies, of all of which ", "begins at layer ", " spools, change before "),
    ("a curve over the length",),
    ("strands cross", "no fibre on", "so it is placed below", "links lie"),
    ("estimated error", "lock", "tensile strength"),
)
"""Words of remarks, those first that a reader has to know first."""

_FULL = 0.93
"""Coverage of a layer above which it counts as filled."""
_NAMED = 6
"""Number of layers that are named."""
_PLACES = 3
"""Number of open places that are named."""


def remarks(runs: Sequence[Run], wanted: Wanted, bound: UpperBound | None = None) -> list[str]:
    """Remarks that must be shown with the numbers, one line each.

    Parameters
    ----------
    wanted : float, mm, InAll or None
        Length of fibre per layer, or in total, that all were held to; None if each laid its own.
    """
    order = ranking(runs, wanted)
    lines: dict[str, list[str]] = {}
    for run in order:
        for line in _about(run, wanted, bound is not None):
            lines.setdefault(line, []).append(run.name)
    lines_said = [f"{', '.join(names)}: {line}" for line, names in lines.items()]
    tested = [run for run in order if is_tested(run) and not off_length(run, wanted)]
    lines_said += [
        *_about_orders(tested),
        *_if_bonded(tested),
        *_about_scatter(tested),
        *_about_joints(tested),
    ]
    return (
        [*lines_said, bound_remark(tested, bound)] if bound is not None and tested else lines_said
    )


def by_importance(lines: Sequence[str]) -> list[str]:
    """Remarks in the order in which a reader has to know them; others last, as they come."""

    def rank(line: str) -> int:
        kinds = (k for k, words in enumerate(_IMPORTANT) if any(word in line for word in words))
        return next(kinds, len(_IMPORTANT))

    return sorted(lines, key=rank)


def _about(run: Run, wanted: Wanted, bounded: bool) -> list[str]:
    """Remarks on one run that must be shown with the numbers."""
    reasons = {
        "failed": run.failure,
        "no virtual test": run.untested,
        "cannot be printed as planned": run.unprinted,
        "no breaking load": run.unbroken,
        "no first-failure load": run.tested.note if run.tested is not None else "",
    }
    lines = [f"{what}: {reason}" for what, reason in reasons.items() if reason]
    if run.tested is not None and run.tested.failure is not None:
        cases = run.cases.failure.each if run.cases and run.cases.failure else ()
        notes = [failure.note for failure in (run.tested.failure, *cases)]
        lines += dict.fromkeys(filter(None, notes))
    if run.broken is not None:
        lines.append(run.broken.said)
    if run.evaluation is not None:
        lines += _about_links(run.evaluation.total)
        meant = getattr(run.strategy, "crosses", False)
        lines += _about_crossings(run.evaluation, meant, bounded)
        if meant and wanted is None:
            lines += _about_open(run.evaluation)
    if run.strand_verdict.remark:
        lines.append(run.strand_verdict.remark)
    further = run.why_not.removeprefix(run.unprinted).removeprefix("; ")
    if further:
        lines.append(f"not printable as planned: {further}")
    if run.print_plan is not None:
        lines += run.print_plan.warnings
    elif run.strands is not None:
        lines += run.strands.warnings
    if run.empty_layers and run.evaluation is not None:
        lines.append(f"no fibre on {run.empty_layers} of {len(run.evaluation.layers)} layers")
    if run.evaluation is not None and run.evaluation.taken_on_some:
        count, some = len(run.evaluation.layers), run.evaluation.taken_on_some
        lines.append(
            f"angles, distances and coverage are those of {some} of {count} layers, evenly "
            "spread: --every-layer takes all"
        )
    if run.planned_layers:
        lines.append(
            f"planned on {run.planned_layers} layers, whose paths the others take: equal sections "
            f"under stress that differs by less than {ALIKE:.0%}; --every-layer plans all"
        )
    if run.note:
        placed = ", so it is placed below those that lay it" if off_length(run, wanted) else ""
        lines.append(f"{run.note}{placed}")
    return lines


def _about_orders(tested: Sequence[Run]) -> list[str]:
    """Say which runs, best first, cannot be ranked against each other; each reason once."""
    both = any(all_have((run,), ALTERNATIVES[0]) for run in tested)
    of = "fibres without and with some compression"
    of += ", or both models of the supports," if both else ""
    lost = "lost in scatter"
    reasons = {
        UNDECIDED: ("undecided against", f", for {of} do not agree on an order"),
        lost: ("undecided against", ": less than twice what prints scatter"),
        SAME: ("no difference to", f": less than {RESOLUTION:.0%}, the resolution of the test"),
    }

    def order_or_why(run: Run, other: Run) -> str:
        return lost if lost_in_scatter(run, other) else order_of(run, other)

    lines = []
    for order, (words, reason) in reasons.items():
        pairs = []
        for k, run in enumerate(tested):
            others = [other.name for other in tested[k + 1 :] if order_or_why(run, other) == order]
            if others:
                pairs.append(f"{run.name}: {words} {', '.join(others)}")
        if pairs:
            lines.append("; ".join(pairs) + reason)
    return lines


def _if_bonded(tested: Sequence[Run]) -> list[str]:
    """Say which run, best first, would be the stiffest if strands carried compression fully."""
    ratios = [stiffness_ratio(run, BONDED) for run in tested]
    most = int(np.argmax(ratios)) if tested else 0
    if not most or ratios[most] <= (1.0 + RESOLUTION) * ratios[0]:
        return []
    return [
        f"if strands carried compression fully, which published prints do not show, "
        f"{tested[most].name} would be stiffer than {tested[0].name}: {ratios[most]:.2f} and "
        f"{ratios[0]:.2f} times the unreinforced stiffness"
    ]


def _about_scatter(tested: Sequence[Run]) -> list[str]:
    """Say how far prints of the best runs scatter, alone and against each other."""
    known = [run.tested.scatter for run in tested if run.tested and run.tested.scatter]
    if not known:
        return []
    deviation = known[0].deviation
    remark = (
        f"scatter of prints ([scatter], one standard deviation): {tested[0].name} ± {deviation:.1%}"
    )
    if len(known) == len(tested) > 1 and not tested[0].cases:
        both = scatter_between(tested[0], tested[1])
        cancels = ": what they share cancels" if both < 0.5 * deviation else ""
        remark += f"; over {tested[1].name}, from the same spools, ± {both:.1%}{cancels}"
    return [remark]


def _about_joints(tested: Sequence[Run]) -> list[str]:
    """Say at which load a pin tears out of the best run."""
    best = tested[0].tested if tested else None
    if best is None:
        return []
    remark = said_of_pins(() if best.cases else best.joints, best.pins_not_judged)
    return [remark] if remark else []


def _about_links(total: Mapping[str, float]) -> list[str]:
    """Say how much link fibre has no part to hold it, from a millimetre on."""
    places = {
        "link_outside": "lie outside the part and must be cut off",
        "link_over_void": "lie over voids, where nothing supports the fibre",
    }
    return [
        f"{total[name]:.0f} mm of links {where}"
        for name, where in places.items()
        if total[name] >= 1.0
    ]


def _about_crossings(evaluation: Evaluation, meant: bool, bounded: bool) -> list[str]:
    """Say how often strands lie over each other, on purpose or not, and the consequences."""
    crossings = evaluation.values["crossings"] + evaluation.values["self_crossings"]
    if not crossings[-1]:
        return []
    number = f"{crossings[-1]:.0f} crossing{'s' if crossings[-1] > 1 else ''}"
    line = (
        f"strands cross{'' if meant else ', which the strategy does not intend'}: {number} on "
        f"{np.count_nonzero(crossings[:-1])} of {len(evaluation.layers)} layers, thicker there"
    )
    bound = "; the bound does not hold for strands laid over each other"
    return [line + bound if bounded else line]


def _about_open(evaluation: Evaluation) -> list[str]:
    """Name the layers that are left open by strands meant to fill a section, and how much."""
    cover = evaluation.values["coverage"][:-1]
    open_ = np.flatnonzero(cover < _FULL)  # none of those where it was not taken
    if not len(open_):
        return []
    named = ", ".join(str(evaluation.layers[k]) for k in open_[:_NAMED])
    more = ", ..." if len(open_) > _NAMED else ""
    bare = 1.0 - cover[open_].min()
    return [f"{bare:.1%} of the section stays without fibre, in layers {named}{more}"]


def open_remarks(runs: Sequence[Run], layers: Sequence[Layer], width: float) -> list[str]:
    """Say where strands meant to fill a section leave most of it open, one line a run.

    Only for runs that lay as much fibre as their strategy can: others leave room on purpose.

    Parameters
    ----------
    layers : sequence of Layer
        That the runs were planned on.
    width : float, mm
        Of the fibre.
    """
    texts, flat = [], {layer.index: layer for layer in flat_layers(layers)}
    for run in runs:
        if run.evaluation is None or not _filling(run):
            continue
        cover = run.evaluation.values["coverage"][:-1]
        layer = flat.get(int(run.evaluation.layers[int(np.nanargmin(cover))]))
        if np.nanmin(cover) >= _FULL or layer is None:
            continue
        left = open_places(plane_paths(run.toolpaths, layer), width)
        largest = ", ".join(
            f"{place.area:.1f} mm2 at ({place.x:.1f}, {place.y:.1f})"
            for place in left.places[:_PLACES]
        )
        wide = (
            f", {left.wide:.1%} gaps wide enough for one, the largest {largest} mm"
            if largest
            else ""
        )
        texts.append(
            f"{run.name}: {left.narrow:.1%} of layer {layer.index} is gaps too narrow for another "
            f"strand (between diverging strands, along the border){wide}"
        )
    return texts


def _filling(run: Run) -> bool:
    """Whether a run is meant to fill the section: with crossing strands, as many as possible."""
    amount = getattr(run.strategy, "amount", None)
    if amount is None or not amount.parameter or not getattr(run.strategy, "crosses", False):
        return False
    return bool(getattr(run.strategy, amount.parameter) == amount.most)


def bound_remark(tested: Sequence[Run], bound: UpperBound) -> str:
    """Say how far the best run is from what any paths could reach, and which runs lie above that.

    The bound holds for strands that lie beside each other and carry tension only. Strands that
    cross may exceed it, and so may strands that carry compression.

    Parameters
    ----------
    tested : sequence of Run
        With a virtual test, the best first; at least one.
    """
    best = tested[0]
    length, name = max(run.length_per_layer for run in tested), best.name
    layers = 0 if best.evaluation is None else len(best.evaluation.layers)
    pressed = max(stiffness_ratio(run, BONDED) for run in tested)
    free = "; fibres in compression are not bounded" if pressed > bound.ratio else ""
    loose = f"; it may be loose by {bound.duality_gap:.1%}" if bound.duality_gap > LOOSE else ""
    most = (
        f"no paths of {length:.0f} mm a layer in {layers} layers can make the part "
        f"more than {bound.ratio:.2f} times as stiff (fibres carrying tension only"
        f"{free}{loose})"
    )
    shares = {run.name: (run, bound.share(stiffness_ratio(run))) for run in tested}
    above = [
        f"{run.name} reaches {stiffness_ratio(run):.2f} times: {why_above(run, 1.0 - 1.0 / share)}"
        for run, share in shares.values()
        if share > 1.0
    ]
    if shares[name][1] <= 1.0:
        above.insert(0, f"{name} reaches {shares[name][1]:.0%} of that gain")
        return f"{most}: {'; but '.join(above)}"
    return f"by the bound, {most}; {'; '.join(above)}"


def why_above(run: Run, share: float) -> str:
    """Say why a run lies above a bound: strands that cross, if those are enough, or the cells.

    Bounds are those of linear cells, which bend too little: coarse quadratic ones may exceed them.
    Fibre on other fibre of its direction, and outside the part, carries nothing in the test.

    Parameters
    ----------
    share : float
        Of its gain that lies above the bound.
    """
    across = 0.0 if run.evaluation is None else run.evaluation.total["across_fibre"]
    if across >= share:
        return f"{across:.1%} of its fibre lies across other fibre, which the bound leaves out"
    some = f"only {across:.1%} of its fibre lies" if across >= 0.0005 else "none of its fibre lies"
    if run.tested is not None and run.tested.bracket.tension.solution.mesh.order == 2:
        return (
            f"{some} across other fibre, but the bound is that of linear cells, the test that of "
            "quadratic ones: trust neither number before shorter edges bring them together"
        )
    return f"{some} across other fibre, so the cause is not known: trust neither number"


# Verdict, remarks and table of a comparison over several load cases.


def cases_verdict(runs: Sequence[Run], wanted: Wanted, bound: UpperBound | None) -> str:
    """Say in one sentence which strategy serves all load cases best; empty for fewer than two.

    Parameters
    ----------
    wanted : float, mm, InAll or None
        Length of fibre that all were held to.
    """
    order = [run for run in comparable(runs, wanted) if is_tested(run)]
    if len(order) < 2:
        return ""
    first, group = order[0], not_behind(order)
    of = (
        "of the upper bound for that case alone"
        if bound is not None
        else "the unreinforced stiffness"
    )
    reached = f"{merit(first):.0%} {of}" if bound is not None else f"{merit(first):.2f} times {of}"
    names = f"{first.name} and {', '.join(run.name for run in group[1:])}"
    if len(group) == 1:
        verdict = (
            f"{first.name} serves all load cases best: the worst of them reaches {reached}, "
            f"{merit(first) / merit(order[1]):.2f} times {order[1].name} (predicted, fibres "
            "carrying tension only; no other is better with some compression)."
        )
    elif all_same(group):
        verdict = (
            f"No difference between {names} over all load cases: less than {RESOLUTION:.0%}, the "
            "resolution of the test."
        )
    else:
        verdict = (
            f"Undecided between {names} over all load cases: fibres without and with some "
            "compression do not agree on an order."
        )
    return verdict + left_out(runs, wanted, first)


def cases_remarks(
    runs: Sequence[Run],
    wanted: Wanted,
    cases: WeightedCases,
    bound: UpperBound | None,
    others: bool = False,
) -> list[str]:
    """Say how much each case counts, which case the other tables show, and what is possible.

    Parameters
    ----------
    wanted : float, mm, InAll or None
    others : bool
        Whether the part has alternative supports.
    """
    text = ", ".join(f"{n} {w:.2g}" for n, w in zip(cases.names, cases.weights, strict=True))
    texts = [
        f"planned for {len(cases)} load cases, by weight: {text}; stiffness, first failure and "
        f"indices of stress in the first table are those of '{cases.heaviest.case}'"
    ]
    if others:
        texts.append("alternative supports are not tested with several load cases")
    texts += [
        f"{run.name}: planned for the case that gains least over the part without fibre, not for "
        "the shares of bounds"
        for run in runs
        if getattr(run.strategy, "objective", None) == LEAST
    ]
    tested = [
        run for run in ranking(runs, wanted) if is_tested(run) and not off_length(run, wanted)
    ]
    if not tested or not tested[0].cases:
        return texts
    if (pin := tested[0].cases.weakest_pin) is not None:
        factor, case, joint = pin
        texts.append(
            f"pins in holes, over all cases: {joint.about} in '{case}', {factor:.2f} times its "
            f"load, by {COUNTED}"
        )
    if bound is None:
        return texts
    ratios = tested[0].cases.tension.ratios
    gap = bound.duality_gap
    loose = f"; the bound may be loose by {gap:.1%}" if gap > LOOSE else ""
    away = bound.gap(ratios)
    where = f"{away:.1%} from" if away >= 0.0 else f"{-away:.1%} above"
    why = "" if away >= 0.0 else f": {why_above(tested[0], -away)}"
    return [
        *texts,
        f"no paths of this length bring the worst case above {1.0 / bound.least:.0%} of what is "
        f"possible for it alone: {tested[0].name} reaches {bound.shares(ratios).min():.0%}, "
        f"{where} that bound (fibres carrying tension only{loose}){why}",
    ]
