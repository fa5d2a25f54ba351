"""A stiffness on the command line, turned into the fibre that it takes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ccfem.checks import check_number
from ccfem.errors import InputError

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.elasticity.stress_field import StressField
    from ccfem.fibre_aware.least_fibre import LeastFibre
    from ccfem.layers.layer import Layer
    from ccfem.planning.strategy import Strategy
    from ccfem.virtual_testing.strand import Strand

__all__ = ["least_fibre_options"]

_UNIT = "N/mm"


def least_fibre_options(
    case: "Case", strategy: "Strategy", options: Mapping[str, Any]
) -> dict[str, Any]:
    """Options of `compare` with the least fibre that reaches the stiffness among them.

    Where no layers are asked for the part's own are tried, and twice as many where a strand has
    room in them; those are taken that need the least fibre in all. Says what was chosen.

    Parameters
    ----------
    case : Case
    strategy : Strategy
    options : mapping
        From `ccfem.cli.run.options_of`, and ``stiffness``: a text, the ratio to the part without
        fibre or a number with ``N/mm`` behind it.
    """
    from ccfem.cases.load_cases import asks_for_all
    from ccfem.comparison.compare import solve_and_slice
    from ccfem.planning.whole_part import full_length
    from ccfem.virtual_testing.specimen import Specimen

    rest = {name: value for name, value in options.items() if name != "stiffness"}
    number, absolute = _read(options["stiffness"])
    if rest["fibre_per_layer"] is not None:
        raise InputError("--stiffness asks how much fibre it takes: drop --fibre-per-layer")
    if rest["strand"] is None:
        raise InputError("--stiffness is that of the virtual test: drop --no-virtual-test")
    if rest.get("stress") is not None:
        raise InputError("--stiffness solves the part itself: drop --stress")
    if asks_for_all(case, rest["load_case"]):
        raise InputError("--stiffness is that of one load case: name it in place of all")
    names = (rest[name] for name in ("layers", "load_case", "backend"))
    stress, _, layers, _ = solve_and_slice(case, *names)
    ratio = number
    if absolute:
        specimen = Specimen.of(stress)
        before = specimen.stiffness(stress.displacement, stress.strain_energy)
        ratio = number / before
        if not ratio > 1.0:
            raise InputError(
                f"--stiffness {number:g}{_UNIT} is no more than the {before:.4g} {_UNIT} of the "
                "part without fibre: it needs none, or ask for more"
            )
    stacks: dict[Any, Sequence[Layer]] = {rest["layers"]: layers}
    if rest["layers"] is None:
        stacks |= _finer(case, stress, layers)
    count, found = _least_of(stacks, case, strategy, stress, ratio, rest["strand"])
    chosen = stacks[count]
    laid, full = found.planned.length_per_layer, full_length(chosen, case.machine)
    print(
        f"{ratio:.4g} times the stiffness without fibre takes {laid:.0f} mm a layer on "
        f"{len(chosen)} layers, {1e-3 * laid * len(chosen):.4g} m in all, a coverage of "
        f"{laid / full:.0%}: {found.ratio:.4g} times",
        flush=True,
    )
    return rest | {"layers": count, "fibre_per_layer": found.asked, "natural": False}


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
    stress: "StressField",
    ratio: float,
    strand: "Strand",
) -> "tuple[int | None, LeastFibre]":
    """Layers that reach a ratio with the least fibre in all, the most layers tried first.

    Fewer are not tried where no paths of that length on them can reach it.
    """
    from ccfem.fibre_aware.least_fibre import least_fibre
    from ccfem.fibre_aware.upper_bound import upper_bound
    from ccfem.planning.whole_part import full_length

    check_number("stiffness over that without fibre", ratio, above=1.0)
    best: tuple[int | None, LeastFibre] | None = None
    refusal: InputError | None = None
    for count, layers in sorted(stacks.items(), key=lambda one: -len(one[1])):
        flat = all(layer.flat is not None for layer in layers)
        most = len(layers) * full_length(layers, case.machine)
        if best is not None:
            most = best[1].planned.length_per_layer * len(stacks[best[0]])
        if flat:
            bound = upper_bound(stress, layers, most, case.machine, strand).ratio
            if bound < ratio:
                refusal = refusal or InputError(
                    f"{ratio:.4g} times the stiffness without fibre was asked for; no paths on "
                    f"{len(layers)} layers exceed {bound:.4g}: ask for less, or give the part "
                    "more layers"
                )
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


def _read(text: str) -> tuple[float, bool]:
    """Read a number, and whether it is N/mm."""
    absolute = text.strip().endswith(_UNIT)
    try:
        return float(text.strip().removesuffix(_UNIT)), absolute
    except ValueError:
        raise InputError(
            f"--stiffness expects a ratio as 2.5, or N/mm as 1200N/mm; got '{text}'"
        ) from None
