"""Paths cut back at their ends to a wanted length."""

from dataclasses import replace

import numpy as np

from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["cut_to_length"]

_ENOUGH = 1e-9
"""Length, mm, below which nothing more is cut."""


def cut_to_length(toolpaths: Toolpaths, length: float, minimum: float) -> Toolpaths:
    """Cut fibre back at the ends of the longest paths, until no more than a length is left.

    Parameters
    ----------
    toolpaths : Toolpaths
    length : float, mm
        Largest total length of fibre that remains.
    minimum : float, mm
        No path becomes shorter than that; the shortest go where all cannot stay.

    Returns
    -------
    Toolpaths
        The given ones where they are short enough. A closed path that is cut is open.
    """
    size = np.where(toolpaths.kind == FIBRE, toolpaths.lengths, 0.0)
    order = np.argsort(-size, kind="stable")
    # As many of the longest as can be cut to fit.
    fits = np.cumsum(np.minimum(size[order], minimum)) <= length + _ENOUGH
    target = np.where(np.isin(np.arange(len(size)), order[fits]), size, 0.0)
    excess = float(target.sum()) - length
    for k in order[fits & (size[order] > minimum)]:
        if excess <= _ENOUGH:
            break
        cut = min(excess, size[k] - minimum)
        target[k] -= cut
        excess -= cut
    changed = np.flatnonzero(target < size - _ENOUGH)
    return _shortened(toolpaths, {int(k): float(target[k]) for k in changed})


def _shortened(toolpaths: Toolpaths, wanted: dict[int, float]) -> Toolpaths:
    """Toolpaths of which some, by number, keep so much of their beginning; 0 for none."""
    if not wanted:
        return toolpaths
    points, keep = toolpaths.points.copy(), np.ones(len(toolpaths.points), dtype=bool)
    link = toolpaths.link.copy()
    stays, closed = np.ones(len(toolpaths), dtype=bool), toolpaths.closed.copy()
    sizes = np.diff(toolpaths.offsets)
    for k, length in wanted.items():
        first, end = toolpaths.offsets[k], toolpaths.offsets[k + 1]
        if length <= 0.0:
            keep[first:end], stays[k] = False, False
            continue
        line = toolpaths.points[first:end]
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
        last = max(int(np.searchsorted(along, length)), 1)
        share = (length - along[last - 1]) / max(along[last] - along[last - 1], 1e-300)
        points[first + last] = line[last - 1] + share * (line[last] - line[last - 1])
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
