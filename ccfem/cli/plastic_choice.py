"""The option that says what the plastic of a part is printed as."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.base.toml import assignment

if TYPE_CHECKING:
    from ccfem.paths.plastic.plastic import Plastic

SetPlastic = Annotated[
    list[str] | None,
    typer.Option(
        "--set-plastic",
        metavar="KEY=VALUE,..",
        help="Walls, skins, infill and seam, by keys of [plastic] in a part file: "
        "infill=gyroid,density=0.2,walls=2,skins=3,fibre_skins=1,seam=behind; repeatable.",
    ),
]


def plastic_choice(texts: Sequence[str] | None) -> "Callable[[Plastic], Plastic] | None":
    """Turn the option into what it makes of a part's plastic; None where it is not given.

    Raises
    ------
    InputError
        For a text that is no assignment, an unknown key and a value that it does not take.
    """
    if not texts:
        return None
    from ccfem.cases.part_tables import plastic_of

    table = dict(assignment(piece) for text in texts for piece in text.split(","))
    plastic_of(table)
    return lambda plastic: plastic_of(table, plastic)
