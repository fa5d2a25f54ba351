"""What a comparison over several slicings leaves in a folder: tables, one report, pictures, paths.

Everything heavy (matplotlib, pyvista) is imported where it is needed.
"""

import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ccfem.comparison.record import record, results_rows, write_table
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.shown import file_stem
from ccfem.comparison.slicings import SlicingComparison
from ccfem.progress import Progress, silent

__all__ = ["write_slicings"]


def write_slicings(
    comparison: SlicingComparison,
    folder: Path,
    command: str = "",
    seconds: Mapping[str, float] | None = None,
    progress: Progress = silent,
    pictures: bool = False,
    part_file: str = "",
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html`` and paths; pictures where wanted.

    For each run its waypoints, ``SLICING_STRATEGY_waypoints.csv``. Characters that do not suit a
    file are dashes.

    Parameters
    ----------
    comparison : SlicingComparison
    folder : Path
        An existing folder.
    command : str
        What was typed; the report tells how to repeat it.
    seconds : mapping of stage to float, optional
        Stages outside the comparison.
    progress : callable, optional
    pictures : bool, default False
        Also draw, for each slicing, ``SLICING_overview.png``, all strategies on the layer that
        stands for all; for each run ``SLICING_STRATEGY_space.png`` and a page that turns,
        ``SLICING_STRATEGY_space.html``.
    part_file : str
        Text of the part file, for the report.
    """
    from ccfem.comparison.report import report_html

    start = time.perf_counter()
    spent = dict(seconds or {})
    if pictures:
        for k, (name, one) in enumerate(comparison.slicings.items()):
            progress(f"drawing {name}", 0.6 * k / len(comparison.slicings))
            _pictures(name, one, folder)
        spent["pictures"] = time.perf_counter() - start
    progress("writing results", 0.6)
    start = time.perf_counter()
    for name, one in comparison.slicings.items():
        for run in one.succeeded:
            _write_waypoints(name, one, run, folder)
    rows = [
        {"slicing": name, **row}
        for name, one in comparison.slicings.items()
        for row in results_rows(one)
    ]
    write_table(rows, folder / "results.csv", first=("slicing",))
    spent["files"] = time.perf_counter() - start
    progress("writing the report", 0.8)
    about = _record(comparison, command, spent)
    page = report_html(comparison, about, part_file)
    (folder / "report.html").write_text(page, encoding="utf-8")
    about["seconds"]["report"] = time.perf_counter() - start - spent["files"]
    about["files"] = sorted({path.name for path in folder.iterdir()} | {"results.json"})
    text = json.dumps(about, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _pictures(name: str, comparison: Comparison, folder: Path) -> None:
    """Write the pictures of one slicing."""
    from ccfem.comparison.pictures import overview_picture
    from ccfem.plot.canvas import png
    from ccfem.plot.stack_page import space_picture, turning_page

    case, layers = comparison.case, comparison.layers
    if not comparison.succeeded:
        return
    (folder / f"{file_stem(name)}_overview.png").write_bytes(png(overview_picture(comparison)))
    for run in comparison.succeeded:
        title = f"{case.name}, {run.name} on {name}"
        stem = file_stem(name, run.name)
        image = png(space_picture(layers, run.toolpaths, title, case.build))
        (folder / f"{stem}_space.png").write_bytes(image)
        turning = turning_page(layers, run.toolpaths, title, case.build)
        (folder / f"{stem}_space.html").write_text(turning, encoding="utf-8")


def _write_waypoints(name: str, comparison: Comparison, run: Run, folder: Path) -> None:
    """Write the paths of a run for robots, with their normals."""
    from ccfem.export.robot_waypoints import write_robot_waypoints

    file = folder / f"{file_stem(name, run.name)}_waypoints.csv"
    write_robot_waypoints(file, run.toolpaths, comparison.layers, comparison.case.machine)


def _record(
    comparison: SlicingComparison, command: str, seconds: Mapping[str, float]
) -> dict[str, Any]:
    """Everything that it takes to judge and repeat a comparison, ready for JSON."""
    parts = {name: record(one, command, {}) for name, one in comparison.slicings.items()}
    first = next(iter(parts.values()))
    shared = {key: first[key] for key in ("ccfem", "command", "made", "versions", "machine")}
    own = ("layers", "heights")
    return {
        **shared,
        "case": {key: value for key, value in first["case"].items() if key not in own},
        "solver": first["solver"],
        "strain_energy": first["strain_energy"],
        "fibre": comparison.fibre,
        "verdict": comparison.verdict,
        "remarks": comparison.remarks,
        "refused": dict(comparison.refused),
        "seconds": {**seconds, **comparison.seconds},
        "slicings": {
            name: {
                **{key: part["case"][key] for key in own},
                "slicer": name.partition(":")[0],
                "fibre_per_layer": part["fibre_per_layer"],
                "strategies": part["strategies"],
            }
            for name, part in parts.items()
        },
    }
