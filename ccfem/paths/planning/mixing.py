"""Plans mixed to a length in between: some layers from one, the others from the other."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.paths.planning.cutting import cut_to_length
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_SPARE = 0.005
"""Share of the wanted length that may stay unused before strands are cut to fill it."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of the golden ratio spread any number of layers over the stack."""


@dataclass(frozen=True)
class Mixed:
    """Toolpaths of which some layers come from the longer plan, the others from the shorter one.

    Attributes
    ----------
    toolpaths : Toolpaths
    more : int
        Number of layers from the longer plan.
    cut : int
        Number of layers on which strands are cut back.
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
    """Mix two plans to a length; layers from the longer plan are spread evenly over the stack.

    Layers that the shorter plan leaves empty are always taken from the longer one. Where whole
    layers leave more than half a per cent unused, one more layer takes strands that are cut to fit.
    Where the always-taken layers already exceed the length, strands are cut back on all layers.

    Parameters
    ----------
    less, more : Toolpaths
    layers : sequence of Layer
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
