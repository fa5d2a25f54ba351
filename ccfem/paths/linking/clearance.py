"""Strands kept apart: parts closer than a strand's width to a longer strand are cut away."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import is_closed, line_length, pack, runs


def trim_to_clearance(
    lines: Sequence[FloatArray], clearance: float, least_length: float, first: int = 0
) -> list[FloatArray]:
    """Cut strands so that no two are closer than a clearance, the longest first.

    Each strand keeps only the stretches at the clearance from strands laid before, and from earlier
    parts of itself. Stretches shorter than `least_length` are dropped.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        Their steps should not be much longer than half the clearance.
    clearance : float, mm
    least_length : float, mm
    first : int, default 0
        Number of strands at the start of `lines` that are laid before all others.

    Returns
    -------
    list of (n, 2) arrays
        From the longest strand to the shortest; an untouched closed strand stays closed.
    """
    if not lines:
        return []
    length = np.array([line_length(line) for line in lines])
    order = np.lexsort((-length, np.arange(len(lines)) >= first))
    ordered = [lines[k] for k in order]
    points, offsets = pack(ordered)
    low = points.min(axis=0)
    shape = ((points.max(axis=0) - low) / clearance).astype(np.int64) + 1
    keep = np.ones(len(points), dtype=bool)
    head, following = np.full(int(shape.prod()), -1), np.empty(len(points), dtype=np.int64)
    grid = _Grid(low, shape, float(clearance), head, following)
    _drop_near(points, offsets, grid, float(least_length), keep)
    masks = np.split(keep, offsets[1:-1])
    kept: list[FloatArray] = []
    for line, mask in zip(ordered, masks, strict=True):
        if mask.all():
            kept.append(line)
            continue
        pieces = [line[a:b] for a, b in runs(mask) if b - a > 1]
        if is_closed(line) and len(pieces) > 1 and mask[0] and mask[-1]:
            pieces = [np.concatenate([pieces[-1], pieces[0][1:]]), *pieces[1:-1]]
        kept += pieces
    return [line for line in kept if line_length(line) >= least_length]


class _Grid(NamedTuple):
    """Points in cells as wide as the clearance, `low` (2,) the corner of the first, mm.

    `shape` (2,) cells along each axis; `head` (c,) the last point in each cell, -1 for none, and
    `following` (p,) the one before each point in its cell.
    """

    low: FloatArray
    shape: IntArray
    clearance: float
    head: IntArray
    following: IntArray


@njit(cache=True, nogil=True)
def _drop_near(
    points: FloatArray, offsets: IntArray, grid: _Grid, least_length: float, keep: BoolArray
) -> None:
    """Clear `keep` (p,) for points that are too near to others."""
    low, shape, clearance, head, following = grid
    count = len(points)
    along = np.zeros(count)
    line = np.zeros(count, np.int64)
    for k in range(len(offsets) - 1):
        first, last = offsets[k], offsets[k + 1]
        for p in range(first, last):
            line[p] = k
            if p > first:
                dx, dy = points[p, 0] - points[p - 1, 0], points[p, 1] - points[p - 1, 1]
                along[p] = along[p - 1] + np.sqrt(dx * dx + dy * dy)
        closed = points[first, 0] == points[last - 1, 0] and points[first, 1] == points[last - 1, 1]
        whole = along[last - 1]
        # Points enter the grid only once the line has moved on by two clearances: otherwise a line
        # would be too near to itself.
        waiting = first
        for p in range(first, last):
            i, j = (
                int((points[p, 0] - low[0]) / clearance),
                int((points[p, 1] - low[1]) / clearance),
            )
            for cell in range(9):
                a, b = i + cell // 3 - 1, j + cell % 3 - 1
                if a < 0 or b < 0 or a >= shape[0] or b >= shape[1]:
                    continue
                q = head[a * shape[1] + b]
                while q >= 0 and keep[p]:
                    apart = along[p] - along[q]
                    if closed:
                        apart = min(apart, whole - apart)
                    same = line[q] == k
                    if not (same and apart < 3.0 * clearance):
                        dx, dy = points[p, 0] - points[q, 0], points[p, 1] - points[q, 1]
                        if dx * dx + dy * dy < clearance * clearance:
                            keep[p] = False
                    q = following[q]
            while waiting < p and along[waiting] < along[p] - 2.0 * clearance:
                _enter(points, keep, waiting, grid)
                waiting += 1
        # Stretches too short to print must not displace others.
        _drop_short(keep, along, first, last, least_length, closed)
        for q in range(waiting, last):
            _enter(points, keep, q, grid)


@njit(cache=True, nogil=True)
def _enter(points: FloatArray, keep: BoolArray, p: int, grid: _Grid) -> None:
    """Put a point into its cell if it is kept."""
    if keep[p]:
        size = grid.clearance
        i, j = int((points[p, 0] - grid.low[0]) / size), int((points[p, 1] - grid.low[1]) / size)
        cell = i * grid.shape[1] + j
        grid.following[p] = grid.head[cell]
        grid.head[cell] = p


@njit(cache=True, nogil=True)
def _drop_short(
    keep: BoolArray, along: FloatArray, first: int, last: int, least_length: float, closed: bool
) -> None:
    """Drop stretches of a line shorter than a length; round a closed one they may go on."""
    start = -1
    for p in range(first, last + 1):
        if p < last and keep[p]:
            if start < 0:
                start = p
        elif start >= 0:
            joins_round = closed and (start == first or p == last)
            if along[p - 1] - along[start] < least_length and not joins_round:
                for q in range(start, p):
                    keep[q] = False
            start = -1
