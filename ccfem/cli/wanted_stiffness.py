"""A stiffness on the command line, turned into the fibre that it takes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ccfem.errors import InputError

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.planning.strategy import Strategy

__all__ = ["least_fibre_options"]

_UNIT = "N/mm"


def least_fibre_options(
    case: "Case", strategy: "Strategy", options: Mapping[str, Any]
) -> dict[str, Any]:
    """Options of `compare` with the least fibre that reaches the stiffness among them.

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
    from ccfem.fibre_aware.least_fibre import least_fibre
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
    found = least_fibre(strategy, layers, stress, case.machine, ratio, rest["strand"])
    return rest | {"fibre_per_layer": found.asked, "natural": False}


def _read(text: str) -> tuple[float, bool]:
    """Read a number, and whether it is N/mm."""
    absolute = text.strip().endswith(_UNIT)
    try:
        return float(text.strip().removesuffix(_UNIT)), absolute
    except ValueError:
        raise InputError(
            f"--stiffness expects a ratio as 2.5, or N/mm as 1200N/mm; got '{text}'"
        ) from None
