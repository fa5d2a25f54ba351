"""Fronts: runs of which none is better in one thing without being worse in another."""

from typing import TYPE_CHECKING

import numpy as np

from ccfem.arrays import BoolArray, FloatArray

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["COST", "GAIN", "on_front", "with_fronts"]

GAIN = "stiffness"
COST = {"fibre_length": "low", "print_time_nearest": "low", "first_failure_load": "high"}
"""What stiffness is drawn over, and which end of it is better."""


def on_front(across: FloatArray, up: FloatArray, better: str = "low") -> BoolArray:
    """Points that no other one dominates: none is as good in both and better in one.

    Parameters
    ----------
    across, up : (n,) arrays
        The second is better where it is high. Points with NaN are on no front.
    better : {"low", "high"}
        Which end of the first is better.

    Examples
    --------
    >>> on_front(np.array([1.0, 2.0, 3.0, 2.0]), np.array([1.0, 3.0, 2.0, 2.0])).tolist()
    [True, True, False, False]
    """
    cost = np.asarray(across, dtype=float) * (1.0 if better == "low" else -1.0)
    gain = np.asarray(up, dtype=float)
    known = np.isfinite(cost) & np.isfinite(gain)
    as_good = (cost[:, None] <= cost) & (gain[:, None] >= gain)
    better_in_one = (cost[:, None] < cost) | (gain[:, None] > gain)
    dominated = (as_good & better_in_one & known[:, None]).any(axis=0)
    return known & ~dominated


def with_fronts(table: "pd.DataFrame") -> "pd.DataFrame":
    """Table with a column for each front: whether a run is on it.

    Fronts are those of the printable runs of one part under one load case.
    """
    found = table.copy()
    for cost, better in COST.items():
        name = f"front_{cost}"
        found[name] = False
        if GAIN not in found or cost not in found:
            continue
        printable = found[found["printable"].astype(bool)]
        for _, group in printable.groupby(["part", "load_case", *_geometry(found)], dropna=False):
            chosen = on_front(group[cost].to_numpy(), group[GAIN].to_numpy(), better)
            found.loc[group.index[chosen], name] = True
    return found


def _geometry(table: "pd.DataFrame") -> list[str]:
    """Columns that tell parts of one name apart."""
    return [name for name in table.columns if name.startswith("part.")]
