"""Strands that end where the field converges, and others that start where it spreads.

Level lines a step apart lie nearer than wanted where the field is steep, and further where it is
flat. Of these lines the longest stretches are laid that keep a least distance, then stretches of
levels between them where there is room. The least distance is measured, so that it holds whatever
the field; the largest one holds where a stretch that fits is long enough to be cut by the machine.
Stripes that end and start likewise: F. Knoeppel, K. Crane, U. Pinkall, P. Schroeder, Stripe
patterns on surfaces, ACM Transactions on Graphics 34 (2015) 39.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import is_closed, line_length, runs

CLOSEST = 0.7
"""Least distance of strands, in the spacing asked for. Where it would be 1.4 another one starts."""
_OWN = 6.0
"""A strand is its own neighbour from so many least distances of arc on."""


def kept_apart(
    lines: Sequence[FloatArray],
    clearance: float,
    least: float,
    placed: Sequence[FloatArray] = (),
    border: cKDTree | None = None,
) -> list[FloatArray]:
    """Choose the longest stretches of lines, one after the other, that keep a clearance.

    Parameters
    ----------
    lines : sequence of (n_i, 3) arrays, mm
        Closed ones repeat their first point. Their steps should not be longer than half the
        clearance.
    clearance : float, mm
    least : float, mm
        Shorter stretches are not laid.
    placed : sequence of (n_i, 3) arrays, mm
        Lines that are there already.
    border : cKDTree, optional
        Of points that lines keep half the clearance from.

    Returns
    -------
    list of (n, 3) arrays
        A closed line that nothing is cut from stays closed.
    """
    free = [_free(line, placed, clearance, border) for line in lines]
    best = [_longest(line, mask) for line, mask in zip(lines, free, strict=True)]
    kept: list[FloatArray] = []
    while best:
        k = int(np.argmax([length for length, _ in best]))
        length, rows = best[k]
        if length < least or len(rows) < 2:
            break
        new = lines[k][rows]
        kept.append(new)
        tree, reach = cKDTree(new), _reach(new, clearance)
        for other, (line, mask) in enumerate(zip(lines, free, strict=True)):
            if mask.any():
                near = tree.query(line[mask], distance_upper_bound=reach)[0] < reach
                mask[np.flatnonzero(mask)[near]] = False
            if not mask[best[other][1]].all():
                best[other] = _longest(line, mask)
    return kept


def _reach(line: FloatArray, clearance: float) -> float:
    """Distance from the points of a line that is surely a clearance from the line between them."""
    step = float(np.linalg.norm(np.diff(line, axis=0), axis=1).max())
    return float(np.hypot(clearance, 0.5 * step))


def _free(
    line: FloatArray, placed: Sequence[FloatArray], clearance: float, border: cKDTree | None
) -> BoolArray:
    """Which points of a line keep the clearance, those of itself that come before them included."""
    free = np.ones(len(line), dtype=bool)
    if border is not None:
        free = border.query(line)[0] >= 0.5 * clearance
    if len(placed):
        every = np.concatenate(placed)
        reach = max(_reach(strand, clearance) for strand in placed)
        free &= cKDTree(every).query(line, distance_upper_bound=reach)[0] >= reach
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    pairs = cKDTree(line).query_pairs(clearance, output_type="ndarray")
    apart = np.abs(along[pairs[:, 1]] - along[pairs[:, 0]])
    if is_closed(line):
        apart = np.minimum(apart, along[-1] - apart)
    near = pairs[apart > _OWN * clearance]
    # What is cut off itself holds nothing off.
    near = near[free[near].all(axis=1)]
    free[near.max(axis=1)] = False
    return np.asarray(free)


def _longest(line: FloatArray, free: BoolArray) -> tuple[float, IntArray]:
    """Length of the longest stretch of a line whose points are free, and its rows."""
    rows = [np.arange(a, b) for a, b in runs(free)]
    if is_closed(line) and len(rows) > 1 and free[0] and free[-1]:
        rows = [np.concatenate([rows[-1], rows[0][1:]]), *rows[1:-1]]
    lengths = [line_length(line[run]) if len(run) > 1 else 0.0 for run in rows]
    if not lengths:
        return 0.0, np.zeros(0, dtype=np.int64)
    k = int(np.argmax(lengths))
    return lengths[k], rows[k]
