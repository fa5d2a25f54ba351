"""Results on disk: tables, record, paths and pictures."""

import json
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.csv_table import write_csv
from ccfem.base.errors import spared
from ccfem.base.progress import Progress, silent
from ccfem.base.result_folder import whole_folder
from ccfem.comparison.record import record, results_rows, write_table
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.shown import file_stem
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.print_plan import PrintPlan

if TYPE_CHECKING:
    from ccfem.comparison.pictures import Pictures

RESULT_FILES = (
    *("results.csv", "results.json", "report.html", "paths.vtp", "curve.csv", "curve.png"),
    *("tension.png", "overview.png", "part.png", "part.html"),
    *("*_waypoints.txt", "*_waypoints.csv", "*.gcode", "*_cell.csv", "*_trim.csv"),
    *("*_layer_[0-9]*.png", "*_layer_[0-9]*.svg", "*_layer_[0-9]*.dxf", "*_force.png"),
    *("*_space.png", "*_space.html", "*_overview.png"),
)
"""Patterns of all files that comparisons, over slicings too, write (`whole_folder`)."""


def save(
    comparison: Comparison,
    folder: str | os.PathLike[str],
    force: bool = False,
    progress: Progress = silent,
) -> Path:
    """Write the report, tables and paths of a comparison: all files or none.

    Parameters
    ----------
    comparison : Comparison
    folder : path
        In an existing folder only files that ccfem wrote, and nobody has changed, are replaced.
    force : bool, default False
        Also replace files of the same names that others wrote or changed.
    progress : callable, optional

    Returns
    -------
    Path
        Of the report, ``report.html``.

    Raises
    ------
    InputError
        When the folder cannot be written to, or holds files that would be overwritten.
    """
    folder, command = Path(folder), "ccfem.save(comparison) in Python"
    with whole_folder(folder, RESULT_FILES, force) as temporary:
        write_results(comparison, temporary, command, {}, progress)
    return folder / "report.html"


def write_results(
    comparison: Comparison,
    folder: Path,
    command: str = "",
    seconds: Mapping[str, float] | None = None,
    progress: Progress = silent,
    pictures: bool = False,
    part_file: str = "",
    drawings: Sequence[str] = (),
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html`` and paths; pictures where wanted.

    With a curve, also ``curve.csv``; where layers are curved, ``matrix_waypoints.csv``, rings that
    fill the layers. Runs with a print plan get ``STRATEGY.gcode`` too, ``STRATEGY_cell.csv`` with
    the same moves for a cell of robots, and ``STRATEGY_trim.csv`` where strands leave the part. In
    ``paths.vtp`` the cell array "strategy" numbers the strategies that did not fail, in the order
    of ``results.json``. Over slicings the name of the slicing stands before that of the strategy:
    ``SLICING_STRATEGY_waypoints.csv``. Characters that do not suit a file are dashes. Numbers and
    paths come first: a picture or a view of the report that fails is left out with a warning, which
    ``results.json`` keeps under "left_out".

    Parameters
    ----------
    comparison : Comparison
    folder : Path
        An existing folder; use `ccfem.base.result_folder.whole_folder` to have all files or none.
    command : str
        What was typed; the report tells how to repeat it.
    seconds : mapping of stage to float, optional
        Stages outside the comparison.
    progress : callable, optional
    pictures : bool, default False
        Also draw what the report shows as PNG files: every layer of every strategy, forces,
        tension, all side by side, the part and the curve; and ``part.html``, which turns the part.
        Where layers are curved, also ``STRATEGY_space.png`` and ``STRATEGY_space.html``. Over
        slicings ``SLICING_overview.png`` and the views in space of every run.
    part_file : str
        Text of the part file, for the report.
    drawings : sequence of {"svg", "dxf"}
        Also draw every flat layer of every run to scale: ``STRATEGY_layer_NN.svg``, ``.dxf``.
    """
    start = time.perf_counter()
    spent, left_out = dict(seconds or {}), list[str]()
    progress("writing results", 0.0)
    write_table(results_rows(comparison), folder / "results.csv")
    if comparison.curve is not None:
        frame = comparison.curve.frame
        write_csv(folder / "curve.csv", [*frame], frame.itertuples(index=False))
    _write_paths(comparison, folder)
    spent["files"] = time.perf_counter() - start
    start = time.perf_counter()
    for suffix in drawings:
        with spared(f"drawings ({suffix})", left_out):
            _write_drawings(comparison, folder, suffix)
    if pictures:
        _draw(comparison, folder, lambda what, share: progress(what, 0.2 + 0.6 * share), left_out)
        spent["pictures"] = time.perf_counter() - start
    progress("writing the report", 0.8)
    about = {**record(comparison, command, spent), "left_out": left_out}
    _write_report(comparison, about, folder, part_file)


def _write_report(
    comparison: Comparison, about: dict[str, Any], folder: Path, part_file: str
) -> None:
    """Write ``report.html``, and ``results.json`` whatever becomes of the report."""
    from ccfem.comparison.report.html_report import report_html

    start = time.perf_counter()
    with spared("report.html", about["left_out"]):
        page = report_html(comparison, about, part_file)
        (folder / "report.html").write_text(page, encoding="utf-8")
    about["seconds"]["report"] = time.perf_counter() - start
    about["files"] = sorted({path.name for path in folder.iterdir()} | {"results.json"})
    text = json.dumps(about, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _write_drawings(comparison: Comparison, folder: Path, suffix: str) -> None:
    """Draw every layer of every run to scale; raise `InputError` where layers are curved."""
    from ccfem.printing.export.layer_drawings import draw_layer

    width = comparison.case.machine.fibre_width
    for run in comparison.succeeded:
        for layer in comparison.layers:
            file = folder / f"{file_stem(run.name)}_layer_{layer.index:02d}.{suffix}"
            draw_layer(run.toolpaths, layer, width, file)


def _draw(comparison: Comparison, folder: Path, progress: Progress, left_out: list[str]) -> None:
    """Draw and write the pictures that are files of their own."""
    from ccfem.comparison.pictures import draw_pictures, overview_picture
    from ccfem.comparison.plot.canvas import png

    if not comparison.over_slicings:
        with spared("pictures", left_out):
            _write_pictures(draw_pictures(comparison, progress), folder)
    for k, (name, alone) in enumerate(comparison.slicings.items()):
        if name:
            progress(f"drawing {name}", k / len(comparison.slicings))
        curved = any(layer.flat is None for layer in alone.layers)
        with spared(f"pictures of {name}" if name else "pictures in space", left_out):
            if comparison.over_slicings and alone.succeeded:
                picture = folder / f"{file_stem(name)}_overview.png"
                picture.write_bytes(png(overview_picture(alone)))
            if comparison.over_slicings or curved:
                _write_in_space(alone, folder, name)


def _write_pictures(pictures: "Pictures", folder: Path) -> None:
    """Write the pictures that are files of their own."""
    for (name, index), image in pictures.paths.items():
        (folder / f"{file_stem(name)}_layer_{index:02d}.png").write_bytes(image)
    for name, image in pictures.forces.items():
        (folder / f"{file_stem(name)}_force.png").write_bytes(image)
    (folder / "tension.png").write_bytes(pictures.tension)
    (folder / "overview.png").write_bytes(pictures.overview)
    (folder / "part.png").write_bytes(pictures.part)
    (folder / "part.html").write_text(pictures.part_page, encoding="utf-8")
    if pictures.curve:
        (folder / "curve.png").write_bytes(pictures.curve)


def _write_in_space(comparison: Comparison, folder: Path, slicing: str) -> None:
    """Write a picture of the strands of every strategy in space, and a page on which they turn."""
    from ccfem.comparison.plot.canvas import png
    from ccfem.comparison.plot.stack_page import space_picture, turning_page

    layers, build = comparison.layers, comparison.case.build
    for run in comparison.succeeded:
        stem = _stem(slicing, run)
        title = f"{comparison.case.name}, {comparison.request.on_slicing(run.name, slicing)}"
        picture = space_picture(layers, run.toolpaths, title, build)
        (folder / f"{stem}_space.png").write_bytes(png(picture))
        page = turning_page(layers, run.toolpaths, title, build)
        (folder / f"{stem}_space.html").write_text(page, encoding="utf-8")


def _stem(slicing: str, run: Run) -> str:
    """Name of the files of a run."""
    return file_stem(*filter(None, (slicing, run.strategy_name)))


def _write_matrix(comparison: Comparison, folder: Path) -> None:
    """Write the matrix of curved layers for robots, once for all strategies."""
    from ccfem.paths.toolpaths import MATRIX
    from ccfem.printing.export.robot_waypoints import write_robot_waypoints
    from ccfem.printing.layer_matrix import layer_matrix

    file = folder / "matrix_waypoints.csv"
    if not file.exists():
        layers, machine = comparison.layers, comparison.case.machine
        write_robot_waypoints(file, layer_matrix(layers, machine), layers, machine, MATRIX)


def _write_print(folder: Path, name: str, plan: PrintPlan, comparison: Comparison) -> None:
    """Write what a printer and a cell of robots do to print a part: one chain of moves."""
    from ccfem.printing.export.gcode import gcode_of_moves
    from ccfem.printing.export.robot_cell import write_robot_cell
    from ccfem.printing.export.trim_table import write_trims
    from ccfem.printing.part_moves import part_moves

    case = comparison.case
    moves = part_moves(plan, case.machine)
    text = gcode_of_moves(moves, plan, case.machine, f"{case.name}, {name}")
    (folder / f"{name}.gcode").write_text(text, encoding="utf-8", newline="\n")
    write_robot_cell(folder / f"{name}_cell.csv", moves)
    if len(plan.trims):
        write_trims(folder / f"{name}_trim.csv", plan)


def _write_paths(comparison: Comparison, folder: Path) -> None:
    """Write the paths of every strategy in the formats of other programs."""
    from ccfem.printing.export.robot_waypoints import write_robot_waypoints
    from ccfem.printing.export.vtk import write_paths
    from ccfem.printing.export.waypoints import write_waypoints

    runs, machine = comparison.succeeded, comparison.case.machine
    for run in runs:
        layers, stem = comparison.stacks[run.slicing], _stem(run.slicing, run)
        flat = all(layer.flat is not None for layer in layers)
        if flat and not comparison.over_slicings:
            write_waypoints(folder / f"{stem}_waypoints.txt", run.toolpaths, layers)
        else:
            write_robot_waypoints(folder / f"{stem}_waypoints.csv", run.toolpaths, layers, machine)
        if not flat and not comparison.over_slicings:
            _write_matrix(comparison, folder)
        if run.print_plan is not None:
            _write_print(folder, stem, run.print_plan, comparison)
    every = Toolpaths.concatenate(run.toolpaths for run in runs)
    number = np.repeat(np.arange(float(len(runs))), [len(run.toolpaths) for run in runs])
    write_paths(every, folder / "paths.vtp", path_data={"strategy": number})
