"""Tables of a comparison as values, which screen, notebook and report draw, and its data frame."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.comparison.curve import Curve
from ccfem.comparison.headline import (
    HEADLINE,
    HEADLINE_OF_SLICINGS,
    TEST_COLUMNS,
    Headline,
    cell_text,
    headline_values,
)
from ccfem.comparison.ranking import best_values, stiffness_ratios
from ccfem.comparison.request import Wanted
from ccfem.comparison.runs import Run
from ccfem.judging.evaluation import COLUMNS
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad

if TYPE_CHECKING:
    import pandas as pd

_OWN = {
    "printable": "Whether the paths keep all limits of the machine, and why not.",
    "fibre_per_layer": "Length of fibre over the number of layers.",
    "paths_per_layer": "Paths over the number of layers.",
    "all_crossings": "Points at which fibre crosses other fibre, or itself.",
}
"""Meaning of columns that are no index of their own."""


FIRST_COLUMNS = (
    "printable",
    "stiffness_ratio_tension",
    "share_of_gain",
    "first_failure_load",
    "fibre_per_layer",
    "fibre_length",
    "print_time_nearest",
    "whole_print_time",
    "interlayer_load",
)
"""Columns that are shown first; the others follow behind a click, or with --details."""


FIRST_REMARKS = 3
"""Remarks that are shown first."""


@dataclass(frozen=True)
class Cell:
    """A cell: its text, smaller text below it, what it is sorted by, and whether it is the best."""

    text: str
    small: str = ""
    value: float | str = ""
    best: bool = False
    bad: bool = False

    def __str__(self) -> str:
        return f"{self.text} ({self.small})" if self.small else self.text


@dataclass(frozen=True)
class Head:
    """Head of a column, what it means, and whether it is shown only to who asks for more."""

    title: str
    about: str = ""
    more: bool = False


Row = tuple[str, tuple[Cell, ...], str]
"""Name, cells, and why there are none."""


@dataclass(frozen=True)
class Table:
    """A table of rows, each with a name; one without cells says why it has none."""

    heads: tuple[Head, ...]
    rows: tuple[Row, ...]

    @property
    def first(self) -> "Table":
        """The columns that are shown first."""
        shown = [k for k, head in enumerate(self.heads) if not head.more]
        rows = (
            (name, tuple(cells[k] for k in shown if cells), why) for name, cells, why in self.rows
        )
        return Table(tuple(self.heads[k] for k in shown), tuple(rows))

    def lines(self, corner: str) -> list[str]:
        """Lines of plain text, numbers to the right; `corner` stands above the names."""
        grid = [[corner, *(head.title for head in self.heads)]]
        grid += [[name, *map(str, cells)] for name, cells, _ in self.rows]
        count = len(self.heads) + 1
        widths = [max(len(row[k]) for row in grid if k < len(row)) for k in range(count)]
        lines = []
        for row, why in zip(grid, ["", *(why for *_, why in self.rows)], strict=True):
            cells = [text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=False)]
            lines.append("  ".join([row[0].ljust(widths[0]), *cells, why]).rstrip())
        return lines

    def html(self, corner: str) -> str:
        """HTML of the table for a notebook or a page."""
        titles = (corner, *(head.title for head in self.heads))
        rows = ["".join(f'<th scope="col">{escape(text)}</th>' for text in titles)]
        for name, cells, why in self.rows:
            texts = "".join(f"<td>{escape(str(cell))}</td>" for cell in cells)
            texts += f'<td colspan="{len(self.heads)}">{escape(why)}</td>' if why else ""
            rows.append(f'<th scope="row">{escape(name)}</th>{texts}')
        return f"<table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


def number(value: float) -> str:
    """Write a number in a table; a dash where there is none."""
    if not np.isfinite(value):
        return "–"
    if abs(value) < 1e-9:
        return "0"
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def _numbered(value: float) -> Cell:
    return Cell(number(value), value=float(value))


def headline_table(runs: Sequence[Run], wanted: Wanted, over_slicings: bool = False) -> Table:
    """Table of the indices that matter first; those that no run has are left out.

    Parameters
    ----------
    runs : sequence of Run
        From the best to the worst, failed ones included.
    wanted : float, mm, InAll or None
        Length of fibre per layer, or in total, that all were held to.
    over_slicings : bool, default False
        Whether the numbers of layers differ, so that nothing is shown per layer.
    """
    best = best_values(runs, wanted)
    values = {run.name: headline_values(run) for run in runs}
    known = {column for row in values.values() for column in row}
    heads = [h for h in (HEADLINE_OF_SLICINGS if over_slicings else HEADLINE) if h.column in known]
    rows: list[Row] = []
    for run in runs:
        cells = tuple(_headline_cell(run, head, values[run.name], best) for head in heads)
        if run.evaluation is None:
            rows.append((run.name, (), f"failed: {run.failure}"))
        else:
            rows.append((run.name, cells, ""))
    about = {column.name: f"{column.formula} {column.range}." for column in _columns()}
    hidden = {head.column for head in heads} - {*FIRST_COLUMNS}
    hidden |= set() if over_slicings else {"interlayer_load"}
    # The time of the whole print holds that of the fibre.
    hidden |= {"print_time_nearest"} if "whole_print_time" in known else set()
    return Table(
        tuple(
            Head(
                head.title, _OWN.get(head.column, about.get(head.column, "")), head.column in hidden
            )
            for head in heads
        ),
        tuple(rows),
    )


def _columns() -> tuple[Any, ...]:
    return (*TEST_COLUMNS, *COLUMNS)


def _headline_cell(
    run: Run, head: Headline, values: Mapping[str, float], best: Mapping[str, float]
) -> Cell:
    text, extra = cell_text(run, head)
    value = values.get(head.column, np.nan)
    if head.column == "printable":
        return Cell(text, value=value, bad=not run.printable)
    is_best = run.printable and value == best.get(head.column, np.nan)
    return Cell(text, extra, float(value), is_best)


def against_each_other(ranking: Sequence[Run]) -> Table | None:
    """Table of the stiffness of each run over that of each other; None for fewer than two."""
    runs = [run for run in ranking if run.tested is not None]
    if len(runs) < 2:
        return None
    rows = []
    for run in runs:
        cells = []
        for other in runs:
            tension, partial = stiffness_ratios(run, other)
            text = "–" if run is other else f"{tension:.2f} ({partial:.2f})"
            cells.append(Cell(text, value=float(tension)))
        rows.append((run.name, tuple(cells), ""))
    return Table(tuple(Head(f"over {run.name}") for run in runs), tuple(rows))


def load_cases_table(ranking: Sequence[Run]) -> Table | None:
    """Table of every load case; None where no run was tested in several."""
    tested = [(run.name, run.cases) for run in ranking if run.cases]
    if not tested:
        return None
    names = tested[0][1].names
    titles = [f"stiffness ratio (of its bound), {name}" for name in names]
    titles += ["worst of its bound", "above the bound of all", "first failure × load"]
    rows = []
    for name, test in tested:
        values = test.values()
        cells = []
        for case in names:
            share = values.get(f"share_of_bound[{case}]", np.nan)
            share_text = f" ({share:.0%})" if np.isfinite(share) else ""
            cells.append(f"{values[f'stiffness_ratio_tension[{case}]']:.2f}{share_text}")
        cells.append(_percent(values.get("worst_share_of_bound", np.nan), 0))
        cells.append(_percent(values.get("above_bound", np.nan), 1))
        failure = test.failure
        cells.append("–" if failure is None else f"{failure.factor:.2f} ({failure.case})")
        rows.append((name, tuple(map(Cell, cells)), ""))
    return Table(tuple(map(Head, titles)), tuple(rows))


_BREAKING = (
    Head("fails first", "What fails first, and at which load."),
    Head("highest load, N", "In brackets its band."),
    Head("at, mm", "Displacement at the highest load: work over load."),
    Head("cells cracked then"),
    Head("strand gone then, mm", "Broken, or loose from the matrix."),
    Head("first strand gives way at, N", "A dash where none does."),
    Head("left in the end, N", "What the part still carries at the end of its curve."),
)


def breaking_table(broken: Mapping[str, BreakingLoad]) -> Table:
    """Table of what broke first and how it went on."""
    rows = []
    for name, load in broken.items():
        curve, (low, high) = load.curve, load.band
        peak, torn = int(curve.force.argmax()), curve.broken_at[curve.broken_at >= 0]
        band = f"{number(low)} to {number(high)}" if high > low else ""
        cells = (
            Cell(f"{curve.first}, {number(curve.force[1])} N", value=float(curve.force[1])),
            Cell(number(load.load), band, load.load),
            _numbered(curve.displacement[peak]),
            _numbered(curve.cracks[peak]),
            _numbered(curve.broken[peak]),
            _numbered(curve.force[torn.min()] if len(torn) else np.nan),
            _numbered(curve.force[-1]),
        )
        rows.append((name, cells, ""))
    return Table(_BREAKING, tuple(rows))


def _percent(value: float, digits: int) -> str:
    return f"{value:.{digits}%}" if np.isfinite(value) else "–"


def all_indices(ranking: Sequence[Run]) -> Table:
    """Table of every index of every run."""
    runs = [run for run in ranking if run.evaluation is not None]
    values = [headline_values(run) for run in runs]
    rows = []
    for column in _columns():
        cells = tuple(_numbered(row.get(column.name, np.nan)) for row in values)
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
            ratios = ("stiffness_ratio_tension", "stiffness_ratio_partial")
            cells = (
                Cell(f"{wanted:.0f}", value=wanted),
                Cell(f"{run.length_per_layer:.0f}", value=run.length_per_layer),
                *(_numbered(values.get(column, np.nan)) for column in ratios),
                Cell(run.failure or run.why_not or "yes", bad=not run.printable),
            )
            rows.append((name, cells, ""))
    titles = ("wanted, mm a layer", "laid", "stiffness ratio", "at most", "printable")
    return Table(tuple(map(Head, titles)), tuple(rows))


def stage_seconds(runs: Sequence[Run]) -> Table:
    """Table of the seconds that each stage took for each run."""
    stages = list(dict.fromkeys(stage for run in runs for stage in run.seconds))
    rows: list[Row] = []
    for run in runs:
        spent: list[Any] = [run.seconds.get(stage, np.nan) for stage in stages]
        texts = ["–" if np.isnan(value) else f"{value:.2f}" for value in spent]
        cells = tuple(Cell(text, value=float(v)) for text, v in zip(texts, spent, strict=True))
        rows.append((run.name, cells, ""))
    return Table(tuple(Head(f"{stage}, s") for stage in stages), tuple(rows))


def frame(ranking: Sequence[Run]) -> "pd.DataFrame":
    """Table of all numbers of runs.

    It is a data frame, like that of an evaluation, to be sorted, joined and written.

    Parameters
    ----------
    ranking : sequence of Run
        From the best to the worst.

    Returns
    -------
    DataFrame
        Columns rank (1 is the best), strategy, printable, why_not, failure, fails_in (matrix, fibre
        or interlayer), empty_layers, and every index of the virtual test and of the evaluator; NaN
        where a run has none.
    """
    import pandas as pd

    values = [headline_values(run) for run in ranking]
    names = list(dict.fromkeys(name for row in values for name in row))
    columns = {
        "rank": np.arange(1, len(ranking) + 1),
        "strategy": [run.name for run in ranking],
        "printable": [run.printable for run in ranking],
        "why_not": [run.why_not for run in ranking],
        "failure": [run.failure for run in ranking],
        "fails_in": [run.fails_in for run in ranking],
        "empty_layers": [run.empty_layers for run in ranking],
    }
    numbers = {name: [row.get(name, np.nan) for row in values] for name in names}
    return pd.DataFrame(numbers | columns)[[*columns, *(n for n in names if n not in columns)]]
