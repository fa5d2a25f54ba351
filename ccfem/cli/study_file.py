"""``ccfem study``: run a study file, with the time left, and say what came out."""

from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from ccfem.base.progress import progress_bar
from ccfem.cli.options import Force, Out


def study(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE.toml", help="Study file; ccfem study --example prints one."),
    ] = None,
    example: Annotated[
        bool, typer.Option("--example", help="Print a study file to start from, and end.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(metavar="N", help="Processes; default as many as processors.", min=0),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Dask scheduler whose workers make the runs instead."),
    ] = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Run parts x slicings x strategies x parameters; one that was stopped goes on where it was."""
    if example:
        text = (
            files("ccfem.comparison.studies").joinpath("example.toml").read_text(encoding="utf-8")
        )
        print(text, end="")
    elif file is None:
        raise typer.BadParameter("name a study file; ccfem study --example prints one")
    else:
        _run(file, out, workers, scheduler, force)


def _run(
    file: Path, out: Path | None, workers: int | None, scheduler: str | None, force: bool
) -> None:
    """Run a study file and print what came out."""
    from ccfem.comparison.studies import study
    from ccfem.comparison.studies.study_fronts import COST

    with progress_bar() as progress:
        result = study(file, out, workers, scheduler, force, progress)
    print(result)
    for cost in COST:
        front = result.front(cost)
        if len(front):
            print(f"on the front of stiffness over {cost}: {len(front)} runs")
    parquet = (result.folder / "results.parquet").exists()
    tables = "results.csv, results.parquet" if parquet else "results.csv"
    print(f"{result.folder / 'study.html'}, and beside it {tables} and times.csv")
    if not parquet:
        print("results.parquet needs pyarrow: pip install 'ccfem[parquet]'")
