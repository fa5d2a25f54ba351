"""Paths cut to a length in several ways; a test chooses the best, and its strands are moved.

The worth of fibre for the load at first failure is known for small changes only, and a cut is a
large one. Where strength counts, fibre is therefore cut three ways: for the stiffness alone, for
the strength as asked for, and for half of that. A plan that is cut follows the first test of much
more fibre: once it is cut, fibre that was taken off, or that another plan has elsewhere, may be
worth more than some that is left, and is exchanged for it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.parallel import in_processes
from ccfem.body.mesh import TetMesh
from ccfem.geometry.polylines import along_line, points_along, resample
from ccfem.judging.virtual_testing import Specimen, Strand, Strands, cut_strands
from ccfem.judging.virtual_testing.equilibrium import Bars, bars
from ccfem.judging.virtual_testing.strands import whole_strands
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import TOLERANCE
from ccfem.paths.planning.layer_plans import plan_layers
from ccfem.paths.planning.strategy import WholePart
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.heights import is_large
from ccfem.strategies.fibre_aware.judges import (
    Goal,
    Judge,
    Judged,
    stiffest,
    stiffness_judge,
    strength_judge,
)
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.prune import fibre_length, profiles, prune
from ccfem.strategies.fibre_aware.shortening import shorten
from ccfem.strategies.fibre_aware.strand_moves import kept_radius, moved

_SHARES = (0.0, 0.5, 1.0)
"""Shares of the `strength` asked for with which fibre is cut."""

_ALL_WAYS = 2
"""Number of candidates cut in all these ways; others are cut for the stiffness alone."""

_FOR_BOTH = (False, True)
"""Whether moves follow the strength too: tried once for the stiffness alone, and once for both."""

_MUCH = 1.12
"""Fibre of a plan over the length wanted from which the last of its cuts is a large step."""

_ROUGH, _LARGE_ROUGH, _EXACT = 1e-4, 1e-3, 1e-6
"""Relative residuals of the tests, of those for the stiffness of parts that are not factorised, and
of the last one of moved paths, which gain little."""


class _Cut(Protocol):
    """Cuts toolpaths to a length, unless others are stiffer than any cut of them."""

    def __call__(
        self, toolpaths: Toolpaths, share: float, tests: int, least: Judged | None = None
    ) -> Toolpaths:
        """Cut, given the weight of the strength, the number of tests and the others."""


_Exchange = Callable[[Toolpaths, Toolpaths, Judged], tuple[Toolpaths, Judged]]
"""Makes a plan better, given what it was cut from and its test; returns it with its own."""


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
    was cut from much more fibre; for several load cases that gains next to nothing. On large parts
    with flat layers the second does so too, and the better one is taken. With strength it is moved
    once for the stiffness and once for both, and a test chooses. `last` is the goal on the cells of
    the last test, by which moved paths are taken or not.
    """
    filled = [paths for paths in candidates if len(paths)]
    goal = Goal.of(part)
    if filled and not how.strength and not how.moves:
        goal = goal.knowing(filled[0], strand)

    def cut(
        toolpaths: Toolpaths, share: float, tests: int, least: Judged | None = None
    ) -> Toolpaths:
        return prune(toolpaths, goal, length, machine, strand, tests, share, how.tight, least)

    def judges_of(aim: Goal, tolerance: float) -> tuple[Judge, ...]:
        if not how.strength:
            return (stiffness_judge(aim, machine, strand, layers, tolerance),)
        both = (aim, layers, machine, strand, how.strength)
        return tuple(strength_judge(*both, for_both, tolerance) for for_both in _FOR_BOTH)

    judges = judges_of(goal, _LARGE_ROUGH if goal.prepared else _ROUGH)

    def exchange(kept: Toolpaths, source: Toolpaths, tested: Judged) -> tuple[Toolpaths, Judged]:
        if len(goal.parts) > 1 or fibre_length(source) < _MUCH * length:
            return kept, tested
        cut_again = partial(cut, share=0.0)
        mesh = goal.mesh
        return exchanged(kept, candidates, mesh, machine, judges[0], cut_again, tested, times)

    large = is_large(goal.mesh, layers)
    times, bases = (_LARGE_TIMES, _LARGE_BASES) if large else (_TIMES, 1)
    kept = best_cut(candidates, cut, judges[0], how.strength, how.rounds, exchange, bases)
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
    bases: int = 1,
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
        Makes the stiffest results of several better still, where strength does not count.
    bases : int, default 1
        Number of results that it is tried on.
    """
    filled = [paths for paths in candidates if len(paths)]
    if not filled:
        return candidates[0]
    if not strength:
        return _stiffest_cut(filled, cut, judge, rounds, exchange, bases)
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
    bases: int,
) -> Toolpaths:
    """Cut candidates for the stiffness, the first in any case, and return the stiffest result.

    The others are given up as soon as it is certain that they cannot be stiffer than the first.
    """
    first = cut(candidates[0], 0.0, rounds)
    if len(candidates) == 1:
        return first
    least = judge(first)

    def contender(paths: Toolpaths) -> tuple[Toolpaths, Judged | None]:
        kept = cut(paths, 0.0, rounds, least)
        return kept, judge(kept) if len(kept) else None

    tried = [(first, least), *in_processes(contender, candidates[1:], shared=[candidates])]
    whole = [(k, kept, tested) for k, (kept, tested) in enumerate(tried) if tested is not None]
    best = sorted(whole, key=lambda one: -one[2].value)[:bases]
    if exchange is None:
        return best[0][1]
    number, kept, judged = zip(*best, strict=True)
    sources = [candidates[k] for k in number]
    better = in_processes(exchange, kept, sources, judged, shared=[candidates])
    return max(better, key=lambda one: one[1].value)[0]


# Stretches of other plans in the room between strands, in exchange for what carries less.


_TIMES, _LARGE_TIMES = 3, 4
"""Exchanges at most; the second on large parts, where fewer plans take part."""

_LARGE_BASES = 2
"""Plans that take over stretches on large parts, where one more costs less than other plans: on the
Shell of Chen et al. 2021 the second best one becomes the best. Elsewhere only the stiffest does."""

_GAIN = 1e-3
"""Share by which an exchange has to be better: less may be rounding, which turns with the part."""

_FRESH = 0.08
"""Fibre that is taken from each plan, over the length of all."""

_TESTS = 2
"""Tests by which the plan and what is added to it are cut to the length."""

_CHEAPEST = 0.1
"""Share of the fibre that may go: what takes its place is worth more than the best of it."""

_STEP, _NEAR = 0.25, 0.99
"""Distance of the points on strands from which room is measured, and least distance of new
stretches from these, in strand widths."""

_NEVER = 1e6
"""Loss of fibre where there is no room, over the largest worth of any."""


def exchanged(
    paths: Toolpaths,
    plans: Sequence[Toolpaths],
    mesh: TetMesh,
    machine: Machine,
    judge: Judge,
    cut: Callable[..., Toolpaths],
    tested: Judged | None = None,
    times: int = _TIMES,
) -> tuple[Toolpaths, Judged]:
    """Add stretches of other plans to a plan where there is room, and cut all to the length again.

    Parameters
    ----------
    paths : Toolpaths
        Fibre of the length wanted.
    plans : sequence of Toolpaths
        Plans that are not cut to the length, on the same layers.
    cut : callable
        Cuts toolpaths to the length wanted, by a number of `tests`.
    tested : Judged, optional
        The test of the given paths, where it is known.
    times : int, default 3
        Exchanges at most.

    Returns
    -------
    Toolpaths, Judged
        The given ones where nothing as long is stiffer by more than a thousandth; and their test.
    """
    least = machine.shortest_strand
    length, known = fibre_length(paths), judge(paths) if tested is None else tested
    pieces = [(plan, *_pieces(plan, mesh)) for plan in plans if len(plan)]
    for _ in range(times):
        price, taken = _price(paths, known, mesh), _Taken(machine.fibre_width, [paths])
        for plan, strands, pieces_of in pieces:
            along = profiles(plan, strands, _worth(known, pieces_of))
            gains = taken.room(plan, along, price)
            fresh = shorten(plan, gains, _FRESH * length, least)
            if len(fresh):
                taken.add(fresh.of_kind(FIBRE))
        if len(taken.plans) == 1:
            break
        other = cut(Toolpaths.concatenate(taken.plans), tests=_TESTS)
        fresh_test = judge(other, known.displacements)
        better = fresh_test.value > (1.0 + _GAIN) * known.value
        if not better or fibre_length(other) < (1.0 - 0.5 * TOLERANCE) * length:
            break
        paths, known = other, fresh_test
    return paths, known


def _pieces(paths: Toolpaths, mesh: TetMesh) -> tuple[Strands, Bars]:
    strands = whole_strands(paths, mesh)
    return strands, bars(strands, mesh)


def _worth(known: Judged, pieces: Bars) -> FloatArray:
    """Worth (s,) per mm of pieces of fibre, as they would be stretched."""
    worth = np.zeros(len(pieces.length))
    for of_case in known.strain_worths():
        strain = pieces.strain(of_case.displacement)
        adjoint = of_case.adjoint
        beside = np.zeros_like(strain) if adjoint is None else pieces.strain(adjoint)
        worth += of_case.value(strain, beside)
    return worth


def _price(paths: Toolpaths, known: Judged, mesh: TetMesh) -> float:
    """Worth per mm above the share `_CHEAPEST` of the fibre."""
    strands = cut_strands(paths, mesh)
    worth = _worth(known, bars(strands, mesh))
    order = np.argsort(worth, kind="stable")
    before = np.cumsum(strands.length[order])
    return float(worth[order][np.searchsorted(before, _CHEAPEST * before[-1])])


class _Taken:
    """Plans whose strands take room from others on their layers."""

    def __init__(self, width: float, plans: list[Toolpaths]) -> None:
        self.width, self.plans, self.trees = width, list[Toolpaths](), dict[int, list[cKDTree]]()
        for plan in plans:
            self.add(plan)

    def add(self, plan: Toolpaths) -> None:
        """Take the room of one more plan."""
        self.plans.append(plan)
        points, ends = resample(plan.points, plan.offsets, _STEP * self.width)
        layer = np.repeat(plan.layer, np.diff(ends))
        for index in np.unique(layer).tolist():
            self.trees.setdefault(index, []).append(cKDTree(points[layer == index]))

    def room(self, plan: Toolpaths, along: Sequence[Profile], price: float) -> list[Profile]:
        """Profiles of another plan beyond a price; what is too near or a link is never worth it."""
        values = np.concatenate([profile.value for profile in along]) - price
        lost = -_NEVER * float(np.abs(values).max())
        paths = np.array([profile.path for profile in along])
        counts = np.array([len(profile.value) for profile in along])
        middles, links = zip(*(_middles(plan, profile) for profile in along), strict=True)
        places, free = np.concatenate(middles), ~np.concatenate(links)
        layer = np.repeat(plan.layer[paths], counts)
        for index in np.unique(layer).tolist():
            for tree in self.trees.get(index, ()):
                there = np.flatnonzero(free & (layer == index))
                near = tree.query(places[there], distance_upper_bound=_NEAR * self.width)[0]
                free[there] = ~np.isfinite(near)
        left = np.where(free, values, lost)
        ends = np.cumsum(counts)[:-1]
        return [
            replace(profile, value=value)
            for profile, value in zip(along, np.split(left, ends), strict=True)
        ]


def _middles(plan: Toolpaths, profile: Profile) -> tuple[FloatArray, BoolArray]:
    """Middles (n, 3) of the pieces of a path, and which of them are links."""
    first, end = plan.offsets[profile.path : profile.path + 2]
    line = plan.points[first:end]
    arcs, count = along_line(line), len(profile.value)
    at = np.mod(profile.origin + (np.arange(count) + 0.5) * profile.step, arcs[-1])
    step = np.searchsorted(arcs, at, side="right") - 1
    return points_along(line, arcs, at), plan.link[first + step]
