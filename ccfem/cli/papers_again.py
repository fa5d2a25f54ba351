"""The command `reproduce`: figures, tables and claims of papers."""

from pathlib import Path
from typing import Annotated

import typer

from ccfem.cli.arguments import path_of


def reproduce(
    paper: Annotated[
        str | None, typer.Argument(metavar="PAPER", help="As wang_2021; none lists them.")
    ] = None,
    part: Annotated[
        str | None, typer.Argument(metavar="PART", help="As table2 or figure8; none makes all.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Default results/PAPER.")
    ] = None,
) -> None:
    """Make the figures, tables and claims of a paper again, ours beside theirs."""
    from ccfem.base.progress import progress_bar
    from ccfem.papers.reproduce import KEPT, named_papers
    from ccfem.papers.reproduce import reproduce as make

    if paper is None:
        for name, contents in named_papers().items():
            print(f"{name}  {contents.title}; about {contents.seconds:.0f} s")
            if contents.parts:
                print(f"    {', '.join(contents.parts)}")
        return
    with progress_bar(lines=True) as progress:
        made = make(paper, part or "", None if out is None else path_of(out), progress)
    print(made)
    if part:
        print(f"kept; made again only where code or data have changed ({made.parent / KEPT})")
