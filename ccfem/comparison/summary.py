"""A comparison in a few lines: one row a strategy, for `print` and for notebooks."""

from collections.abc import Sequence
from html import escape

from ccfem.comparison.headline import Headline, cell_text, headline_values
from ccfem.comparison.runs import Run

SUMMARY = (
    Headline("printable", "printable", "", "{}"),
    Headline("stiffness", "stiffness, N/mm", "high", "{:.4g}"),
    Headline("stiffness_ratio_tension", "times unreinforced", "high", "{:.2f}"),
    Headline("first_failure_load", "first failure, N", "high", "{:.0f}"),
    Headline("fibre_per_layer", "fibre, mm a layer", "", "{:.0f}"),
    Headline("efficiency", "efficiency", "high", "{:.3f}"),
)
"""Columns of the summary; those that no run has are left out."""

SUMMARY_OF_SLICINGS = (
    *SUMMARY[:4],
    Headline("interlayer_load", "delamination load, N", "high", "{:.0f}"),
    Headline("fibre_length", "fibre, mm", "", "{:.0f}"),
    Headline("joints_linked", "joints linked", "high", "{:.2f}"),
)
"""The columns of the summary over several slicings."""


def summary_text(
    ranking: Sequence[Run], verdict: str = "", columns: Sequence[Headline] = SUMMARY
) -> str:
    """Summary as plain text.

    Parameters
    ----------
    ranking : sequence of Run
        From the best to the worst.
    verdict : str
        A sentence to end with.
    columns : sequence of Headline
    """
    rows = _rows(ranking, columns)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row, run in zip(rows, [None, *ranking], strict=True):
        cells = [row[0].ljust(widths[0])]
        if run is not None and run.failure:
            cells.append(f"failed: {run.failure}")
        else:
            cells += [text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join([*lines, verdict] if verdict else lines)


def summary_html(
    ranking: Sequence[Run], verdict: str = "", columns: Sequence[Headline] = SUMMARY
) -> str:
    """Summary as an HTML table; parameters as of `summary_text`."""
    head, *body = _rows(ranking, columns)
    rows = ["".join(f"<th>{escape(text)}</th>" for text in head)]
    for row, run in zip(body, ranking, strict=True):
        cells = [f"<td>{escape(text)}</td>" for text in row]
        if run.failure:
            said = escape(f"failed: {run.failure}")
            cells[1:] = [f'<td colspan="{len(row) - 1}">{said}</td>']
        rows.append("".join(cells))
    table = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table>{table}</table>" + (f"<p>{escape(verdict)}</p>" if verdict else "")


def _rows(ranking: Sequence[Run], columns: Sequence[Headline]) -> list[list[str]]:
    """Titles, and the cells of each run."""
    found = [headline_values(run) for run in ranking]
    heads = [head for head in columns if any(head.column in values for values in found)]
    rows = [["strategy", *(head.title for head in heads)]]
    for run in ranking:
        cells = [cell_text(run, head) for head in heads]
        # Additions in smaller letters: where the part fails. The rest is in the report.
        rows.append(
            [run.name, *(f"{text} {more}" if more.isalpha() else text for text, more in cells)]
        )
    return rows
