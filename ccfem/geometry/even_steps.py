"""Polylines in steps of about one length: fewer points on curves, more on straight lines."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.polylines import merge_repeated, subdivide

OFF = 0.005
"""Largest deviation of final paths from planned ones, in steps."""

_REPEATED = 1e-6
"""Distance, as a share of the step, below which a point equals the one before it."""


def even_steps(
    points: FloatArray, offsets: IntArray, fixed: BoolArray, step: float, tolerance: float
) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Polylines in steps no longer than a length, and shorter only where they bend.

    Points that lie within the tolerance of the chord between their neighbours are left out (Douglas
    and Peucker 1973), and steps that are too long are cut into equal parts. Corners and ends do not
    move, and no step has zero length.

    Parameters
    ----------
    points : (P, d) array, mm
        In two or three dimensions.
    offsets : (K + 1,) int array
        As in CSR; each polyline has at least one point.
    fixed : (P,) bool array
        Points that are always kept.
    step : float, mm
        Longest step, > 0.
    tolerance : float, mm
        Largest distance between a point left out and the new polyline.

    Returns
    -------
    points, offsets
        The new polylines; one of no length keeps one point.
    source : (P', 2) int array
        Indices of the given points between which each new point lies.
    share : (P',) array
        Of the way from the first to the second of them, in [0, 1).

    Notes
    -----
    D. H. Douglas, T. K. Peucker, Algorithms for the reduction of the number of points required to
    represent a digitized line or its caricature, Cartographica 10 (1973) 112.
    """
    merged, ends, first = merge_repeated(points, offsets, _REPEATED * step)
    last = np.append(first[1:], len(points)) - 1  # of the points that are one
    held = np.bitwise_or.reduceat(fixed, first) if len(first) else fixed
    # A polyline ends at its last point, whichever points near it are merged.
    long = np.diff(ends) > 1
    merged[ends[1:][long] - 1] = points[offsets[1:][long] - 1]
    keep, stack = held.copy(), np.empty((len(merged) + 1, 2), dtype=np.int64)
    _keep_needed(np.ascontiguousarray(merged), ends, tolerance, keep, stack)
    chosen, kept = merged[keep], np.concatenate([[0], np.cumsum(keep)])[ends]
    stepped, parts, segment = subdivide(chosen, kept, step)
    source = last[keep]
    following = np.minimum(segment + 1, len(source) - 1)
    size = np.linalg.norm(chosen[following] - chosen[segment], axis=1)
    way = np.linalg.norm(stepped - chosen[segment], axis=1)
    share = np.divide(way, size, out=np.zeros(len(way)), where=way > 0.0)
    return stepped, parts, np.stack([source[segment], source[following]], axis=1), share


@compiled
def _keep_needed(
    points: FloatArray, offsets: IntArray, tolerance: float, keep: BoolArray, stack: IntArray
) -> None:
    """Set `keep` (P,) for the points that Douglas and Peucker keep beside those set already."""
    for k in range(len(offsets) - 1):
        first, end = offsets[k], offsets[k + 1] - 1
        if end < first:
            continue
        keep[first] = keep[end] = True
        # Between two points that stay: keep the farthest from their chord, and look on both sides
        # of it.
        count, begin = 0, first
        for p in range(first + 1, end + 1):
            if keep[p]:
                stack[count, 0], stack[count, 1] = begin, p
                count, begin = count + 1, p
        while count > 0:
            count -= 1
            a, b = stack[count, 0], stack[count, 1]
            farthest, most = -1, tolerance * tolerance
            size = 0.0
            for i in range(points.shape[1]):
                size += (points[b, i] - points[a, i]) ** 2
            for p in range(a + 1, b):
                share = 0.0
                for i in range(points.shape[1]):
                    share += (points[p, i] - points[a, i]) * (points[b, i] - points[a, i])
                share = min(max(share / size, 0.0), 1.0) if size > 0.0 else 0.0
                off = 0.0
                for i in range(points.shape[1]):
                    chord = points[b, i] - points[a, i]
                    off += (points[p, i] - points[a, i] - share * chord) ** 2
                if off > most:
                    farthest, most = p, off
            if farthest >= 0:
                keep[farthest] = True
                stack[count, 0], stack[count, 1] = a, farthest
                stack[count + 1, 0], stack[count + 1, 1] = farthest, b
                count += 2
