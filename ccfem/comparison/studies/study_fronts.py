"""Fronts: runs of which none is better in one thing without being worse in another."""

from typing import TYPE_CHECKING

from ccfem.comparison.front import on_front

if TYPE_CHECKING:
    import pandas as pd

GAIN = "stiffness"
COST = {"fibre_length": "low", "print_time_nearest": "low", "first_failure_load": "high"}
"""What stiffness is drawn over, and which end of it is better."""


def with_fronts(table: "pd.DataFrame") -> "pd.DataFrame":
    """Table with a column for each front: whether a run is on it.

    Fronts are those of the printable runs of one part under one load case.
    """
    marked = table.copy()
    for cost, better in COST.items():
        name = f"front_{cost}"
        marked[name] = False
        if GAIN not in marked or cost not in marked:
            continue
        printable = marked[marked["printable"].astype(bool)]
        for _, group in printable.groupby(["part", "load_case", *_geometry(marked)], dropna=False):
            chosen = on_front(group[cost].to_numpy(), group[GAIN].to_numpy(), better)
            marked.loc[group.index[chosen], name] = True
    return marked


def _geometry(table: "pd.DataFrame") -> list[str]:
    """Columns that tell parts of one name apart."""
    return [name for name in table.columns if name.startswith("part.")]
