"""The least fibre with which a strategy makes a part as stiff as is asked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.comparison.request import Request, Stiffness
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Part, Tell, timed, with_plan
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.stress_field import PartStress, WeightedCases
from ccfem.judging.virtual_testing import Strand, specimens
from ccfem.judging.virtual_testing.several_cases import virtual_tests
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine.machine import Machine
from ccfem.paths.planning import Planned
from ccfem.paths.planning.bracketing import close_in, interpolated
from ccfem.paths.planning.strategy import Strategy, full_length
from ccfem.paths.splitting.printed_strands import printed_strands
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.plan_cases import plan_cases
from ccfem.strategies.fibre_aware.upper_bound import LEAST, WORST, upper_bound

# How much fibre a wanted stiffness takes: the least length of a strategy that reaches it.


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
    """The least fibre that was found to reach a stiffness."""

    planned: Planned  # the plan that reaches it, with its length per layer
    # mm: length per layer that this plan was asked for: asked again, the strategy lays the same
    asked: float
    # Its stiffness over that of the part without fibre, fibres in tension only; of several load
    # cases the least.
    ratio: float
    ratios: FloatArray  # (n,): the same in each load case
    # Length per layer, mm, and stiffness ratio of every plan, in the order of the search.
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
        reached, planned_length = float(ratios.min()), planned.length_per_layer
        plans.setdefault(planned_length, LeastFibre(planned, length, reached, ratios, ()))
        return planned_length, reached

    def following(_: int) -> float | None:
        last = plans[[*tried][-1]]
        lays_its_most = not last.planned.reached and last.planned.length_per_layer < last.asked
        if last.ratio < ratio and lays_its_most:
            return None
        length = _next(tried, ratio)
        return None if length is None else min(length, most)

    wanted = (ratio, ratio + _CLOSE * (ratio - 1.0))
    close_in(tried, measured, _FIRST * most, following, wanted, _PLANS)
    enough = [fibre for fibre, plan in plans.items() if plan.ratio >= ratio]
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


def counts_to_try(case: Case, stress: PartStress) -> tuple[int, ...]:
    """Numbers of flat layers worth trying: those of the part, and twice as many if they have room.

    All layers count, those without fibre too. A layer has to be as high as a strand is
    (`Machine.strand_height`).
    """
    layers = case.slicing(stress, case.build, case.machine)
    if curved_layers(layers):
        raise InputError(
            f"a front is of flat layers, those of '{case.name}' are curved: give --layers"
        )
    least = min(layer.thickness for layer in layers)
    room = 0.5 * least >= case.machine.strand_height
    return (len(layers), 2 * len(layers)) if room else (len(layers),)


def plan_to_stiffness(
    request: Request, part: Part, cut: Callable[[Slicer], Part], tell: Tell
) -> tuple[Part, Run, float]:
    """Plan the least fibre that reaches a stiffness.

    Where no layers are asked for, those of the part are tried, and twice as many where a strand has
    room in them; those are taken that need the least fibre in all. With several load cases every
    one of them is to be so stiff.

    Parameters
    ----------
    request : Request
        Of one strategy, its amount a `Stiffness`.
    part : Part
        Cut into the layers that are asked for.
    cut : callable
        Cuts the part by another slicer.

    Returns
    -------
    Part
        With the layers that were chosen.
    Run
        Its note says what was reached.
    float, mm
        Length per layer that the strategy was asked for.

    Raises
    ------
    InputError
        When no paths, or none of the strategy, reach the stiffness.
    """
    ((name, strategy),) = request.strategies.items()
    assert isinstance(request.amount, Stiffness)
    ratio = request.amount.value
    if request.amount.absolute:
        ratio = _over_bare(ratio, part.cases)
    check_number("stiffness over that without fibre", ratio, above=1.0)
    candidates = [part]
    if request.slicings[""].slicer is None and not curved_layers(part.layers):
        counts = counts_to_try(request.case, part.stress)
        candidates += [cut(Planar(count=count)) for count in counts[1:]]
    if part.several_cases:
        strategy = for_every_case(strategy)
    tell(f"planning {name} to {ratio:.4g} times the stiffness")
    seconds: dict[str, float] = {}
    with timed(seconds, "plan"):
        chosen, least = _least_of(candidates, strategy, ratio)
    run = Run(name, strategy, Toolpaths.empty(), None, seconds=seconds)
    run = with_plan(run, least.planned, chosen)
    notes = (_said(ratio, chosen, least), least.planned.note)
    return chosen, replace(run, note="; ".join(filter(None, notes))), least.asked


def _said(ratio: float, part: Part, least: LeastFibre) -> str:
    """Say how much fibre the stiffness takes, and what it reaches."""
    count, length = len(part.layers), least.planned.length_per_layer
    every, reached = "", f"{least.ratio:.4g} times"
    if part.several_cases:
        every = " in every load case"
        by_case = zip(least.ratios.tolist(), part.cases.names, strict=True)
        reached = ", ".join(f"{value:.4g} times in '{name}'" for value, name in by_case)
    coverage = length / full_length(part.layers, part.machine)
    return (
        f"{ratio:.4g} times the stiffness without fibre{every} takes {length:.0f} mm a layer on "
        f"{count} layers, {1e-3 * length * count:.4g} m in all, a coverage of {coverage:.0%}: "
        f"{reached}"
    )


def _over_bare(stiffness: float, cases: WeightedCases) -> float:
    """Stiffness, N/mm, over that of the part without fibre, of one load case."""
    before = {
        field.case: Specimen.of(field).stiffness(field.displacement, field.strain_energy)
        for field in cases.fields
    }
    if len(before) > 1:
        known = ", ".join(f"{value:.4g} in '{name}'" for name, value in before.items())
        raise InputError(
            f"--stiffness {stiffness:g}N/mm is that of one load case, and these differ without "
            f"fibre (N/mm: {known}): give a ratio as 2.5, or name one load case"
        )
    (bare,) = before.values()
    if not stiffness / bare > 1.0:
        raise InputError(
            f"--stiffness {stiffness:g}N/mm is no more than the {bare:.4g} N/mm of the part "
            "without fibre, which needs no fibre: ask for more"
        )
    return stiffness / bare


def _least_of(
    candidates: Sequence[Part], strategy: Strategy, ratio: float
) -> tuple[Part, LeastFibre]:
    """Layers that reach a ratio with the least fibre in all, the most layers tried first.

    Fewer are not tried where no paths of that length on them can reach it.
    """
    best: tuple[Part, LeastFibre] | None = None
    refusal: InputError | None = None
    most = 0.0
    for part in sorted(candidates, key=lambda part: -len(part.layers)):
        if best is None:
            most = len(part.layers) * full_length(part.layers, part.machine)
        try:
            _check_within_bound(part, most, ratio)
            about = (part.layers, part.cases, part.machine, ratio, part.strand)
            least = least_fibre(strategy, *about)
        except InputError as error:
            refusal = refusal or error
            continue
        in_all = least.planned.length_per_layer * len(part.layers)
        if best is None or in_all < most:
            best, most = (part, least), in_all
    if best is None:
        raise refusal or InputError("--stiffness needs layers; got none: slice the part")
    return best


def _check_within_bound(part: Part, length: float, ratio: float) -> None:
    """Refuse a ratio that no paths of a length, mm, on flat layers reach."""
    layers, cases, machine, strand = part.layers, part.cases, part.machine, part.strand
    if curved_layers(layers):
        return
    several = part.several_cases
    wanted = f"{ratio:.4g} times the stiffness without fibre was asked for"
    wanted += " in every load case" if several else ""
    cure = "ask for less, or give the part more layers"
    for field in cases.fields:
        bound = upper_bound(field, layers, length, machine, strand).ratio
        if bound < ratio:
            where = f" in '{field.case}'" if several else ""
            raise InputError(
                f"{wanted}; no paths on {len(layers)} layers exceed {bound:.4g}{where}: {cure}"
            )
    if several:
        most = upper_bound(cases, layers, length, machine, strand, objective=LEAST).ratio
        if most < ratio:
            raise InputError(
                f"{wanted}; no paths on {len(layers)} layers bring all of them above {most:.4g}: "
                f"{cure}"
            )
