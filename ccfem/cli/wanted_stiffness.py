"""A stiffness on the command line, turned into the fibre that it takes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ccfem.checks import check_number
from ccfem.errors import InputError

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.elasticity.stress_field import StressField
    from ccfem.elasticity.weighted_cases import WeightedCases
    from ccfem.fibre_aware.least_fibre import LeastFibre
    from ccfem.layers.layer import Layer
    from ccfem.machine.machine import Machine
    from ccfem.planning.strategy import Strategy
    from ccfem.virtual_testing.strand import Strand

__all__ = ["least_fibre_options", "planned_for"]

_UNIT = "N/mm"


def planned_for(case: "Case", strategy: "Strategy", options: Mapping[str, Any]) -> "Strategy":
    """Strategy that plans for a stiffness: with all load cases for the one that gains least."""
    from ccfem.cases.load_cases import asks_for_all
    from ccfem.fibre_aware.least_fibre import for_every_case

    return for_every_case(strategy) if asks_for_all(case, options["load_case"]) else strategy


def least_fibre_options(
    case: "Case", strategy: "Strategy", options: Mapping[str, Any]
) -> dict[str, Any]:
    """Options of `compare` with the least fibre that reaches the stiffness among them.

    Where no layers are asked for the part's own are tried, and twice as many where a strand has
    room in them; those are taken that need the least fibre in all. Says what was chosen. With all
    load cases every one of them is to be so stiff.

    Parameters
    ----------
    case : Case
    strategy : Strategy
    options : mapping
        From `ccfem.cli.run.options_of`, and ``stiffness``: a text, the ratio to the part without
        fibre or a number with ``N/mm`` behind it.
    """
    from ccfem.planning.whole_part import full_length

    rest = {name: value for name, value in options.items() if name != "stiffness"}
    number, absolute = _read(options["stiffness"])
    if rest["fibre_per_layer"] is not None:
        raise InputError("--stiffness asks how much fibre it takes: drop --fibre-per-layer")
    if rest["strand"] is None:
        raise InputError("--stiffness is that of the virtual test: drop --no-virtual-test")
    if rest.get("stress") is not None:
        raise InputError("--stiffness solves the part itself: drop --stress")
    field, cases, layers = _solved(case, rest["layers"], rest["load_case"], rest["backend"])
    stress = field if cases is None else cases
    ratio = _over_bare(number, stress) if absolute else number
    stacks: dict[Any, Sequence[Layer]] = {rest["layers"]: layers}
    if rest["layers"] is None:
        stacks |= _finer(case, field, layers)
    count, found = _least_of(stacks, case, strategy, stress, ratio, rest["strand"])
    chosen = stacks[count]
    laid, full = found.planned.length_per_layer, full_length(chosen, case.machine)
    every, reached = "", f"{found.ratio:.4g} times"
    if cases is not None:
        every = " in every load case"
        each = zip(found.ratios.tolist(), cases.names, strict=True)
        reached = ", ".join(f"{one:.4g} times in '{name}'" for one, name in each)
    print(
        f"{ratio:.4g} times the stiffness without fibre{every} takes {laid:.0f} mm a layer on "
        f"{len(chosen)} layers, {1e-3 * laid * len(chosen):.4g} m in all, a coverage of "
        f"{laid / full:.0%}: {reached}",
        flush=True,
    )
    return rest | {"layers": count, "fibre_per_layer": found.asked, "natural": False}


def _solved(
    case: "Case", layers: Any, load_case: str | None, backend: str
) -> "tuple[StressField, WeightedCases | None, Sequence[Layer]]":
    """Field of the case that counts, all cases where these are asked for, and the layers."""
    from ccfem.cases.load_cases import asks_for_all, weighted_cases
    from ccfem.comparison.compare import solve_and_slice
    from ccfem.elasticity.solve import solve
    from ccfem.layers.slicing import as_slicer
    from ccfem.virtual_testing.several_cases import specimens

    if not asks_for_all(case, load_case):
        stress, _, stack, _ = solve_and_slice(case, layers, load_case, backend)
        return stress, None, stack
    cases = weighted_cases(case, solve(case.problem, backend=backend))
    specimens(cases, backend)  # one factorisation for all
    slicer = None if layers is None else as_slicer(layers)
    return cases.heaviest, cases, case.fibre_layers(cases.heaviest, slicer)


def _over_bare(stiffness: float, stress: "StressField | WeightedCases") -> float:
    """Stiffness, N/mm, over that of the part without fibre, of one load case."""
    from ccfem.elasticity.stress_field import StressField
    from ccfem.virtual_testing.specimen import Specimen

    fields = (stress,) if isinstance(stress, StressField) else stress.fields
    before = {
        each.case: Specimen.of(each).stiffness(each.displacement, each.strain_energy)
        for each in fields
    }
    if len(before) > 1:
        known = ", ".join(f"{value:.4g} in '{name}'" for name, value in before.items())
        raise InputError(
            f"--stiffness {stiffness:g}{_UNIT} is that of one load case, and these differ without "
            f"fibre ({_UNIT}: {known}): give a ratio as 2.5, or name one load case"
        )
    (one,) = before.values()
    if not stiffness / one > 1.0:
        raise InputError(
            f"--stiffness {stiffness:g}{_UNIT} is no more than the {one:.4g} {_UNIT} of the "
            "part without fibre, which needs no fibre: ask for more"
        )
    return stiffness / one


def _finer(
    case: "Case", stress: "StressField", layers: "Sequence[Layer]"
) -> "dict[int | None, Sequence[Layer]]":
    """Twice as many layers where they are flat and a strand has room in them, by their number."""
    from ccfem.comparison.fibre_front import counts_to_try
    from ccfem.layers.slicing.planar import Planar

    if any(layer.flat is None for layer in layers):
        return {}
    return {
        count: case.fibre_layers(stress, Planar(count=count))
        for count in counts_to_try(case, stress)[1:]
    }


def _least_of(
    stacks: "Mapping[int | None, Sequence[Layer]]",
    case: "Case",
    strategy: "Strategy",
    stress: "StressField | WeightedCases",
    ratio: float,
    strand: "Strand",
) -> "tuple[int | None, LeastFibre]":
    """Layers that reach a ratio with the least fibre in all, the most layers tried first.

    Fewer are not tried where no paths of that length on them can reach it.
    """
    from ccfem.fibre_aware.least_fibre import least_fibre
    from ccfem.planning.whole_part import full_length

    check_number("stiffness over that without fibre", ratio, above=1.0)
    best: tuple[int | None, LeastFibre] | None = None
    refusal: InputError | None = None
    for count, layers in sorted(stacks.items(), key=lambda one: -len(one[1])):
        flat = all(layer.flat is not None for layer in layers)
        most = len(layers) * full_length(layers, case.machine)
        if best is not None:
            most = best[1].planned.length_per_layer * len(stacks[best[0]])
        beyond = _beyond(stress, layers, most, case.machine, strand, ratio) if flat else ""
        if beyond:
            refusal = refusal or InputError(beyond)
            continue
        try:
            found = least_fibre(strategy, layers, stress, case.machine, ratio, strand)
        except InputError as error:
            refusal = refusal or error
            continue
        if best is None or found.planned.length_per_layer * len(layers) < most:
            best = count, found
    if best is None:
        raise refusal or InputError("--stiffness needs layers; got none: slice the part")
    return best


def _beyond(
    stress: "StressField | WeightedCases",
    layers: "Sequence[Layer]",
    length: float,
    machine: "Machine",
    strand: "Strand",
    ratio: float,
) -> str:
    """Say why no paths of a length, mm, make the part so and so stiff; empty where some may."""
    from ccfem.elasticity.stress_field import StressField
    from ccfem.fibre_aware.upper_bound import LEAST, upper_bound

    asked = f"{ratio:.4g} times the stiffness without fibre was asked for"
    cure = "ask for less, or give the part more layers"
    if isinstance(stress, StressField):
        bound = upper_bound(stress, layers, length, machine, strand).ratio
        said = f"no paths on {len(layers)} layers exceed {bound:.4g}"
        return f"{asked}; {said}: {cure}" if bound < ratio else ""
    asked += " in every load case"
    for field in stress.fields:
        bound = upper_bound(field, layers, length, machine, strand).ratio
        if bound < ratio:
            said = f"no paths on {len(layers)} layers exceed {bound:.4g} in '{field.case}'"
            return f"{asked}; {said}: {cure}"
    most = upper_bound(stress, layers, length, machine, strand, objective=LEAST).ratio
    said = f"no paths on {len(layers)} layers bring all of them above {most:.4g}"
    return f"{asked}; {said}: {cure}" if most < ratio else ""


def _read(text: str) -> tuple[float, bool]:
    """Read a number, and whether it is N/mm."""
    absolute = text.strip().endswith(_UNIT)
    try:
        return float(text.strip().removesuffix(_UNIT)), absolute
    except ValueError:
        raise InputError(
            f"--stiffness expects a ratio as 2.5, or N/mm as 1200N/mm; got '{text}'"
        ) from None
