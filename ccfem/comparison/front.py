"""Fronts: runs that no other run beats in one quantity without being worse in another."""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.errors import InputError


class Cost(NamedTuple):
    """What stiffness is drawn over: title of its axis, factor of its unit, which end is better."""

    title: str
    factor: float = 1.0
    better: str = "low"


FRONTS = {
    "fibre_length": Cost("fibre, mm"),
    "print_time_nearest": Cost("time to lay the fibre, min", 1.0 / 60.0),
    "first_failure_load": Cost("first failure, N", better="high"),
}
"""Indices that fronts of stiffness are drawn over."""


def cost_of(over: str) -> Cost:
    """Return what a front over an index needs; raise `InputError` for another index."""
    if over not in FRONTS:
        raise InputError(f"fronts are drawn over {', '.join(FRONTS)}; got {over!r}: choose one")
    return FRONTS[over]


def on_front(across: FloatArray, up: FloatArray, better: str = "low") -> BoolArray:
    """Mask of points that no other point dominates, as good in both values and better in one.

    Parameters
    ----------
    across, up : (n,) arrays
        The second values are better when high. Points with NaN are on no front.
    better : {"low", "high"}
        Which first values are better.

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
