"""Paths cut to a length in several ways; a test chooses the best, and its strands are moved.

The worth of fibre for the load at first failure is known for small changes only, and a cut is a
large one. Where strength counts, fibre is therefore cut three ways: for the stiffness alone, for
the strength as asked for, and for half of that.
"""

from collections.abc import Callable, Sequence

from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import TOLERANCE
from ccfem.paths.planning.unfolding import without_folds
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.judges import (
    Goal,
    Judge,
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

_Cut = Callable[[Toolpaths, float, int], Toolpaths]
"""Cuts toolpaths to a length; takes toolpaths, weight of the strength and number of tests."""


def prune_and_move(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    part: Specimen | Goal,
    length: float,
    machine: Machine,
    strand: Strand,
    rounds: int,
    strength: float,
    moves: int,
    tight: float = 1.0,
) -> Toolpaths:
    """Cut fibre to a length, mm in all, move the rest, and cut it again to the length.

    Each candidate is cut, and the best one is moved: the stiffest, or with strength the one of
    highest value. With strength it is moved once for the stiffness and once for both, and a test
    chooses. Parameters as in `ccfem.strategies.fibre_aware.prune.prune` and
    `ccfem.strategies.fibre_aware.strand_moves.moved`.
    """
    goal = Goal.of(part)

    def cut(toolpaths: Toolpaths, share: float, tests: int) -> Toolpaths:
        return prune(toolpaths, goal, length, machine, strand, tests, share, tight)

    judges: tuple[Judge, ...] = (stiffness_judge(goal, machine, strand, layers),)
    if strength:
        how = (goal, layers, machine, strand, strength)
        judges = tuple(strength_judge(*how, for_both) for for_both in _FOR_BOTH)
    kept = best_cut(candidates, cut, judges[0], strength, rounds)
    enough = (1.0 - TOLERANCE) * min(length, fibre_length(kept))
    return _moved(kept, layers, goal.mesh, machine, cut, judges, moves, tight, enough)


def best_cut(
    candidates: Sequence[Toolpaths], cut: _Cut, judge: Judge, strength: float, rounds: int
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
    """
    filled = [paths for paths in candidates if len(paths)]
    if not filled:
        return candidates[0]
    cuts = [
        cut(paths, share * strength, rounds)
        for k, paths in enumerate(filled)
        for share in (_SHARES if strength and k < _ALL_WAYS else _SHARES[:1])
    ]
    return stiffest(cuts, judge)


def _moved(
    kept: Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    cut: _Cut,
    judges: Sequence[Judge],
    moves: int,
    tight: float,
    enough: float,
) -> Toolpaths:
    """Move the paths once for each judge, and cut those that have become longer.

    The first judge chooses among the results that still lay enough, mm, as they are without folds,
    and the unmoved paths.
    """
    radius, results = kept_radius(machine, tight), []
    for judge in judges if moves else ():
        slid = moved(kept, layers, mesh, machine, judge, moves, radius=radius)
        if slid is not kept:
            results.append(without_folds(cut(slid, 0.0, 1), layers, machine))
    results = [paths for paths in results if fibre_length(paths) >= enough]
    return stiffest([*results, kept], judges[0])
