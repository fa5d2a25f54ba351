"""Strands kept apart: parts closer than a strand's width to a longer strand are cut away."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray
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
    head = np.full(int(shape.prod()), -1)
    _lay(points, offsets, clearance, least_length, low, shape, head, keep)
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


@njit(cache=True, nogil=True)
def _lay(points, offsets, clearance, least_length, low, shape, head, keep):  # type: ignore[no-untyped-def]
    """Clear `keep` for points that are too near; `head` is the last point in each grid cell."""
    count = len(points)
    x0, y0, nx, ny = low[0], low[1], shape[0], shape[1]
    following = np.empty(count, np.int64)
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
            i, j = int((points[p, 0] - x0) / clearance), int((points[p, 1] - y0) / clearance)
            for cell in range(9):
                a, b = i + cell // 3 - 1, j + cell % 3 - 1
                if a < 0 or b < 0 or a >= nx or b >= ny:
                    continue
                q = head[a * ny + b]
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
                _add(points, keep, waiting, head, following, x0, y0, clearance, ny)
                waiting += 1
        # Stretches too short to print must not displace others.
        _drop_short(keep, along, first, last, least_length, closed)
        for q in range(waiting, last):
            _add(points, keep, q, head, following, x0, y0, clearance, ny)


@njit(cache=True, nogil=True)
def _add(points, keep, p, head, following, x0, y0, size, ny):  # type: ignore[no-untyped-def]
    if keep[p]:
        cell = int((points[p, 0] - x0) / size) * ny + int((points[p, 1] - y0) / size)
        following[p] = head[cell]
        head[cell] = p


@njit(cache=True, nogil=True)
def _drop_short(keep, along, first, last, least_length, closed):  # type: ignore[no-untyped-def]
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
