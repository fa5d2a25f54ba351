"""Verdict, remarks and table of a comparison over several load cases."""

from collections.abc import Sequence

from ccfem.comparison.ranking import is_tested, merit, off_length, ranking
from ccfem.comparison.remarks import why_above
from ccfem.comparison.request import Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.verdict import all_same, comparable, left_out, not_behind
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing.virtual_test import RESOLUTION
from ccfem.strategies.fibre_aware.upper_bound import LEAST, LOOSE, UpperBound


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
        said = (
            f"{first.name} serves all load cases best: the worst of them reaches {reached}, "
            f"{merit(first) / merit(order[1]):.2f} times {order[1].name} (predicted, fibres "
            "carrying tension only; no other is better with some compression)."
        )
    elif all_same(group):
        said = (
            f"No difference between {names} over all load cases: less than {RESOLUTION:.0%}, the "
            "resolution of the test."
        )
    else:
        said = (
            f"Undecided between {names} over all load cases: fibres without and with some "
            "compression do not agree on an order."
        )
    return said + left_out(runs, wanted, first)


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
    said = ", ".join(f"{n} {w:.2g}" for n, w in zip(cases.names, cases.weights, strict=True))
    texts = [
        f"planned for {len(cases)} load cases, by weight: {said}; stiffness, first failure and "
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
            "load, by the matrix alone; strands round a hole are not counted"
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
