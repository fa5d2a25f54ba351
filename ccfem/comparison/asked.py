"""What is asked of a comparison and does not go together."""

from ccfem.checks import check_number
from ccfem.errors import InputError
from ccfem.planning.equal_fibre import check_wanted
from ccfem.virtual_testing.strand import Strand

__all__ = ["check_all", "check_amount"]


def check_all(strand: Strand | None, stress: object, curve: bool | None, slicings: object) -> None:
    """Refuse what is not done for all load cases at once."""
    if strand is None:
        raise InputError(
            "plans for all load cases are cut and ranked by virtual tests: leave these in, or name "
            "one load case"
        )
    refused = {
        "stress of another program": stress is not None,
        "a curve": bool(curve),
        "several slicings": slicings is not None,
    }
    for what, asked in refused.items():
        if asked:
            raise InputError(f"all load cases are planned for at once; got {what} too: drop one")


def check_amount(fibre_per_layer: float | None, fibre: float | None, natural: bool) -> None:
    """Refuse two amounts at once, and one that is none."""
    if fibre is not None and fibre_per_layer is not None:
        raise InputError("give the fibre per layer or the fibre in all, not both: drop one")
    if fibre is None and fibre_per_layer is None:
        return
    if natural:
        raise InputError("give either a fibre length or the natural amount, not both: drop one")
    if fibre_per_layer is not None:
        check_wanted(fibre_per_layer)
    else:
        check_number("fibre in all", fibre, above=0.0, unit="mm")
