"""Paths cut back to a wanted length so that all remaining pieces can be printed."""

from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.paths.toolpaths import FIBRE, Toolpaths

_ENOUGH = 1e-9
"""Length, mm, below which nothing more is cut."""
_SAME = 1e-6
"""Distance along a path, mm, within which a cut is moved to a point of the path."""


def cut_to_length(toolpaths: Toolpaths, length: float, minimum: float) -> Toolpaths:
    """Leave out and shorten fibre until no more than a length is left.

    The shortest paths are left out as a whole. The remaining excess is cut from the end of the
    shortest path that stays long enough, or from the ends of several. No path ends in a link.

    Parameters
    ----------
    toolpaths : Toolpaths
    length : float, mm
        Largest total length of fibre that remains.
    minimum : float, mm
        Least length that a path is cut to.

    Returns
    -------
    Toolpaths
        The given paths where they are short enough. A closed path becomes open when cut. The total
        is less than the length where paths of at least the minimum cannot add up to it.
    """
    size = np.where(toolpaths.kind == FIBRE, toolpaths.lengths, 0.0)
    left = _lengths(size, length, minimum)
    changed = np.flatnonzero(left < size - _ENOUGH)
    return _shortened(toolpaths, {int(k): float(left[k]) for k in changed}, minimum)


def _lengths(size: FloatArray, length: float, minimum: float) -> FloatArray:
    """Remaining lengths of paths of the given sizes."""
    left, excess = size.copy(), float(size.sum()) - length
    for k in np.argsort(np.where(size > 0.0, size, np.inf), kind="stable"):
        if excess <= _ENOUGH:
            break
        spare = np.where(left > 0.0, np.maximum(left - minimum, 0.0), 0.0)
        if left[k] > excess and spare.sum() >= excess - _ENOUGH:
            alone = np.flatnonzero(spare >= excess - _ENOUGH)
            if len(alone):
                left[alone[np.argmin(left[alone])]] -= excess
            else:
                left -= spare * (excess / spare.sum())
            break
        excess -= left[k]
        left[k] = 0.0
    return left


def _shortened(toolpaths: Toolpaths, wanted: dict[int, float], minimum: float) -> Toolpaths:
    """Toolpaths, some of them cut to a wanted initial length, by path number; 0 removes a path."""
    if not wanted:
        return toolpaths
    points, keep = toolpaths.points.copy(), np.ones(len(toolpaths.points), dtype=bool)
    link, closed = toolpaths.link.copy(), toolpaths.closed.copy()
    stays, sizes = np.ones(len(toolpaths), dtype=bool), np.diff(toolpaths.offsets)
    for k, length in wanted.items():
        first, end = toolpaths.offsets[k], toolpaths.offsets[k + 1]
        line = toolpaths.points[first:end]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        last = max(int(np.searchsorted(along, length - _SAME)), 1)
        share = min((length - along[last - 1]) / (along[last] - along[last - 1]), 1.0)
        if toolpaths.link[first + last - 1]:
            while last > 0 and toolpaths.link[first + last - 1]:
                last -= 1
            length = along[last]
        else:
            points[first + last] = line[last - 1] + share * (line[last] - line[last - 1])
        if length <= _SAME or length < minimum - _SAME:
            keep[first:end], stays[k] = False, False
            continue
        keep[first + last + 1 : end], link[first + last], closed[k] = False, False, False
        sizes[k] = last + 1
    return replace(
        toolpaths,
        points=points[keep],
        normals=toolpaths.normals[keep],
        offsets=np.concatenate([[0], np.cumsum(sizes[stays])]).astype(np.int64),
        layer=toolpaths.layer[stays],
        kind=toolpaths.kind[stays],
        closed=closed[stays],
        link=link[keep],
    )
