"""Results on disk: tables, record, paths and pictures, written whole or not at all."""

import dataclasses
import json
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem import __version__
from ccfem.comparison.headline import TEST_COLUMNS, headline_values
from ccfem.comparison.result import Comparison, Run
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError
from ccfem.progress import Progress, silent
from ccfem.toolpaths import Toolpaths

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["record", "results_frame", "staged", "write_results"]

_PACKAGES = ("numpy", "scipy", "numba", "pyamg", "shapely", "pypardiso")


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


def results_frame(comparison: Comparison) -> "pd.DataFrame":
    """Every index of every run: one row per layer, and one in total.

    Returns
    -------
    DataFrame
        Columns strategy, layer ("total" or its index), failure, the evaluator's columns, and those
        of the virtual test, which are of the whole part and stand in the total rows only.
        A failed strategy has its total row, with the reason and no numbers.
    """
    import pandas as pd

    frames = []
    for run in comparison.runs:
        if run.evaluation is None:
            frames.append(pd.DataFrame({"layer": ["total"], "failure": [run.failure]}))
        else:
            frame = run.evaluation.to_frame().reset_index().assign(failure="")
            extra = headline_values(run)
            for column in TEST_COLUMNS:
                if column.name in extra:
                    frame.loc[frame.index[-1], column.name] = extra[column.name]
            frames.append(frame)
        frames[-1].insert(0, "strategy", run.name)
    frame = pd.concat(frames, ignore_index=True)
    first = ["strategy", "layer", "failure"]
    return frame[first + [name for name in frame.columns if name not in first]]


def record(comparison: Comparison, command: str, seconds: Mapping[str, float]) -> dict[str, Any]:
    """Everything that it takes to judge and repeat a comparison, ready for JSON.

    Parameters
    ----------
    comparison : Comparison
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
    mesh = case.problem.mesh
    return _plain(
        {
            "ccfem": __version__,
            "command": command,
            "made": datetime.now(UTC).isoformat(timespec="seconds"),
            "versions": _versions(),
            "case": {
                "name": case.name,
                "title": case.title,
                "source": case.source,
                "findings": case.findings,
                "load_case": stress.case,
                "load": _load(stress),
                "material": case.problem.material.name,
                "build": case.build,
                "layers": len(comparison.layers),
                "heights": [layer.plane.height for layer in comparison.layers],
                "nodes": len(mesh.points),
                "cells": len(mesh.cells),
                "order": mesh.order,
            },
            "machine": dataclasses.asdict(case.machine),
            "solver": vars(stress.record),
            "strain_energy": stress.strain_energy,
            "fibre_per_layer": comparison.fibre_per_layer,
            "upper_bound": None if comparison.bound is None else comparison.bound.ratio,
            "seconds": {**seconds, **comparison.seconds},
            "strategies": [_run_record(run) for run in comparison.runs],
        }
    )


def _load(stress: StressField) -> list[float] | None:
    """Resultant that the supports hold, N; None where nothing is left over, as between grips."""
    total = -stress.reactions.sum(axis=0)
    size = float(np.linalg.norm(total))
    if not size > 1e-6 * float(np.linalg.norm(stress.reactions, axis=1).sum()):
        return None
    return [float(size * share) for share in np.round(total / size, 6) + 0.0]


def _run_record(run: Run) -> dict[str, Any]:
    return {
        "name": run.name,
        "parameters": run.parameters,
        "length_per_layer": run.length_per_layer,
        "note": run.note,
        "failure": run.failure,
        "seconds": run.seconds,
        "untested": run.untested,
        "total": headline_values(run),
        "first_failure": vars(run.tested.failure) if run.tested and run.tested.failure else None,
    }


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version(), "system": platform.platform()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def _plain(value: Any) -> Any:
    """Turn mappings, arrays and numbers into what JSON holds; NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def write_results(
    comparison: Comparison,
    folder: Path,
    command: str = "",
    seconds: Mapping[str, float] | None = None,
    progress: Progress = silent,
    gcode: bool = False,
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html``, pictures and paths.

    In ``paths.vtp`` the cell array "strategy" numbers the strategies that did not fail, in the
    order of ``results.json``.

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
    gcode : bool, default False
        Also write ``STRATEGY.gcode``: the whole part, matrix and fibre.

    Raises
    ------
    InputError
        Where the part cannot be printed as it is planned.
    """
    from ccfem.comparison.pictures import draw_pictures
    from ccfem.comparison.report import report_html
    from ccfem.export.vtk import write_paths
    from ccfem.export.waypoints import write_waypoints

    start = time.perf_counter()
    pictures = draw_pictures(comparison, lambda what, share: progress(what, 0.9 * share))
    spent = {**(seconds or {}), "pictures": time.perf_counter() - start}
    progress("writing results", 0.9)
    for (name, index), image in pictures.paths.items():
        (folder / f"{name}_layer_{index:02d}.png").write_bytes(image)
    for name, image in pictures.forces.items():
        (folder / f"{name}_force.png").write_bytes(image)
    (folder / "tension.png").write_bytes(pictures.tension)
    (folder / "overview.png").write_bytes(pictures.overview)
    results_frame(comparison).to_csv(folder / "results.csv", index=False)
    runs = comparison.succeeded
    for run in runs:
        write_waypoints(folder / f"{run.name}_waypoints.txt", run.toolpaths, comparison.layers)
        if gcode:
            _write_gcode(folder / f"{run.name}.gcode", run.toolpaths, comparison)
    every = Toolpaths.concatenate(run.toolpaths for run in runs)
    number = np.repeat(np.arange(float(len(runs))), [len(run.toolpaths) for run in runs])
    write_paths(every, folder / "paths.vtp", path_data={"strategy": number})
    about = record(comparison, command, spent)
    page = report_html(comparison, about, pictures)
    (folder / "report.html").write_text(page, encoding="utf-8")
    about["files"] = sorted({path.name for path in folder.iterdir()} | {"results.json"})
    text = json.dumps(about, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _write_gcode(path: Path, toolpaths: Toolpaths, comparison: Comparison) -> None:
    from ccfem.export.gcode import write_gcode
    from ccfem.export.print_plan import plan_print

    case = comparison.case
    plan = plan_print(toolpaths, comparison.layers, case.problem.mesh, case.machine)
    write_gcode(path, plan, case.machine)
