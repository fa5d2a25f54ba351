"""Plans mixed to a length in between: some layers from one, the others from the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_SPARE = 0.005
"""Share of the wanted length that may stay unused before strands are cut to fill it."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of the golden ratio spread any number of layers over the stack."""


@dataclass(frozen=True)
class Mixed:
    """Toolpaths of which some layers come from the longer plan, the others from the shorter one.

    The numbers of layers from the longer plan, and of those on which strands are cut back.
    """

    toolpaths: Toolpaths
    more: int
    cut: int


def layer_lengths(toolpaths: Toolpaths, layers: Sequence[Layer]) -> FloatArray:
    """Length of fibre on each layer, (n,), mm."""
    index = [layer.index for layer in layers]
    fibre = toolpaths.of_kind(FIBRE)
    by_index = np.bincount(fibre.layer, fibre.lengths, minlength=max(index, default=0) + 1)
    return np.asarray(by_index[index], dtype=np.float64)


def mixed(
    less: Toolpaths, more: Toolpaths, layers: Sequence[Layer], total: float, minimum: float
) -> Mixed:
    """Mix two plans to a length; layers from the longer plan are spread evenly over the stack.

    Layers that the shorter plan leaves empty are always taken from the longer one. Where whole
    layers leave more than half a per cent unused, one more layer takes strands that are cut to fit.
    Where the always-taken layers already exceed the length, strands are cut back on all layers.

    Parameters
    ----------
    total : float, mm
        Fibre of all layers together. The result lays no more, unless the minimum lengths on layers
        that would be empty require it.
    minimum : float, mm
        Shortest strand that a cut may leave.
    """
    a, b = layer_lengths(less, layers), layer_lengths(more, layers)
    taken = (a == 0.0) & (b > 0.0)
    room = total - float(np.where(taken, b, a).sum())
    if room < 0.0:
        return _cut_evenly(less, more, layers, taken, total, minimum)
    for k in np.argsort((np.arange(len(layers)) * _GOLDEN) % 1.0, kind="stable"):
        gain = b[k] - a[k]
        if not taken[k] and 0.0 < gain <= room:
            taken[k], room = True, room - gain
    parts = _parts(less, more, layers, taken)
    gain = np.where(taken, 0.0, b - a)
    cut = 0
    for k in np.argsort(gain, kind="stable"):
        if gain[k] <= 0.0 or room <= _SPARE * total:
            continue
        shorter = cut_to_length(more.on_layer(layers[k].index), a[k] + room, minimum)
        won = float(shorter.of_kind(FIBRE).lengths.sum()) - a[k]
        if won > 0.0:
            parts[k], taken[k], room, cut = shorter, True, room - won, cut + 1
    return Mixed(Toolpaths.concatenate(parts), int(taken.sum()), cut)


def _parts(
    less: Toolpaths, more: Toolpaths, layers: Sequence[Layer], taken: Sequence[bool]
) -> list[Toolpaths]:
    return [
        (more if chosen else less).on_layer(layer.index)
        for layer, chosen in zip(layers, taken, strict=True)
    ]


def _cut_evenly(
    less: Toolpaths,
    more: Toolpaths,
    layers: Sequence[Layer],
    taken: Sequence[bool],
    total: float,
    minimum: float,
) -> Mixed:
    """Cut the strands of every layer back in the same proportion, but none completely."""
    parts = _parts(less, more, layers, taken)
    lengths = np.array([float(part.of_kind(FIBRE).lengths.sum()) for part in parts])
    share, carried, cut = total / float(lengths.sum()), 0.0, 0
    for k, part in enumerate(parts):
        wanted = max(share * lengths[k] + carried, min(lengths[k], minimum))
        parts[k] = cut_to_length(part, wanted, minimum)
        left = float(parts[k].of_kind(FIBRE).lengths.sum())
        carried += share * lengths[k] - left
        cut += left < lengths[k]
    return Mixed(Toolpaths.concatenate(parts), int(np.sum(taken)), cut)


# Paths cut back to a wanted length so that all remaining pieces can be printed.


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
        # A path does not end on a link: back to where it begins. Else at the exact length.
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
