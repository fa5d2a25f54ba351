"""How much fibre a wanted stiffness takes: the least length of a strategy that reaches it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing import Strand, specimens
from ccfem.judging.virtual_testing.several_cases import virtual_tests
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Planned, Strategy
from ccfem.paths.planning.bracketing import close_in, interpolated
from ccfem.paths.planning.strategy import full_length
from ccfem.paths.splitting.printed_strands import printed_strands
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.plan_cases import plan_cases
from ccfem.strategies.fibre_aware.upper_bound import LEAST, WORST

_FIRST = 0.3
"""Share of the layers that the first plan covers."""

_MOST = 1.0
"""Largest share that is asked for: strategies lay less where they cannot lay that much."""

_PLANS = 10
"""Plans after which the best is taken."""

_CLOSE = 0.01
"""Share of the wanted gain by which a plan may do better than asked."""

_KEPT_AWAY = 0.1
"""Share of the logarithm between two lengths that the next one is kept away from both."""

_LEAP, _STEP = 4.0, 0.1
"""Largest factor between two lengths that are tried one after the other, and the logarithm of the
smallest as long as only too little or only enough is known."""


@dataclass(frozen=True)
class LeastFibre:
    """The least fibre that was found to reach a stiffness.

    Attributes
    ----------
    planned : Planned
        The plan that reaches it, with its length per layer.
    asked : float, mm
        Length per layer that this plan was asked for: asked again, the strategy lays the same.
    ratio : float
        Its stiffness over that of the part without fibre, fibres in tension only; of several load
        cases the least.
    ratios : (n,) array
        The same in each load case.
    tried : tuple of (float, float)
        Length per layer, mm, and stiffness ratio of every plan, in the order of the search.
    """

    planned: Planned
    asked: float
    ratio: float
    ratios: FloatArray
    tried: tuple[tuple[float, float], ...]

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, ratios=float)


def least_fibre(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: StressField | WeightedCases,
    machine: Machine,
    ratio: float,
    strand: Strand | None = None,
) -> LeastFibre:
    """Find the least fibre with which a strategy reaches a stiffness ratio.

    The gain in stiffness grows about as a power of the length; two plans say which, and the next
    length follows. Of every plan the strands that are printed are tested virtually.

    Several load cases are planned for at once, and every one of them is to be so stiff, over the
    part without fibre in that case: what counts is the one that gains least (`for_every_case`).

    Parameters
    ----------
    layers : sequence of Layer
        All layers of the part.
    stress : StressField or WeightedCases
        The part without fibre, under the load that counts, or under several.
    ratio : float
        Wanted stiffness over that of the part without fibre, above 1.
    strand : Strand, optional
        Stiffness of a strand; default rho = EA/E = 4 mm^2.

    Raises
    ------
    InputError
        When the ratio is not above 1, or the most fibre that the strategy lays does not reach it.
    """
    check_number("stiffness over that without fibre", ratio, above=1.0)
    cases = WeightedCases.of(stress)
    if len(cases) > 1:
        strategy = for_every_case(strategy)
    parts, most = specimens(cases), _MOST * full_length(layers, machine)
    mesh = parts[0].unreinforced.mesh
    plans: dict[float, LeastFibre] = {}
    tried: dict[float, float] = {}

    def measured(length: float) -> tuple[float, float]:
        planned = plan_cases(strategy, layers, cases, machine, length, strand)
        printed = printed_strands(planned.toolpaths, layers, mesh, machine).fibre
        strands = carrying_strands(printed, planned.strategy, layers, mesh, machine)
        ratios = virtual_tests(strands, parts, strand).ratios
        reached, laid = float(ratios.min()), planned.length_per_layer
        plans.setdefault(laid, LeastFibre(planned, length, reached, ratios, ()))
        return laid, reached

    def following(_: int) -> float | None:
        last = plans[[*tried][-1]]
        lays_its_most = not last.planned.reached and last.planned.length_per_layer < last.asked
        if last.ratio < ratio and lays_its_most:
            return None
        length = _next(tried, ratio)
        return None if length is None else min(length, most)

    wanted = (ratio, ratio + _CLOSE * (ratio - 1.0))
    close_in(tried, measured, _FIRST * most, following, wanted, _PLANS)
    enough = [laid for laid, plan in plans.items() if plan.ratio >= ratio]
    if not enough:
        best = max(plans.values(), key=lambda plan: plan.ratio)
        every, where = "", ""
        if len(cases) > 1:
            every = " in every load case"
            where = f" in '{cases.names[int(np.argmin(best.ratios))]}'"
        raise InputError(
            f"{ratio:.4g} times the stiffness without fibre was asked for{every}; "
            f"{best.ratio:.4g}{where} is the most of {len(tried)} plans, with "
            f"{best.planned.length_per_layer:.0f} mm per layer: ask for less, or give the part "
            "more layers"
        )
    return replace(plans[min(enough)], tried=tuple(tried.items()))


def for_every_case(strategy: Strategy) -> Strategy:
    """Let a strategy plan for the load case that gains least, where it knows that objective.

    One that was told another objective than its default, "worst", keeps it.
    """
    changed: Any = strategy
    worst = getattr(strategy, "objective", None) == WORST
    return replace(changed, objective=LEAST) if worst else strategy


def _next(tried: Mapping[float, float], ratio: float) -> float | None:
    """Length at which the gain, a power of the length between two plans, is a little too large.

    None where the shortest that is enough and the longest below it that is not are alike.
    """
    gains = {length: max(reached - 1.0, 1e-9) for length, reached in tried.items()}
    wanted = (ratio - 1.0) * (1.0 + 0.5 * _CLOSE)
    above = min((length for length in gains if gains[length] >= ratio - 1.0), default=None)
    below = max((length for length in gains if above is None or length < above), default=None)
    if above is None or below is None:
        # The gain grows about in proportion while only too little or only enough is known.
        nearest = max(gains) if above is None else min(gains)
        leap = float(np.clip(np.log(wanted / gains[nearest]), -np.log(_LEAP), np.log(_LEAP)))
        return nearest * float(np.exp(max(leap, _STEP) if above is None else min(leap, -_STEP)))
    logarithms = float(np.log(below)), float(np.log(above))
    if logarithms[1] - logarithms[0] < _CLOSE:
        return None
    values = (gains[below], gains[above])
    return float(np.exp(interpolated(logarithms, values, wanted, kept_away=_KEPT_AWAY)))
