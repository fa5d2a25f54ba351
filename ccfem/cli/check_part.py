"""What ``ccfem check`` does: print what is known of a part before it is solved, and draw it."""

import sys
from collections.abc import Callable
from pathlib import Path

from ccfem.base.whole import check_writable, whole_file
from ccfem.cases.inspection import check
from ccfem.cli.run import NOT_PRINTABLE, complain, load
from ccfem.comparison.plot.canvas import check_picture, save
from ccfem.comparison.plot.part_picture import part_page, part_picture
from ccfem.machine.machine import Machine
from ccfem.paths.placement.fibre_places import FibrePlaces


def check_part(
    part: str,
    set_case: list[str] | None,
    picture: Path | None,
    machine: Callable[[Machine], Machine] | None = None,
    fibre: Callable[[FibrePlaces | None], FibrePlaces] | None = None,
) -> int:
    """Print a check; write its picture, and beside it the page that turns.

    Parameters
    ----------
    part : str
        Name of a case, or a part file.
    set_case : list of str, optional
        Parameters of a case.
    picture : Path, optional
        .png, .pdf or .svg; default the part's name and ``-check.png``.
    machine : callable, optional
        What it makes of the part's machine (`ccfem.cli.machines.machine_choice`).
    fibre : callable, optional
        What it makes of the layers that get fibre (`ccfem.cli.fibre_choice.fibre_choice`).

    Returns
    -------
    int
        Exit code, that of a plan: 2 where something keeps the part from being solved or planned, 3
        where it cannot be printed whatever is planned.
    """
    if picture is not None:
        check_picture(picture)
    checked = check(load(part, set_case, machine=machine, fibre=fibre))
    if picture is None:
        picture = check_picture(Path(f"{checked.case.name}-check.png"))
    page = check_writable(picture.with_suffix(".html"))
    print(checked.known)
    save(part_picture(checked), picture)
    with whole_file(page) as temporary:
        temporary.write_text(part_page(checked), encoding="utf-8")
    print(f"{picture}, and {page} with a rotatable view")
    for line in checked.not_printable:
        print(f"ccfem: not printable as planned: {line}", file=sys.stderr)
    if checked.mistakes or checked.not_planned:
        return complain(*checked.mistakes, *checked.not_planned)
    return NOT_PRINTABLE if checked.not_printable else 0
