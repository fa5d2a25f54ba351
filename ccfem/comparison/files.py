"""Results on disk: tables, record, paths and pictures."""

import dataclasses
import json
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ccfem.base.checks import member_name
from ccfem.base.csv_table import write_csv
from ccfem.base.errors import spared
from ccfem.base.parallel import in_processes
from ccfem.base.progress import Progress, silent
from ccfem.base.result_folder import whole_folder
from ccfem.base.whole import whole_file
from ccfem.comparison.bed_print import BedPrint
from ccfem.comparison.headline import TEST_COLUMNS, headline_values, print_values
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Printed, Run
from ccfem.comparison.shown import file_stem
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad
from ccfem.machine.machine import Machine
from ccfem.paths.planning.given_paths import pattern_that_folds
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.print_plan import PrintPlan
from ccfem.slicing.layers.layer import curved_layers

if TYPE_CHECKING:
    from ccfem.comparison.pictures import Pictures
    from ccfem.comparison.report.html_report import Record

RESULT_FILES = (
    *("results.csv", "results.json", "report.html", "paths.vtp", "curve.csv", "curve.png"),
    *("*_breaking.csv", "breaking.png"),
    *("tension.png", "overview.png", "part.png", "part.html"),
    *("*_waypoints.txt", "*_waypoints.csv", "*.gcode", "*_cell.csv", "*_trim.csv"),
    *("*_layer_[0-9]*.png", "*_layer_[0-9]*.svg", "*_layer_[0-9]*.dxf", "*_force.png"),
    *("*_space.png", "*_space.html", "*_overview.png"),
)
"""Patterns of all files that comparisons, over slicings too, write (`whole_folder`)."""


BEFORE_REPORT = 0.8
"""Share of writing that is told when the report begins."""


def save(
    comparison: Comparison,
    folder: str | os.PathLike[str],
    force: bool = False,
    progress: Progress = silent,
    cell: bool = False,
) -> Path:
    """Write the report, tables and paths of a comparison: all files or none.

    Parameters
    ----------
    folder : path
        In an existing folder only files that ccfem wrote, and nobody has changed, are replaced.
    force : bool, default False
        Also replace files of the same names that others wrote or changed.
    cell : bool, default False
        As in `write_results`.

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
        write_results(comparison, temporary, command, {}, progress, cell=cell)
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
    cell: bool = False,
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html`` and paths; pictures where wanted.

    With a curve, also ``curve.csv``; with breaking loads ``breaking.png`` and
    ``STRATEGY_breaking.csv``; where layers are curved, ``matrix_waypoints.csv``, rings that
    fill the layers. Runs with a print plan get ``STRATEGY.gcode`` too, ``STRATEGY_cell.csv`` with
    the same moves where they are wanted, and ``STRATEGY_trim.csv`` where strands leave the part. In
    ``paths.vtp`` the cell array "strategy" numbers the strategies that did not fail, in the order
    of ``results.json``. Over slicings the name of the slicing stands before that of the strategy:
    ``SLICING_STRATEGY_waypoints.csv``. Characters that do not suit a file are dashes. Numbers and
    paths come first: a picture or a view of the report that fails is left out with a warning, which
    ``results.json`` keeps under "left_out".

    Parameters
    ----------
    folder : Path
        An existing folder; use `ccfem.base.result_folder.whole_folder` to have all files or none.
    command : str
        What was typed; the report tells how to repeat it.
    seconds : mapping of stage to float, optional
        Stages outside the comparison.
    pictures : bool, default False
        Also draw what the report shows as PNG files: every layer of every strategy, forces,
        tension, all side by side, the part and the curve; and ``part.html``, which turns the part.
        Where layers are curved, also ``STRATEGY_space.png`` and ``STRATEGY_space.html``. Over
        slicings ``SLICING_overview.png`` and the views in space of every run.
    part_file : str
        Text of the part file, for the report.
    drawings : sequence of {"svg", "dxf"}
        Also draw every flat layer of every run to scale: ``STRATEGY_layer_NN.svg``, ``.dxf``.
    cell : bool, default False
        Also write the moves of prints for a cell of robots: a table twice as large as the G-code.
    """
    start = time.perf_counter()
    spent, left_out = dict(seconds or {}), list[str]()
    progress("writing results", 0.0)
    write_table(results_rows(comparison), folder / "results.csv")
    if comparison.curve is not None:
        frame = comparison.curve.frame
        write_csv(folder / "curve.csv", [*frame], frame.itertuples(index=False))
    for name, broken in comparison.broken.items():
        rows = breaking_rows(broken)
        write_csv(folder / f"{file_stem(name)}_breaking.csv", _BREAKING, rows)
    _write_paths(comparison, folder, cell)
    spent["files"] = time.perf_counter() - start
    start = time.perf_counter()
    for suffix in drawings:
        with spared(f"drawings ({suffix})", left_out):
            _write_drawings(comparison, folder, suffix)
    if comparison.broken:
        from ccfem.comparison.plot.canvas import png
        from ccfem.comparison.plot.curves import breaking_picture

        with spared("breaking.png", left_out):
            colours = palette(run.name for run in comparison.runs)
            picture = png(breaking_picture(comparison.broken, colours))
            (folder / "breaking.png").write_bytes(picture)
    if pictures:
        drawn = BEFORE_REPORT - 0.2
        _draw(comparison, folder, lambda what, share: progress(what, 0.2 + drawn * share), left_out)
        spent["pictures"] = time.perf_counter() - start
    progress("writing the report", BEFORE_REPORT)
    about = record(comparison, command, spent)
    about["left_out"] = left_out
    _write_report(comparison, about, folder, part_file)


def _write_report(comparison: Comparison, about: "Record", folder: Path, part_file: str) -> None:
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
        curved = curved_layers(alone.layers)
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


_Write = Callable[[], None]
"""Writes a file."""


def _write_matrix(comparison: Comparison, folder: Path) -> None:
    """Write the matrix of curved layers for robots."""
    from ccfem.paths.toolpaths import MATRIX
    from ccfem.printing.curved_stack import layer_matrix
    from ccfem.printing.export.robot_waypoints import write_robot_waypoints

    layers, machine = comparison.layers, comparison.case.machine
    matrix = layer_matrix(layers, machine)
    write_robot_waypoints(folder / "matrix_waypoints.csv", matrix, layers, machine, MATRIX)


def write_printed(
    path: Path, printed: Printed, machine: Machine, title: str, doubts: Sequence[str]
) -> None:
    """Write what a printer does to print a run or parts together, several layers at a time."""
    from ccfem.printing.export.gcode import gcode_pieces

    plan, moves = printed.print_plan, printed.moves
    assert plan is not None
    assert moves is not None
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(gcode_pieces(moves, plan, machine, title, doubts, printed.print_totals))


def files_of_print(folder: Path, name: str, run: Printed, cell: bool) -> list[_Write]:
    """Files of the same chain of moves for a cell of robots, and of where strands are trimmed."""
    from ccfem.printing.export.robot_waypoints import write_robot_cell

    files: list[_Write] = []
    if cell and run.moves is not None:
        files.append(partial(write_robot_cell, folder / f"{name}_cell.csv", run.moves))
    if run.print_plan is not None and len(run.print_plan.trims):
        files.append(partial(write_trims, folder / f"{name}_trim.csv", run.print_plan))
    return files


def _write_paths(comparison: Comparison, folder: Path, cell: bool) -> None:
    """Write the paths of every strategy in the formats of other programs, several at a time."""
    from ccfem.printing.export.robot_waypoints import write_robot_waypoints
    from ccfem.printing.export.vtk import write_paths
    from ccfem.printing.export.waypoints import write_waypoints

    runs, machine = comparison.succeeded, comparison.case.machine
    number = np.repeat(np.arange(float(len(runs))), [len(run.toolpaths) for run in runs])

    def write_all_paths() -> None:
        # One plan is not copied: those of large prints fill memory.
        alone = runs[0].toolpaths if len(runs) == 1 else None
        every = alone or Toolpaths.concatenate(run.toolpaths for run in runs)
        write_paths(every, folder / "paths.vtp", path_data={"strategy": number})

    files: list[_Write] = []
    for run in runs:
        if run.print_plan is not None and run.moves is not None:
            stem, doubts = _stem(run.slicing, run), [run.why_not] if run.why_not else []
            title = f"{comparison.case.name}, {stem}"
            write_printed(folder / f"{stem}.gcode", run, machine, title, doubts)
            files += files_of_print(folder, stem, run, cell)
    if not comparison.over_slicings and runs and curved_layers(comparison.layers):
        files.append(partial(_write_matrix, comparison, folder))
    files.append(write_all_paths)
    for run in runs:
        layers, stem = comparison.stacks[run.slicing], _stem(run.slicing, run)
        if comparison.over_slicings or curved_layers(layers):
            file = folder / f"{stem}_waypoints.csv"
            files.append(partial(write_robot_waypoints, file, run.toolpaths, layers, machine))
        else:
            file = folder / f"{stem}_waypoints.txt"
            pattern = pattern_that_folds(run.strategy, run.name)
            files.append(partial(write_waypoints, file, run.toolpaths, layers, pattern))
    for _ in in_processes(lambda write: write(), files, writes=True):
        pass


# The record of a comparison: all its numbers as a table, and what it takes to repeat it.


_FIRST = ("slicing", "strategy", "layer", "failure", "printable", "why_not")

_PACKAGES = ("numpy", "scipy", "numba", "pyamg", "shapely", "pypardiso")


def results_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Every index of every run: one row per layer, and one in total.

    Columns are slicing where several are compared, strategy, layer ("total" or its index), failure,
    printable, why_not (what keeps the paths from being printed), the evaluator's columns, and those
    of the virtual test. Printable, why_not and the virtual test are of the whole part, and stand in
    the total rows only. A failed strategy has its total row, with the reason and no numbers. A row
    holds what it has a value for.
    """
    rows: list[dict[str, Any]] = []
    for run in comparison.runs:
        labels = {"slicing": run.slicing} if comparison.over_slicings else {}
        labels |= {"strategy": run.strategy_name}
        if run.evaluation is None:
            rows.append({**labels, "layer": "total", "failure": run.failure, "printable": False})
            continue
        values = run.evaluation.values
        for k, layer in enumerate((*run.evaluation.layers, "total")):
            scalars = {name: value[k].item() for name, value in values.items()}
            rows.append({**labels, "layer": layer, "failure": "", **scalars})
        extra = headline_values(run)
        tested = (column.name for column in TEST_COLUMNS)
        rows[-1] |= {name: extra[name] for name in tested if name in extra} | print_values(run)
        rows[-1] |= {"printable": run.printable, "why_not": run.why_not, "fails_in": run.fails_in}
        rows[-1] |= run.cases.values() if run.cases else {}
    return rows


_BREAKING = (
    *("curve", "displacement_mm", "load_N"),
    *("cells_cracked", "fibre_broken_mm", "cells_parted"),
)


def breaking_rows(broken: BreakingLoad) -> Iterator[tuple[str, float, float, int, float, int]]:
    """Rows of load over displacement of an experiment: "middle", "low" and "high" of its band."""
    for name, curve in (("middle", broken.curve), ("low", broken.low), ("high", broken.high)):
        if curve is not None:
            lost = curve.cracks, curve.broken, curve.parted
            columns = (curve.displacement, curve.force, *lost)
            for row in zip(*(column.tolist() for column in columns), strict=True):
                yield name, *row


def _columns(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Columns of rows: who, where and why not first, then in the order in which they occur."""
    names = [name for row in rows for name in row]
    return list(dict.fromkeys([*(n for n in _FIRST if n in names or n != "slicing"), *names]))


def write_table(rows: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Write rows as CSV; what is missing or not a number is empty.

    Pandas, which takes a second to be imported, is not needed for this.
    """
    columns = _columns(rows)
    write_csv(file, columns, ([row.get(name) for name in columns] for row in rows))


def record(comparison: Comparison, command: str, seconds: Mapping[str, float]) -> "Record":
    """Everything that it takes to judge and repeat a comparison, ready for JSON.

    Parameters
    ----------
    command : str
        What was typed, or how the comparison was made.
    seconds : mapping of stage to float
        Stages outside the comparison.

    Returns
    -------
    dict
        Versions, case, machine, mesh, solver record, stage times, and per strategy its parameters,
        note, failure, times and total indices.
    """
    case, stress = comparison.case, comparison.stress
    mesh = stress.mesh
    about: dict[str, Any] = {
        "ccfem": version("ccfem"),
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "case": {
            "name": case.name,
            "title": case.title,
            "source": case.source,
            "findings": (*case.findings, *stress.findings),
            "load_case": stress.case,
            "load": _load(stress),
            "material": case.problem.material.name,
            "plastic": dataclasses.asdict(case.plastic),
            "scatter": dataclasses.asdict(case.scatter),
            "build": case.build,
            "nodes": len(mesh.points),
            "cells": len(mesh.cells),
            "order": mesh.order,
        },
        "machine": dataclasses.asdict(case.machine),
        "solver": vars(stress.record),
        "planned_on_given_stress": comparison.given is not None,
        "strain_energy": stress.strain_energy,
        "seconds": {**seconds, **comparison.seconds},
    }
    if comparison.over_slicings:
        return cast("Record", plain_record(about | _of_slicings(comparison)))
    about["case"] |= _of_layers(comparison)
    return cast("Record", plain_record(about | _of_strategies(comparison) | _of_bound(comparison)))


def _of_layers(comparison: Comparison) -> dict[str, Any]:
    layers = comparison.layers
    heights = [None if layer.flat is None else layer.flat.height for layer in layers]
    return {"layers": len(layers), "heights": heights}


def _of_strategies(comparison: Comparison) -> dict[str, Any]:
    """Say what cut the layers, how much fibre lies on them, and what each strategy did."""
    slicer = comparison.request.slicings[""].slicer or comparison.case.slicing
    return {
        "slicer": member_name(slicer),
        "fibre_per_layer": comparison.fibre_per_layer,
        "strategies": [run_record(run) for run in comparison.runs],
    }


def _of_bound(comparison: Comparison) -> dict[str, Any]:
    """Say what no paths exceed, what was compared at several lengths, and what to know of it."""
    alone = None if comparison.several_cases else comparison.bound
    curve = comparison.curve
    return {
        "upper_bound": None if alone is None else alone.ratio,
        "upper_bound_gap": None if alone is None else alone.duality_gap,
        "load_cases": _load_cases(comparison) if comparison.several_cases else None,
        "curve": None if curve is None else curve.frame.to_dict(orient="records"),
        "remarks": comparison.remarks,
    }


def _of_slicings(comparison: Comparison) -> dict[str, Any]:
    """Say what was done on each slicing."""
    return {
        "fibre": comparison.fibre,
        "verdict": comparison.verdict,
        "remarks": comparison.remarks,
        "refused": dict(comparison.refused),
        "slicings": {
            name: _of_layers(alone) | _of_strategies(alone)
            for name, alone in comparison.slicings.items()
        },
    }


def _load_cases(comparison: Comparison) -> dict[str, Any]:
    """Say what each load case counts, and what no paths exceed."""
    cases, bound = comparison.cases, comparison.bound
    weights = dict(zip(cases.names, cases.weights.tolist(), strict=True))
    if bound is None:
        return {"weights": weights, "bound": None}
    kept = ("objective", "singles", "case_weights", "least", "factors")
    values = {name: getattr(bound, name) for name in kept} | {"reached": bound.attained}
    return {"weights": weights, "bound": values}


def _load(stress: StressField) -> list[float] | None:
    """Resultant that the supports hold, N; None where nothing is left over, as between grips."""
    total = -stress.reactions.sum(axis=0)
    size = float(np.linalg.norm(total))
    if not size > 1e-6 * float(np.linalg.norm(stress.reactions, axis=1).sum()):
        return None
    return [float(size * share) for share in np.round(total / size, 6) + 0.0]


def run_record(run: Run) -> dict[str, Any]:
    """Say what a strategy did, with which parameters, and what came of it."""
    return {
        "name": run.name,
        "methods": _methods(run),
        "parameters": run.parameters,
        "length_per_layer": run.length_per_layer,
        "note": run.note,
        "failure": run.failure,
        "printable": run.printable,
        "why_not": run.why_not,
        "seconds": run.seconds,
        "untested": run.untested,
        "total": headline_values(run),
        "print": print_record(run),
        "load_cases": run.cases.values() if run.cases else None,
        "first_failure": vars(run.tested.failure) if run.tested and run.tested.failure else None,
        "first_failure_alternative": _alternative_failure(run),
        "pinned_joints": [vars(joint) for joint in run.tested.joints] if run.tested else None,
        "breaking_load_experiment": _breaking_record(run.broken),
    }


def _breaking_record(broken: BreakingLoad | None) -> dict[str, Any] | None:
    """Say at which load a part breaks, its band, and how; None where that was not computed."""
    if broken is None:
        return None
    low, high = broken.band
    return {
        "load": broken.load,
        "low": low,
        "high": high,
        "first": broken.curve.first,
        "first_load": float(broken.curve.force[1]),
        "where": broken.curve.where,
        "softening": broken.softening,
        "said": broken.said,
    }


def print_record(run: Printed) -> dict[str, Any] | None:
    """Say of how many copies a print is, what it takes by layer and of spools, and its cost."""
    totals, plan = run.print_totals, run.print_plan
    if totals is None or plan is None:
        return None
    return {
        "copies": plan.copies,
        "pauses": list(plan.pauses),
        "first_layer": plan.first,
        "layer_seconds": {k: round(taken, 1) for k, taken in totals.by_layer.items()},
        "spools": [vars(spool) for spool in totals.spools],
        "cost": dict(totals.cost),
        "currency": totals.currency,
    }


def _methods(run: Run) -> list[str]:
    """Name the strategy of a run, and those that stand among its parameters."""
    inner = [value for value in run.parameters.values() if dataclasses.is_dataclass(value)]
    return [member_name(member) for member in (run.strategy, *inner)]


def _alternative_failure(run: Run) -> dict[str, Any] | None:
    """Say what fails first under the alternative supports; None where there are none."""
    other = None if run.tested is None else run.tested.alternative
    return vars(other.failure) if other is not None and other.failure is not None else None


def versions() -> dict[str, str]:
    """Versions of what computes."""
    known = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        try:
            known[package] = version(package)
        except PackageNotFoundError:
            known[package] = "not installed"
    return known


def plain_record(value: Any) -> Any:
    """Turn mappings, arrays and numbers into what JSON holds; NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): plain_record(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain_record(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_record(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def write_trims(path: str | Path, plan: PrintPlan) -> None:
    """Write where the knife comes behind a print: places at which strands cross the part's border.

    ``layer, x, y, z``, on the bed of the printer, mm.
    """
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write("layer,x,y,z\n")
        for layer, x, y in plan.trims.tolist():
            file.write(f"{layer:.0f},{x:.3f},{y:.3f},{plan.top[int(layer)]:.3f}\n")


# Files of parts that are printed together: one G-code, one table, one report.


BED_FILES = ("bed.gcode", "bed_cell.csv", "bed_trim.csv", "bed.json", "parts.csv", "report.html")
"""All files that parts printed together write."""


def write_bed(bed: BedPrint, folder: Path, command: str = "", cell: bool = False) -> None:
    """Write ``bed.gcode``, ``parts.csv``, ``bed.json`` and ``report.html``.

    Parameters
    ----------
    folder : Path
        An existing folder, as of `ccfem.comparison.files.write_results`.
    command : str
        What was typed.
    cell : bool, default False
        Also write the moves for a cell of robots, ``bed_cell.csv``.
    """
    from ccfem.comparison.report.html_report import bed_html

    title = ", ".join(f"{name}, {run.strategy_name}" for name, run in bed.runs.items())
    write_printed(folder / "bed.gcode", bed, bed.machine, title, bed.doubts)
    for write in files_of_print(folder, "bed", bed, cell):
        write()
    write_table(_bed_rows(bed), folder / "parts.csv")
    about, left_out = _bed_record(bed, command), list[str]()
    with spared("report.html", left_out):
        page = bed_html(bed, cast("Record", about), left_out)
        (folder / "report.html").write_text(page, encoding="utf-8")
    text = json.dumps(about | {"left_out": left_out}, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "bed.json").write_text(text + "\n", encoding="utf-8")


def _bed_rows(bed: BedPrint) -> list[dict[str, Any]]:
    """Totals of each part, with its share of the print, as of all of its kind on the bed."""
    shares = {part.name: part for part in bed.print_totals.parts}
    rows = []
    for name, comparison in bed.comparisons.items():
        share = dataclasses.asdict(shares[name])
        printed = {f"print_{key}": value for key, value in share.items() if key != "name"}
        rows.append({"part": name, **printed, **results_rows(comparison)[-1]})
    return rows


def _bed_record(bed: BedPrint, command: str) -> dict[str, Any]:
    """Say what it takes to judge and repeat a print, ready for JSON."""
    about = {
        "ccfem": version("ccfem"),
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": dataclasses.asdict(bed.machine),
        "standing": [dataclasses.asdict(spot) for spot in bed.print_plan.standing],
        "print": print_record(bed),
        "parts": {name: run_record(run) for name, run in bed.runs.items()},
    }
    return cast("dict[str, Any]", plain_record(about))
