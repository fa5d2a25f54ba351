"""What ``ccfem check`` does: print what is known of a part before it is solved, and draw it."""

import sys
from collections.abc import Callable
from pathlib import Path

from ccfem.base.whole import check_writable, whole_file
from ccfem.cases.case import Case
from ccfem.cases.inspection import check
from ccfem.cli.run import NOT_PRINTABLE, complain
from ccfem.comparison.plot.canvas import check_picture, save
from ccfem.comparison.plot.part_picture import part_page, part_picture


def check_part(read: Callable[[], Case], picture: Path | None) -> int:
    """Print a check; write its picture, and beside it the page that turns.

    Parameters
    ----------
    read : callable
        Returns the part; called when the name of the picture has been looked at.
    picture : Path, optional
        .png, .pdf or .svg; default the part's name and ``-check.png``.

    Returns
    -------
    int
        Exit code, that of a plan: 2 where something keeps the part from being solved or planned, 3
        where it cannot be printed whatever is planned.
    """
    if picture is not None:
        check_picture(picture)
    checked = check(read())
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
