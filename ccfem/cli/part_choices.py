"""The options that say which layers of a part get fibre, and what its plastic is printed as."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.base.errors import InputError
from ccfem.base.toml import assignment

if TYPE_CHECKING:
    from ccfem.paths.placement.fibre_places import FibrePlaces
    from ccfem.paths.plastic.plastic import Plastic

SetFibre = Annotated[
    list[str] | None,
    typer.Option(
        "--set-fibre",
        metavar="KEY=VALUE",
        help="Which layers get fibre, by a key of [fibre] in a part file: layers=3:20:2, from=0.4, "
        "to=9.6, every=2, between=1, covered=true; repeatable.",
    ),
]
SetPlastic = Annotated[
    list[str] | None,
    typer.Option(
        "--set-plastic",
        metavar="KEY=VALUE,..",
        help="Walls, skins, infill and seam, by keys of [plastic] in a part file: "
        "infill=gyroid,density=0.2,walls=2,skins=3,fibre_skins=1,seam=behind; repeatable.",
    ),
]


def fibre_choice(
    texts: Sequence[str] | None,
) -> "Callable[[FibrePlaces | None], FibrePlaces] | None":
    """Turn ``--set-fibre`` into what it makes of a part's choice; None where it is not given.

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


def plastic_choice(texts: Sequence[str] | None) -> "Callable[[Plastic], Plastic] | None":
    """Turn ``--set-plastic`` into what it makes of a part's plastic; None where it is not given.

    Raises
    ------
    InputError
        As `fibre_choice`.
    """
    if not texts:
        return None
    from ccfem.cases.part_tables import plastic_of

    table = dict(assignment(piece) for text in texts for piece in text.split(","))
    plastic_of(table)
    return lambda plastic: plastic_of(table, plastic)
