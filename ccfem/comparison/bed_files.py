"""Files of parts that are printed together: one G-code, one table, one report."""

import dataclasses
import json
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

from ccfem.base.errors import spared
from ccfem.comparison import files
from ccfem.comparison.bed_print import BedPrint

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
    from ccfem.comparison.report.html_report import Record, bed_html

    title = ", ".join(f"{name}, {run.strategy_name}" for name, run in bed.runs.items())
    files.write_printed(folder / "bed.gcode", bed, bed.machine, title, bed.doubts)
    for write in files.files_of_print(folder, "bed", bed, cell):
        write()
    files.write_table(_rows(bed), folder / "parts.csv")
    about, left_out = _record(bed, command), list[str]()
    with spared("report.html", left_out):
        page = bed_html(bed, cast("Record", about), left_out)
        (folder / "report.html").write_text(page, encoding="utf-8")
    text = json.dumps(about | {"left_out": left_out}, indent=1, ensure_ascii=False, allow_nan=False)
    (folder / "bed.json").write_text(text + "\n", encoding="utf-8")


def _rows(bed: BedPrint) -> list[dict[str, Any]]:
    """Totals of each part, with its share of the print, as of all of its kind on the bed."""
    shares = {part.name: part for part in bed.print_totals.parts}
    rows = []
    for name, comparison in bed.comparisons.items():
        share = dataclasses.asdict(shares[name])
        printed = {f"print_{key}": value for key, value in share.items() if key != "name"}
        rows.append({"part": name, **printed, **files.results_rows(comparison)[-1]})
    return rows


def _record(bed: BedPrint, command: str) -> dict[str, Any]:
    """Say what it takes to judge and repeat a print, ready for JSON."""
    about = {
        "ccfem": version("ccfem"),
        "command": command,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": files.versions(),
        "machine": dataclasses.asdict(bed.machine),
        "standing": [dataclasses.asdict(spot) for spot in bed.print_plan.standing],
        "print": files.print_record(bed),
        "parts": {name: files.run_record(run) for name, run in bed.runs.items()},
    }
    return cast("dict[str, Any]", files.plain_record(about))
