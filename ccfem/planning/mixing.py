"""A length between those of two plans: some layers of the one, the others of the other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.layers.layer import Layer
from ccfem.planning.cutting import cut_to_length
from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["Mixed", "layer_lengths", "mixed"]

_SPARE = 0.005
"""Share of the wanted length that may stay unused before strands are cut for it."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of the golden ratio spread any number of layers over the stack."""


@dataclass(frozen=True)
class Mixed:
    """Toolpaths of some layers of a plan that lays more, and of the others of one that lays less.

    Attributes
    ----------
    toolpaths : Toolpaths
    more : int
        Layers that take more.
    cut : int
        Layers on which strands are cut back.
    """

    toolpaths: Toolpaths
    more: int
    cut: int


def layer_lengths(toolpaths: Toolpaths, layers: Sequence[Layer]) -> FloatArray:
    """Length of fibre on each layer, (n,), mm."""
    index = [layer.index for layer in layers]
    fibre = toolpaths.of_kind(FIBRE)
    each = np.bincount(fibre.layer, fibre.lengths, minlength=max(index, default=0) + 1)
    return np.asarray(each[index], dtype=np.float64)


def mixed(
    less: Toolpaths, more: Toolpaths, layers: Sequence[Layer], total: float, minimum: float
) -> Mixed:
    """Mix two plans to a length, layers that take more spread evenly over the stack.

    Layers that the plan that lays less leaves empty take more in any case. Where whole layers
    leave room for more than half a per cent, one more layer takes strands that are cut to fit it;
    where the layers that would be empty take too much, strands are cut back on all.

    Parameters
    ----------
    less, more : Toolpaths
    layers : sequence of Layer
    total : float, mm
        Fibre of all layers together; the result lays no more, but for what minimum lengths on
        layers that would be empty ask for.
    minimum : float, mm
        Shortest strand that is made by a cut.
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
    """Cut the strands of every layer back in the same proportion, none to nothing."""
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
