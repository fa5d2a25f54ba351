"""The table of a study in HTML."""

from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = {
    "printable": "printable",
    "stiffness": "stiffness, N/mm",
    "stiffness_ratio_tension": "stiffness ratio",
    "first_failure_load": "first failure, N",
    "fibre_length": "fibre, mm",
    "print_time_nearest": "laying fibre, s",
    "efficiency": "efficiency",
}


def shown_table(frame: "pd.DataFrame") -> str:
    """HTML table of the columns that say most; why a run failed stands in place of its numbers."""
    labels = [
        name
        for name in frame.columns
        if name in ("part", "load_case", "slicing", "strategy") or "." in name
    ]
    labels = [name for name in labels if frame[name].nunique(dropna=False) > 1] or ["strategy"]
    columns = [name for name in _COLUMNS if name in frame]
    titles = [*(name.removeprefix("strategy.") for name in labels), *(_COLUMNS[c] for c in columns)]
    rows = ["".join(f"<th>{escape(title)}</th>" for title in titles)]
    for row in frame.to_dict("records"):
        cells = "".join(f"<td>{escape(_text(row[name]))}</td>" for name in labels)
        if row["failure"]:
            said = escape(f"failed: {row['failure']}")
            cells += f'<td class="failed" colspan="{max(len(columns), 1)}">{said}</td>'
        else:
            cells += "".join(f"<td>{escape(_text(row[name]))}</td>" for name in columns)
        rows.append(cells)
    return "<table>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>"


def _text(value: Any) -> str:
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
