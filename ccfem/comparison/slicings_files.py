"""What a comparison over several slicings leaves in a folder: tables, one report, pictures, paths.

Everything heavy (matplotlib, pyvista) is imported where it is needed.
"""

import json
import re
import time
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

from ccfem.comparison.headline import HEADLINE_OF_SLICINGS
from ccfem.comparison.html import figure, grid
from ccfem.comparison.record import record, results_frame
from ccfem.comparison.report_sections import (
    against_each_other,
    all_indices,
    computation,
    glossary,
    header,
    headline_section,
    page,
    parameters_section,
    reproduce,
)
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.slicings import SlicingComparison
from ccfem.progress import Progress, silent

__all__ = ["write_slicings"]


def write_slicings(
    comparison: SlicingComparison,
    folder: Path,
    command: str = "",
    seconds: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> None:
    """Write ``results.csv``, ``results.json``, ``report.html``, pictures and paths.

    For each slicing ``SLICING_overview.png``, all strategies on its middle layer with fibre; for
    each run ``SLICING_STRATEGY_space.png``, a page that turns, ``SLICING_STRATEGY_space.html``, and
    its waypoints. Characters that do not suit a file are dashes.

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
    """
    import pandas as pd

    start = time.perf_counter()
    pictures: dict[str, str] = {}
    for k, (name, one) in enumerate(comparison.slicings.items()):
        progress(f"drawing {name}", 0.9 * k / len(comparison.slicings))
        pictures[name] = _pictures(name, one, folder)
        for run in one.succeeded:
            _write_waypoints(name, one, run, folder)
    spent = {**(seconds or {}), "pictures": time.perf_counter() - start}
    progress("writing results", 0.9)
    tables = [results_frame(one).assign(slicing=name) for name, one in comparison.slicings.items()]
    table = pd.concat(tables, ignore_index=True)
    table.insert(0, "slicing", table.pop("slicing"))
    table.to_csv(folder / "results.csv", index=False)
    about = _record(comparison, command, spent)
    (folder / "report.html").write_text(_report(comparison, about, pictures), encoding="utf-8")
    about["files"] = sorted({path.name for path in folder.iterdir()} | {"results.json"})
    text = json.dumps(about, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "results.json").write_text(text + "\n", encoding="utf-8")


def _slug(*names: str) -> str:
    return "_".join(re.sub(r"[^\w.+-]+", "-", name) for name in names)


def _pictures(name: str, comparison: Comparison, folder: Path) -> str:
    """Write the pictures of one slicing; they as parts of a page."""
    from ccfem.comparison.pictures import overview_picture
    from ccfem.plot.canvas import png
    from ccfem.plot.stack_page import space_picture, turning_page

    case, layers = comparison.case, comparison.layers
    if not comparison.succeeded:
        return ""
    overview = png(overview_picture(comparison))
    (folder / f"{_slug(name)}_overview.png").write_bytes(overview)
    shown = []
    for run in comparison.succeeded:
        title = f"{case.name}, {run.name} on {name}"
        image = png(space_picture(layers, run.toolpaths, title, case.build))
        stem = f"{_slug(name, run.name)}_space"
        (folder / f"{stem}.png").write_bytes(image)
        turning = turning_page(layers, run.toolpaths, title, case.build)
        (folder / f"{stem}.html").write_text(turning, encoding="utf-8")
        shown.append(
            figure(image, title) + f'<p class="note"><a href="{stem}.html">turn it</a></p>'
        )
    return grid([figure(overview, f"{name}: middle layer with fibre")]) + "".join(shown)


def _write_waypoints(name: str, comparison: Comparison, run: Run, folder: Path) -> None:
    """Write the paths of a run for robots, with their normals."""
    from ccfem.export.robot_waypoints import write_robot_waypoints

    file = folder / f"{_slug(name, run.name)}_waypoints.csv"
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
                "fibre_per_layer": part["fibre_per_layer"],
                "strategies": part["strategies"],
            }
            for name, part in parts.items()
        },
    }


def _report(
    comparison: SlicingComparison, about: Mapping[str, Any], pictures: Mapping[str, str]
) -> str:
    """Return the report as one HTML text."""
    amount = "each run lays its own amount of fibre"
    if comparison.fibre is not None:
        amount = f"{1e-3 * comparison.fibre:.2f} m of fibre in all"
    stacks = [f"{name}: {len(one.layers)} layers" for name, one in comparison.slicings.items()]
    said = [comparison.verdict] if comparison.verdict else []
    shown = "".join(f"<h3>{escape(name)}</h3>\n{each}\n" for name, each in pictures.items() if each)
    return page(
        comparison.case.title,
        [
            header(comparison, about, [*stacks, amount]),
            headline_section(comparison, comparison.wanted, said, HEADLINE_OF_SLICINGS),
            against_each_other(comparison),
            f"<h2>Layers and paths</h2>\n{shown}",
            all_indices(comparison),
            parameters_section(comparison),
            computation(comparison, about),
            glossary(),
            reproduce(about),
        ],
    )
