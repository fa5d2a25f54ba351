"""Paths of several lengths from as few designs as possible."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Protocol, TypeVar

from ccfem.machine.machine import Machine
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.planning.whole_part import WholePart, full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.stream_design import DENSEST

_ENOUGH = 0.99
"""Share of a wanted length below which the design is repeated."""

_NEAR = 0.95
"""Share of the largest length above which shorter lengths are cut from its design."""

_MORE = 1.03
"""Factor on the length asked for in the repeated design, on top of the proportional increase."""


class _Strategy(Protocol):
    """A strategy that designs fields for a coverage, and for more fibre by its overfill."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    amount: ClassVar[Amount]

    @property
    def coverage(self) -> float: ...
    @property
    def overfill(self) -> float: ...


Designed = TypeVar("Designed", bound=_Strategy)


def designed_to_lengths(
    strategy: Designed,
    layers: Sequence[Layer],
    machine: Machine,
    lengths: Sequence[float],
    cut: Callable[[Designed, Sequence[float]], list[Toolpaths]],
    again: bool = True,
) -> list[tuple[Designed, LayerPlanner]]:
    """Design for the largest length, and again for much shorter ones.

    Parameters
    ----------
    strategy : StreamFunction
    layers : sequence of Layer
    machine : Machine
    lengths : sequence of float, mm per layer
        Lengths that need more than the largest coverage are reduced to that coverage.
    cut : callable
        Designs for the coverage of a strategy and cuts the paths to each of the lengths.
    again : bool, default True
        Whether to design for more fibre where the paths are too short, and to take the longer ones.

    Returns
    -------
    list of (StreamFunction, LayerPlanner)
        For each length the strategy with parameters that lay it, and the plan.
    """
    full = full_length(layers, machine)
    most = max(strategy.amount.most, strategy.coverage) * full
    lengths = [min(length, most) for length in lengths]
    longest = max(lengths)
    short = [k for k, length in enumerate(lengths) if length < _NEAR * longest]
    if short:
        anew = designed_to_lengths(
            strategy, layers, machine, [lengths[k] for k in short], cut, again
        )
        near = [length for length in lengths if length >= _NEAR * longest]
        rest = iter(designed_to_lengths(strategy, layers, machine, near, cut, again))
        of = dict(zip(short, anew, strict=True))
        return [of[k] if k in of else next(rest) for k in range(len(lengths))]
    told = replace(strategy, coverage=longest / full)
    found = cut(told, lengths)
    laid = max(float(paths.lengths.sum()) for paths in found) / len(layers)
    short_of = 0.0 < laid < _ENOUGH * longest
    if again and short_of and strategy.overfill * told.coverage < DENSEST:
        more = replace(told, overfill=min(_MORE * longest / laid, 2.0) * strategy.overfill)
        longer = cut(more, lengths)
        if max(float(paths.lengths.sum()) for paths in longer) > laid * len(layers):
            told, found = more, longer
    designed = told.overfill * told.coverage
    return [
        (_designed_for(told, length / full, designed), WholePart(paths))
        for length, paths in zip(lengths, found, strict=True)
    ]


def _designed_for(strategy: Designed, coverage: float, designed: float) -> Designed:
    """Strategy that lays a coverage from a design for `designed`, overfill included."""
    return replace(strategy, coverage=coverage, overfill=max(designed / coverage, 1.0))
