"""The option that says which layers get fibre."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.base.errors import InputError
from ccfem.base.toml import assignment

if TYPE_CHECKING:
    from ccfem.paths.placement.fibre_places import FibrePlaces

SetFibre = Annotated[
    list[str] | None,
    typer.Option(
        "--set-fibre",
        metavar="KEY=VALUE",
        help="Which layers get fibre, by a key of [fibre] in a part file: layers=3:20:2, from=0.4, "
        "to=9.6, every=2, between=1, covered=true; repeatable.",
    ),
]


def fibre_choice(
    texts: Sequence[str] | None,
) -> "Callable[[FibrePlaces | None], FibrePlaces] | None":
    """Turn the option into what it makes of a part's choice; None where it is not given.

    Raises
    ------
    InputError
        For a text that is no assignment, an unknown key and a value that it does not take.
    """
    if not texts:
        return None
    from ccfem.cases.part_fibre import fibre_of

    table = dict(assignment(text) for text in texts)
    if "regions" in table:
        raise InputError("--set-fibre sets no regions: write [[fibre.regions]] in a part file")
    if isinstance(table.get("layers"), int):
        table["layers"] = [table["layers"]]
    fibre_of(table)
    return lambda places: fibre_of(table, base=places)
