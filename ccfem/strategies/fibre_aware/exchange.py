"""Stretches of other plans in the room between strands, in exchange for what carries less.

A plan that is cut to a length follows the first test of much more fibre. Once it is cut, fibre that
was taken off, or that another plan has elsewhere, may be worth more than some that is left.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.body.mesh import TetMesh
from ccfem.geometry.polylines import along_line, points_along, resample
from ccfem.judging.virtual_testing import Strands, cut_strands
from ccfem.judging.virtual_testing.equilibrium import Bars, bars
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import TOLERANCE
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.strategies.fibre_aware.judges import Judge, Judged
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.prune import fibre_length, profiles
from ccfem.strategies.fibre_aware.shortening import shorten

_TIMES = 3
"""Exchanges at most."""

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


class _Cut(Protocol):
    """Cuts toolpaths to the length wanted."""

    def __call__(self, toolpaths: Toolpaths, *, tests: int) -> Toolpaths:
        """Cut by a number of tests."""


def exchanged(
    paths: Toolpaths,
    plans: Sequence[Toolpaths],
    mesh: TetMesh,
    machine: Machine,
    judge: Judge,
    cut: _Cut,
    near: Sequence[FloatArray] | None = None,
) -> Toolpaths:
    """Add stretches of other plans to a plan where there is room, and cut all to the length again.

    Parameters
    ----------
    paths : Toolpaths
        Fibre of the length wanted.
    plans : sequence of Toolpaths
        Plans that are not cut to the length, on the same layers.
    judge : callable
        Tests paths.
    near : sequence of (n, 3) arrays, mm, optional
        Displacements of the part with alike paths under each load case, which save time.

    Returns
    -------
    Toolpaths
        The given ones where nothing as long is stiffer by more than a thousandth.
    """
    least = machine.shortest_strand
    length, known = fibre_length(paths), judge(paths, near)
    pieces = [(plan, *_pieces(plan, mesh)) for plan in plans if len(plan)]
    for _ in range(_TIMES):
        price, taken = _price(paths, known, mesh), _Taken(machine.fibre_width, [paths])
        for plan, strands, pieces_of in pieces:
            along = profiles(plan, strands, _worth(known, pieces_of))
            gains = taken.room(plan, along, price)
            fresh = shorten(plan, gains, _FRESH * length, least)
            if len(fresh):
                taken.add(fresh.of_kind(FIBRE))
        if len(taken.plans) == 1:
            return paths
        other = cut(Toolpaths.concatenate(taken.plans), tests=_TESTS)
        tested = judge(other, known.displacements)
        better = tested.value > (1.0 + _GAIN) * known.value
        if not better or fibre_length(other) < (1.0 - 0.5 * TOLERANCE) * length:
            return paths
        paths, known = other, tested
    return paths


def _pieces(paths: Toolpaths, mesh: TetMesh) -> tuple[Strands, Bars]:
    strands = cut_strands(paths, mesh)
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
    strands, pieces = _pieces(paths, mesh)
    worth = _worth(known, pieces)
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
