"""Paths cut to a length in several ways; a test chooses the best, and its strands are moved.

The worth of fibre for the load at first failure is known for small changes only, and a cut is a
large one. Where strength counts, fibre is therefore cut three ways: for the stiffness alone, for
the strength as asked for, and for half of that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.parallel import in_processes
from ccfem.judging.virtual_testing import Specimen, Strand
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import TOLERANCE
from ccfem.paths.planning.layer_plans import plan_layers
from ccfem.paths.planning.strategy import WholePart
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.exchange import exchanged
from ccfem.strategies.fibre_aware.judges import (
    Goal,
    Judge,
    Judged,
    stiffest,
    stiffness_judge,
    strength_judge,
)
from ccfem.strategies.fibre_aware.prune import fibre_length, prune
from ccfem.strategies.fibre_aware.strand_moves import kept_radius, moved

_SHARES = (0.0, 0.5, 1.0)
"""Shares of the `strength` asked for with which fibre is cut."""

_ALL_WAYS = 2
"""Number of candidates cut in all these ways; others are cut for the stiffness alone."""

_FOR_BOTH = (False, True)
"""Whether moves follow the strength too: tried once for the stiffness alone, and once for both."""

_MUCH = 1.12
"""Fibre of a plan over the length wanted from which the last of its cuts is a large step."""

_ROUGH, _EXACT = 1e-4, 1e-6
"""Relative residuals of the tests, and of the last one of moved paths, which gain little."""


class _Cut(Protocol):
    """Cuts toolpaths to a length, unless others are stiffer than any cut of them."""

    def __call__(
        self, toolpaths: Toolpaths, share: float, tests: int, least: Judged | None = None
    ) -> Toolpaths:
        """Cut, given the weight of the strength, the number of tests and the others."""


class _Exchange(Protocol):
    """Exchanges stretches of a plan for others."""

    def __call__(self, kept: Toolpaths, source: Toolpaths, near: Sequence[FloatArray]) -> Toolpaths:
        """Make a plan better, given what it was cut from and its displacements."""


@dataclass(frozen=True)
class Cutting:
    """How fibre is cut to a length and moved.

    Attributes
    ----------
    rounds : int
        Tests of each cut, as of `ccfem.strategies.fibre_aware.prune.prune`.
    strength : float in [0, 1]
        Weight of the load at first failure.
    moves : int
        Steps of `ccfem.strategies.fibre_aware.strand_moves.moved`.
    tight : float in [0, 1]
        Largest share of the fibre's length in bends tighter than the machine's radius.
    fold : bool
        Whether strands may fold.
    """

    rounds: int
    strength: float = 0.0
    moves: int = 0
    tight: float = 1.0
    fold: bool = False


def prune_and_move(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    part: Specimen | Goal,
    length: float,
    machine: Machine,
    strand: Strand,
    how: Cutting,
    last: Goal | None = None,
) -> Toolpaths:
    """Cut fibre to a length, mm in all, move the rest, and cut it again to the length.

    Each candidate is cut, and the best one is moved: the stiffest, or with strength the one of
    highest value. Before that the stiffest takes over stretches of the others (`exchanged`), if it
    was cut from much more fibre; for several load cases that gains next to nothing. With strength
    it is moved once for the stiffness and once for both, and a test chooses. `last` is the goal on
    the cells of the last test, by which moved paths are taken or not.
    """
    goal = Goal.of(part)

    def cut(
        toolpaths: Toolpaths, share: float, tests: int, least: Judged | None = None
    ) -> Toolpaths:
        return prune(toolpaths, goal, length, machine, strand, tests, share, how.tight, least)

    def judges_of(aim: Goal, tolerance: float) -> tuple[Judge, ...]:
        if not how.strength:
            return (stiffness_judge(aim, machine, strand, layers, tolerance),)
        both = (aim, layers, machine, strand, how.strength)
        return tuple(strength_judge(*both, for_both, tolerance) for for_both in _FOR_BOTH)

    judges = judges_of(goal, _ROUGH)

    def exchange(kept: Toolpaths, source: Toolpaths, near: Sequence[FloatArray]) -> Toolpaths:
        if len(goal.parts) > 1 or fibre_length(source) < _MUCH * length:
            return kept
        cut_again = partial(cut, share=0.0)
        return exchanged(kept, candidates, goal.mesh, machine, judges[0], cut_again, near)

    kept = best_cut(candidates, cut, judges[0], how.strength, how.rounds, exchange)
    if not how.moves:
        return kept
    radius, offered = kept_radius(machine, how.tight), [kept]
    for judge in judges:
        slid = moved(kept, layers, goal.mesh, machine, judge, how.moves, radius=radius)
        if slid is not kept:
            offered.append(cut(slid, 0.0, 1))
    if len(offered) == 1:
        return kept
    # Tested as they are planned in the end, and only if they still lay the length.
    stress = goal.parts[0].unreinforced
    final = [
        plan_layers(WholePart(paths), layers, layers, stress, machine, how.fold)
        for paths in offered
    ]
    enough = (1.0 - TOLERANCE) * min(length, fibre_length(final[0]))
    lays = [paths for paths in final if fibre_length(paths) >= enough]
    best = stiffest(lays, judges_of(last or goal, _EXACT)[0])
    return next(paths for paths, tested in zip(offered, final, strict=True) if tested is best)


def best_cut(
    candidates: Sequence[Toolpaths],
    cut: _Cut,
    judge: Judge,
    strength: float,
    rounds: int,
    exchange: _Exchange | None = None,
) -> Toolpaths:
    """Cut candidates, and return the result of highest value.

    Parameters
    ----------
    candidates : sequence of Toolpaths
        Those beyond the second are cut for the stiffness alone.
    cut : callable
        Cuts toolpaths, given the weight of the load at first failure and the number of tests.
    judge : callable
        Tests the cut paths.
    strength : float in [0, 1]
        Weight of the load at first failure; at 0 each candidate is cut once.
    rounds : int
        Tests of each cut.
    exchange : callable, optional
        Makes the stiffest result of several better still, where strength does not count.
    """
    filled = [paths for paths in candidates if len(paths)]
    if not filled:
        return candidates[0]
    if not strength:
        return _stiffest_cut(filled, cut, judge, rounds, exchange)
    paths, shares = zip(
        *(
            (paths, share * strength)
            for k, paths in enumerate(filled)
            for share in (_SHARES if k < _ALL_WAYS else _SHARES[:1])
        ),
        strict=True,
    )
    return stiffest(list(in_processes(cut, paths, shares, len(paths) * [rounds])), judge)


def _stiffest_cut(
    candidates: Sequence[Toolpaths],
    cut: _Cut,
    judge: Judge,
    rounds: int,
    exchange: _Exchange | None,
) -> Toolpaths:
    """Cut candidates for the stiffness, the first in any case, and return the stiffest result.

    The others are given up as soon as it is certain that they cannot be stiffer than the first.
    """
    first = cut(candidates[0], 0.0, rounds)
    if len(candidates) == 1:
        return first
    least = judge(first)

    def contender(paths: Toolpaths) -> tuple[Toolpaths, float, tuple[FloatArray, ...]]:
        kept = cut(paths, 0.0, rounds, least)
        if not len(kept):
            return kept, -np.inf, ()
        tested = judge(kept)
        return kept, tested.value, tested.displacements

    tried = [
        (first, least.value, least.displacements),
        *in_processes(contender, candidates[1:], shared=[candidates]),
    ]
    best = int(np.argmax([value for _, value, _ in tried]))
    kept, _, near = tried[best]
    return kept if exchange is None else exchange(kept, candidates[best], near)
