"""Results on disk: tables, record, paths and pictures, written whole or not at all."""

import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ccfem.comparison.record import record, results_frame
from ccfem.comparison.result import Comparison
from ccfem.errors import InputError
from ccfem.progress import Progress, silent
from ccfem.toolpaths import Toolpaths

if TYPE_CHECKING:
    from ccfem.comparison.pictures import Pictures

__all__ = ["staged", "write_results"]


@contextmanager
def staged(directory: Path) -> Iterator[Path]:
    """Yield a temporary folder whose files move to `directory` when the block ends well.

    What earlier results left there, by the list "files" of their ``results.json``, is removed, so
    that the folder holds one run and no paths or G-code of another.
    The temporary folder is made before the block runs, inside `directory` or else its nearest
    existing parent, so that a folder that cannot be written to is found before any work is done.
    When the block raises, `directory` is as it was.

    Raises
    ------
    InputError
        When `directory` cannot be written to.
    """
    directory = Path(directory)
    parent = directory
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    try:
        folder = Path(tempfile.mkdtemp(prefix=".ccfem-", dir=parent))
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        yield folder
        _move(folder, directory)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _move(folder: Path, directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        earlier = _written(directory)
        new = sorted(path.name for path in folder.iterdir())
        for name in new:
            os.replace(folder / name, directory / name)
        for name in earlier.difference(new):
            (directory / name).unlink(missing_ok=True)
    except OSError as error:
        raise _unwritable(directory, error) from error


def _written(directory: Path) -> set[str]:
    """Names of the files that the results in a folder consist of, as far as they tell."""
    try:
        about = json.loads((directory / "results.json").read_text(encoding="utf-8"))
        names = about["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    if not isinstance(names, list):
        return set()
    return {
        name
        for name in names
        if isinstance(name, str) and (directory / name).is_file() and Path(name).name == name
    }


def _unwritable(directory: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write results to {directory}: {error.strerror or error}: choose another folder "
        "with --out"
    )


def write_results(
    comparison: Comparison,
    folder: Path,
    command: str = "",
    seconds: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html``, pictures and paths.

    Where layers are curved, also ``STRATEGY_space.png`` and a page that turns,
    ``STRATEGY_space.html``. Runs with a print plan get ``STRATEGY.gcode`` too. In ``paths.vtp`` the
    cell array "strategy" numbers the strategies that did not fail, in the order of
    ``results.json``.

    Parameters
    ----------
    comparison : Comparison
    folder : Path
        An existing folder; use `staged` to have all files or none.
    command : str
        What was typed; the report tells how to repeat it.
    seconds : mapping of stage to float, optional
        Stages outside the comparison.
    progress : callable, optional
    """
    from ccfem.comparison.pictures import draw_pictures
    from ccfem.comparison.report import report_html

    start = time.perf_counter()
    pictures = draw_pictures(comparison, lambda what, share: progress(what, 0.9 * share))
    spent = {**(seconds or {}), "pictures": time.perf_counter() - start}
    progress("writing results", 0.9)
    _write_pictures(pictures, folder)
    results_frame(comparison).to_csv(folder / "results.csv", index=False)
    _write_paths(comparison, folder)
    if any(layer.flat is None for layer in comparison.layers):
        _write_in_space(comparison, folder)
    about = record(comparison, command, spent)
    page = report_html(comparison, about, pictures)
    (folder / "report.html").write_text(page, encoding="utf-8")
    about["files"] = sorted({path.name for path in folder.iterdir()} | {"results.json"})
    text = json.dumps(about, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _write_pictures(pictures: "Pictures", folder: Path) -> None:
    """Write the pictures that are files of their own."""
    for (name, index), image in pictures.paths.items():
        (folder / f"{name}_layer_{index:02d}.png").write_bytes(image)
    for name, image in pictures.forces.items():
        (folder / f"{name}_force.png").write_bytes(image)
    (folder / "tension.png").write_bytes(pictures.tension)
    (folder / "overview.png").write_bytes(pictures.overview)


def _write_in_space(comparison: Comparison, folder: Path) -> None:
    """Write a picture of the strands of every strategy in space, and a page on which they turn."""
    from ccfem.plot.canvas import png
    from ccfem.plot.stack_page import space_picture, turning_page

    layers, build = comparison.layers, comparison.case.build
    for run in comparison.succeeded:
        title = f"{comparison.case.name}, {run.name}"
        picture = space_picture(layers, run.toolpaths, title, build)
        (folder / f"{run.name}_space.png").write_bytes(png(picture))
        page = turning_page(layers, run.toolpaths, title, build)
        (folder / f"{run.name}_space.html").write_text(page, encoding="utf-8")


def _write_paths(comparison: Comparison, folder: Path) -> None:
    """Write the paths of every strategy in the formats of other programs."""
    from ccfem.export.gcode import write_gcode
    from ccfem.export.robot_waypoints import write_robot_waypoints
    from ccfem.export.vtk import write_paths
    from ccfem.export.waypoints import write_waypoints

    runs = comparison.succeeded
    for run in runs:
        layers, paths = comparison.layers, run.toolpaths
        if all(layer.flat is not None for layer in layers):
            write_waypoints(folder / f"{run.name}_waypoints.txt", paths, layers)
        else:
            file = folder / f"{run.name}_waypoints.csv"
            write_robot_waypoints(file, paths, layers, comparison.case.machine)
        if run.print_plan is not None:
            write_gcode(folder / f"{run.name}.gcode", run.print_plan, comparison.case.machine)
    every = Toolpaths.concatenate(run.toolpaths for run in runs)
    number = np.repeat(np.arange(float(len(runs))), [len(run.toolpaths) for run in runs])
    write_paths(every, folder / "paths.vtp", path_data={"strategy": number})
