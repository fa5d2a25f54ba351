"""Cutting paths to a length in several ways, of which a test chooses, and moving what is left.

What fibre is worth for the load at first failure is known for small changes only, and a cut is a
large one. So where strength counts fibre is cut for the stiffness alone, for the strength as asked
for, and for half of that.
"""

from collections.abc import Callable, Sequence

from ccfem.fibre_aware.cases_judges import CasesGoal, cases_judge, cases_strength_judge
from ccfem.fibre_aware.judges import Judge, stiffest, stiffness_judge, strength_judge
from ccfem.fibre_aware.prune import prune
from ccfem.fibre_aware.prune_cases import prune_cases
from ccfem.fibre_aware.strand_moves import kept_radius, moved
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand

__all__ = ["best_cut", "prune_and_move", "prune_and_move_cases"]

_SHARES = (0.0, 0.5, 1.0)
"""Of the strength asked for, with which fibre is cut."""

_ALL_WAYS = 2
"""Candidates that are cut in all these ways; the others are cut for the stiffness alone."""

_FOR_BOTH = (False, True)
"""Whether moves follow stiffness and strength: once the stiffness alone, and once both."""

_Cut = Callable[[Toolpaths, float, int], Toolpaths]
"""Cuts toolpaths to a length, with how much strength counts, by a number of tests."""


def prune_and_move(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    part: Specimen,
    length: float,
    machine: Machine,
    strand: Strand,
    rounds: int,
    strength: float,
    moves: int,
    tight: float = 1.0,
) -> Toolpaths:
    """Cut fibre to a length, mm in all, move what is left, and cut what has become longer.

    Of several candidates each is cut, and the stiffest moved; with strength that of most worth,
    once for the stiffness and once for both: a test chooses. Parameters as of
    `ccfem.fibre_aware.prune.prune` and `ccfem.fibre_aware.strand_moves.moved`.
    """

    def cut(toolpaths: Toolpaths, share: float, tests: int) -> Toolpaths:
        return prune(toolpaths, part, length, machine, strand, tests, share, tight)

    mesh = part.unreinforced.mesh
    judges: tuple[Judge, ...] = (stiffness_judge(part, machine, strand),)
    if strength:
        how = (part, layers, machine, strand, strength)
        judges = tuple(strength_judge(*how, for_both) for for_both in _FOR_BOTH)
    kept = best_cut(candidates, cut, judges[0], strength, rounds)
    return _moved(kept, layers, mesh, machine, cut, judges, moves, tight)


def prune_and_move_cases(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    goal: CasesGoal,
    length: float,
    machine: Machine,
    strand: Strand,
    rounds: int,
    strength: float,
    moves: int,
    tight: float = 1.0,
) -> Toolpaths:
    """Cut fibre for several load cases, as `prune_and_move` does it for one.

    Parameters as of `ccfem.fibre_aware.prune_cases.prune_cases`. Where strength counts, the load
    case does that fails first.
    """

    def cut(toolpaths: Toolpaths, share: float, tests: int) -> Toolpaths:
        return prune_cases(toolpaths, goal, length, machine, strand, tests, share, tight)

    mesh = goal.parts[0].unreinforced.mesh
    judges: tuple[Judge, ...] = (cases_judge(goal, machine, strand),)
    if strength:
        how = (goal, layers, machine, strand, strength)
        judges = tuple(cases_strength_judge(*how, for_both) for for_both in _FOR_BOTH)
    kept = best_cut(candidates, cut, judges[0], strength, rounds)
    return _moved(kept, layers, mesh, machine, cut, judges, moves, tight)


def best_cut(
    candidates: Sequence[Toolpaths], cut: _Cut, judge: Judge, strength: float, rounds: int
) -> Toolpaths:
    """Cut candidates, and return what is worth most.

    Parameters
    ----------
    candidates : sequence of Toolpaths
        Those beyond the second are cut for the stiffness alone.
    cut : callable
        Cuts toolpaths, with how much the load at first failure counts, by a number of tests.
    judge : callable
        Tests what is left.
    strength : float in [0, 1]
        How much the load at first failure counts; at 0 each is cut once.
    rounds : int
        Tests of each cut.
    """
    laid = [one for one in candidates if len(one)]
    if not laid:
        return candidates[0]
    cuts = [
        cut(one, share * strength, rounds)
        for k, one in enumerate(laid)
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
) -> Toolpaths:
    """Move what was kept, once as each judge says, and cut what has become longer.

    Of several judges the first says which is worth most, or that what was kept is.
    """
    radius, found = kept_radius(machine, tight), []
    for judge in judges:
        slid = moved(kept, layers, mesh, machine, judge, moves, radius=radius)
        found += [] if slid is kept else [cut(slid, 0.0, 1)]
    if not found:
        return kept
    return stiffest([*found, kept], judges[0]) if len(judges) > 1 else found[0]
