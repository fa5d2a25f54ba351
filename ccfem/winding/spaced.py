"""Strands that end where the field converges, and others that start where it spreads.

Level lines at one step apart lie nearer than wanted where the field is steep. As those of half the
step lie half as far apart, lines that are kept where their own distance fits, coarse ones first,
stay within a factor of sqrt(2) of what is wanted: the stripes of F. Knoeppel, K. Crane, U. Pinkall,
P. Schroeder, Stripe patterns on surfaces, ACM Transactions on Graphics 34 (2015) 39, end and start
likewise. Here the distance is measured, so that the lower bound holds whatever the field.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import is_closed, line_length, runs

__all__ = ["CLOSEST", "kept_apart", "octaves"]

CLOSEST = 0.7
"""Least distance of strands, in the spacing asked for. Where it would be 1.4 another one starts."""
_OWN = 6.0
"""A strand is its own neighbour from so many least distances of arc on."""


def octaves(level: IntArray) -> IntArray:
    """Order of levels, whole numbers from 0 on, in which every second of those left comes last.

    Returns
    -------
    (n,) int array
        Of the rows of `level`: the highest level first, then by halves.
    """
    from_top = int(level.max(initial=0)) - level
    halves = np.where(from_top > 0, from_top & -from_top, np.iinfo(np.int64).max)
    return np.lexsort((level, -halves))


def kept_apart(
    lines: Sequence[FloatArray], clearance: float, border: cKDTree | None, least: float
) -> list[FloatArray]:
    """Cut lines where they are nearer than a clearance to those before them, or to themselves.

    Parameters
    ----------
    lines : sequence of (n_i, 3) arrays, mm
        The first ones stay whole the longest; closed ones repeat their first point. Their steps
        should not be longer than half the clearance.
    clearance : float, mm
    border : cKDTree, optional
        Of points that lines keep half the clearance from.
    least : float, mm
        Shorter stretches are dropped, and hold no others off.

    Returns
    -------
    list of (n, 3) arrays
        An untouched closed line stays closed.
    """
    kept: list[FloatArray] = []
    for line in lines:
        free = _free(line, kept, clearance)
        if border is not None:
            free &= border.query(line)[0] >= 0.5 * clearance
        kept += [part for part in _stretches(line, free) if line_length(part) >= least]
    return kept


def _free(line: FloatArray, kept: Sequence[FloatArray], clearance: float) -> BoolArray:
    """Which points of a line keep the clearance, those of itself that come before them included."""
    step = float(np.linalg.norm(np.diff(line, axis=0), axis=1).max())
    reach = float(np.hypot(clearance, 0.5 * step))
    free = np.ones(len(line), dtype=bool)
    if kept:
        free = cKDTree(np.concatenate(kept)).query(line, distance_upper_bound=reach)[0] >= reach
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    pairs = cKDTree(line).query_pairs(clearance, output_type="ndarray")
    apart = along[pairs[:, 1]] - along[pairs[:, 0]]
    if is_closed(line):
        apart = np.minimum(apart, along[-1] - apart)
    near = pairs[apart > _OWN * clearance]
    # What is cut off itself holds nothing off.
    near = near[free[near].all(axis=1)]
    free[near.max(axis=1)] = False
    return np.asarray(free)


def _stretches(line: FloatArray, free: BoolArray) -> list[FloatArray]:
    """Stretches of a line whose points are free."""
    if free.all():
        return [line]
    parts = [line[a:b] for a, b in runs(free) if b - a > 1]
    if is_closed(line) and len(parts) > 1 and free[0] and free[-1]:
        parts = [np.concatenate([parts[-1], parts[0][1:]]), *parts[1:-1]]
    return parts
