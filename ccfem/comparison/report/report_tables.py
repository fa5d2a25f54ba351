"""Tables of the report as values: heads with what they mean, rows of cells."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.comparison.curve import Curve
from ccfem.comparison.headline import (
    HEADLINE,
    TEST_COLUMNS,
    Headline,
    cell_text,
    headline_values,
)
from ccfem.comparison.ranking import best_values, stiffness_ratios
from ccfem.comparison.request import Wanted
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.said_of_cases import cases_rows
from ccfem.judging.evaluation import COLUMNS

_OWN = {
    "printable": "Whether the paths keep all limits of the machine, and why not.",
    "fibre_per_layer": "Length of fibre over the number of layers.",
    "paths_per_layer": "Paths over the number of layers.",
    "all_crossings": "Points at which fibre crosses other fibre, or itself.",
}
"""Meaning of columns that are no index of their own."""


@dataclass(frozen=True)
class Cell:
    """A cell: its text, smaller text below it, what it is sorted by, and whether it is the best."""

    text: str
    small: str = ""
    value: float | str = ""
    best: bool = False
    bad: bool = False


@dataclass(frozen=True)
class Head:
    """Head of a column, and what it means."""

    title: str
    about: str = ""


@dataclass(frozen=True)
class Table:
    """A table whose rows begin with a name; a row without cells says instead why it has none."""

    heads: tuple[Head, ...]
    rows: tuple[tuple[str, tuple[Cell, ...], str], ...]


def number(value: float) -> str:
    """Write a number in a table; a dash where there is none."""
    if not np.isfinite(value):
        return "–"
    if abs(value) < 1e-9:
        return "0"
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def _numbered(value: float) -> Cell:
    return Cell(number(value), value=float(value))


def headline_table(
    comparison: Comparison, wanted: Wanted, columns: Sequence[Headline] = HEADLINE
) -> Table:
    """Table of the indices that matter first, the best run first."""
    best, runs = best_values(comparison.runs, wanted), comparison.ranking
    values = {run.name: headline_values(run) for run in runs}
    heads = [h for h in columns if any(h.column in found for found in values.values())]
    rows: list[tuple[str, tuple[Cell, ...], str]] = []
    for run in runs:
        cells = tuple(_headline_cell(run, head, values[run.name], best) for head in heads)
        if run.evaluation is None:
            rows.append((run.name, (), f"failed: {run.failure}"))
        else:
            rows.append((run.name, cells, ""))
    about = {
        column.name: f"{column.formula} {column.range}." for column in (*TEST_COLUMNS, *COLUMNS)
    }
    return Table(
        tuple(Head(h.title, _OWN.get(h.column, about.get(h.column, ""))) for h in heads),
        tuple(rows),
    )


def _headline_cell(
    run: Run, head: Headline, values: Mapping[str, float], best: Mapping[str, float]
) -> Cell:
    text, extra = cell_text(run, head)
    value = values.get(head.column, np.nan)
    if head.column == "printable":
        return Cell(text, value=value, bad=not run.printable)
    is_best = run.printable and value == best.get(head.column, np.nan)
    return Cell(text, extra, float(value), is_best)


def against_each_other(comparison: Comparison) -> Table | None:
    """Table of stiffness of each strategy over that of each other."""
    runs = [run for run in comparison.ranking if run.tested is not None]
    if len(runs) < 2:
        return None
    rows = []
    for run in runs:
        cells = []
        for other in runs:
            tension, bonded = stiffness_ratios(run, other)
            text = "–" if run is other else f"{tension:.2f} ({bonded:.2f})"
            cells.append(Cell(text, value=float(tension)))
        rows.append((run.name, tuple(cells), ""))
    return Table(tuple(Head(f"over {run.name}") for run in runs), tuple(rows))


def load_cases_table(comparison: Comparison) -> Table | None:
    """Table of every load case; None where paths are planned for one."""
    if not comparison.several_cases:
        return None
    heads, rows = cases_rows(comparison.ranking)
    cells = tuple((name, tuple(map(Cell, texts)), "") for name, texts in rows)
    return Table(tuple(map(Head, heads)), cells) if rows else None


def all_indices(comparison: Comparison) -> Table:
    """Table of every index of every run."""
    runs = [run for run in comparison.ranking if run.evaluation is not None]
    values = [headline_values(run) for run in runs]
    rows = []
    for column in (*TEST_COLUMNS, *COLUMNS):
        cells = tuple(_numbered(found.get(column.name, np.nan)) for found in values)
        unit = "" if column.unit == "1" else f" ({column.unit})"
        rows.append((f"{column.name}{unit}", cells, ""))
    return Table(tuple(Head(run.name) for run in runs), tuple(rows))


def curve_table(curve: Curve | None) -> Table | None:
    """Table of the points of a curve; None without one."""
    if curve is None:
        return None
    rows = []
    for name, points in curve.points.items():
        for wanted, run in points:
            values = headline_values(run)
            ratios = ("stiffness_ratio_tension", "stiffness_ratio_bonded")
            cells = (
                Cell(f"{wanted:.0f}", value=wanted),
                Cell(f"{run.length_per_layer:.0f}", value=run.length_per_layer),
                *(_numbered(values.get(column, np.nan)) for column in ratios),
                Cell(run.failure or run.why_not or "yes", bad=not run.printable),
            )
            rows.append((name, cells, ""))
    titles = ("wanted, mm a layer", "laid", "stiffness ×, tension only", "bonded", "printable")
    return Table(tuple(map(Head, titles)), tuple(rows))


def stage_seconds(comparison: Comparison) -> Table:
    """Table of the seconds that each stage took for each run."""
    stages = list(dict.fromkeys(stage for run in comparison.runs for stage in run.seconds))
    rows: list[tuple[str, tuple[Cell, ...], str]] = []
    for run in comparison.runs:
        spent: list[Any] = [run.seconds.get(stage, np.nan) for stage in stages]
        texts = ["–" if np.isnan(value) else f"{value:.2f}" for value in spent]
        cells = tuple(Cell(text, value=float(v)) for text, v in zip(texts, spent, strict=True))
        rows.append((run.name, cells, ""))
    return Table(tuple(Head(f"{stage}, s") for stage in stages), tuple(rows))
