"""The least fibre with which a strategy makes a part as stiff as is asked for."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.comparison.request import Request, Stiffness
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Part, Tell, timed, with_plan
from ccfem.fem.elasticity.stress_field import PartStress, WeightedCases
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.paths.planning.strategy import Strategy, full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import curved_layers
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.least_fibre import LeastFibre, for_every_case, least_fibre
from ccfem.strategies.fibre_aware.upper_bound import LEAST, upper_bound


def counts_to_try(case: Case, stress: PartStress) -> tuple[int, ...]:
    """Numbers of flat layers worth trying: those of the part, and twice as many if they have room.

    All layers count, those without fibre too. A layer has to be as high as a strand is
    (`Machine.strand_height`).

    Raises
    ------
    InputError
        For curved layers.
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
