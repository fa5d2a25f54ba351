"""Strands cut where they turn more tightly than a fibre can follow."""

from collections.abc import Sequence

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import is_closed, pack, resample, runs

__all__ = ["without_tight_turns"]

_PARTS = 2
"""Points a width at which the turn is looked at."""
_MARGIN = 0.97
"""Share of the largest curvature that is allowed: places between the points may be sharper."""


def without_tight_turns(
    lines: Sequence[FloatArray], radius: float, width: float, least_length: float
) -> list[FloatArray]:
    """Stretches of lines that keep a radius.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
    radius : float, mm
        Least radius, by the turn from the chord of one width before a point to that behind it.
    width : float, mm
        Of a strand.
    least_length : float, mm
        Shorter stretches are dropped.

    Returns
    -------
    list of (m, 2) arrays, mm
        A line that keeps the radius is as it was; others are in steps of half a width.
    """
    kept: list[FloatArray] = []
    for line in lines:
        points, _ = resample(*pack([line]), width / _PARTS)
        closed = is_closed(line)
        tight = _tight(points, closed, width, radius)
        if not tight.any():
            kept.append(line)
            continue
        if closed:
            start = int(np.argmax(tight[:-1]))
            points = np.concatenate([points[start:-1], points[: start + 1]])
            tight = np.concatenate([tight[start:-1], tight[: start + 1]])
        least = max(int(np.ceil(least_length * _PARTS / width)), 1)
        kept += [points[a:b] for a, b in runs(~tight) if b - a > least]
    return kept


def _tight(points: FloatArray, closed: bool, width: float, radius: float) -> BoolArray:
    """Mask (n,) of the points at which a line in half widths turns too tightly."""
    n, k = len(points), _PARTS
    if n <= 2 * k:
        return np.zeros(n, dtype=bool)
    if closed:
        ring = np.concatenate([points[-1 - k : -1], points, points[1 : k + 1]])
        before, here, after = ring[: -2 * k], points, ring[2 * k :]
    else:
        before, here, after = points[: -2 * k], points[k:-k], points[2 * k :]
    into, out = here - before, after - here
    turn = np.abs(
        np.arctan2(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0], (into * out).sum(axis=1))
    )
    tight = turn * radius > width / _MARGIN
    return tight if closed else np.concatenate([np.zeros(k, bool), tight, np.zeros(k, bool)])
