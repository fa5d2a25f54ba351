"""Tests of paths under one or several load cases: their value, and the worth of their fibre."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.base.checks import check_known
from ccfem.base.parallel import in_processes
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import StressField
from ccfem.judging.virtual_testing import Specimen, Strand, Strands, cut_strands
from ccfem.judging.virtual_testing.equilibrium import (
    Equilibrium,
    bars,
    equilibrium,
    knowing_fibre,
)
from ccfem.judging.virtual_testing.several_cases import cases_failure, virtual_tests
from ccfem.judging.virtual_testing.strands import whole_strands
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.strain_worth import StrainWorth
from ccfem.strategies.fibre_aware.strength_value import Worth, layer_normal
from ccfem.strategies.fibre_aware.upper_bound import LEAST, OBJECTIVES, SUM, WORST

POWERS = {WORST: 20.0, SUM: 1.0, LEAST: 20.0}
"""Power of ``bound / ratio`` in the sum over the cases, for each objective."""

_TOLERANCE = 1e-4
"""Relative residual of the tests; the error of the stiffness is of its square."""


@dataclass(frozen=True)
class Goal:
    """What is wanted of a part under one or several load cases.

    Attributes
    ----------
    parts : tuple of Specimen
        The part without fibre under each case.
    weights : (n,) array
        Of the cases.
    bounds : (n,) array
        Stiffness ratio that each case is measured by, one that no paths exceed
        (`ccfem.strategies.fibre_aware.upper_bound.measures`); of one case any number.
    objective : {"worst", "sum", "least"}
        What counts: the case that is farthest below what it is measured by, or the weighted mean.
    prepared : bool, default False
        Whether the parts have preconditioners that know fibre; tests then make none of their own.
    """

    parts: tuple[Specimen, ...]
    weights: FloatArray
    bounds: FloatArray
    objective: str = WORST
    prepared: bool = False

    __repr__ = in_brief

    def __post_init__(self) -> None:
        check_known("objective", self.objective, OBJECTIVES)
        freeze(self, weights=float, bounds=float)

    @classmethod
    def of(cls, part: "StressField | Specimen | Goal") -> "Goal":
        """Return the goal of one load case, the stiffness over that without fibre; or a goal."""
        if isinstance(part, Goal):
            return part
        specimen = Specimen.of(part) if isinstance(part, StressField) else part
        return cls((specimen,), np.ones(1), np.ones(1))

    def knowing(self, toolpaths: Toolpaths, strand: Strand) -> "Goal":
        """Return the goal of one load case with its part prepared for tests of paths like some.

        Several load cases, and parts that are factorised, stay as they are.
        """
        if len(self.parts) > 1 or self.parts[0].solver.backend != "amg":
            return self
        strands = whole_strands(toolpaths, self.mesh)
        axial = strand.stiffness(self.parts[0].modulus)
        return replace(self, parts=(knowing_fibre(self.parts[0], strands, axial),), prepared=True)

    @property
    def mesh(self) -> TetMesh:
        """Mesh of the part."""
        return self.parts[0].unreinforced.mesh

    def counts(self, ratios: FloatArray) -> FloatArray:
        """How much each case counts at stiffness ratios (n,): (n,), the sum is 1."""
        terms = self.bounds / np.asarray(ratios)
        counts = self.weights * (terms / terms.max()) ** POWERS[self.objective]
        return np.asarray(counts / counts.sum())

    def merit(self, ratios: FloatArray) -> float:
        """Mean of ratio over bound, weighted by `counts`.

        With the objectives "worst" and "least" it is close to the value of the worst case.
        """
        power, shares = POWERS[self.objective], self.weights / self.weights.sum()
        return float(shares @ (self.bounds / np.asarray(ratios)) ** power) ** (-1.0 / power)


@dataclass(frozen=True)
class Equilibria:
    """Equilibria of a part with its fibre under all load cases.

    Attributes
    ----------
    found : tuple of Equilibrium
    ratios : (n,) array
        Stiffness over that of the part without fibre.
    work : (n,) array, N mm
        Of the forces, or of the supports that move: twice the strain energy.
    """

    found: tuple[Equilibrium, ...]
    ratios: FloatArray
    work: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, ratios=float, work=float)

    @property
    def displacements(self) -> tuple[FloatArray, ...]:
        """Displacement (n, 3), mm, under each case."""
        return tuple(equilibrium.displacement for equilibrium in self.found)


def equilibria(
    goal: Goal,
    strands: Strands,
    strand: Strand | None = None,
    known: Sequence[FloatArray] | None = None,
    tolerance: float = _TOLERANCE,
) -> Equilibria:
    """Find the equilibrium under every load case, with fibres that carry tension only.

    Parameters
    ----------
    strand : Strand, optional
        Default rho = EA/E = 4 mm^2.
    known : sequence of (n, 3) arrays, mm, optional
        For each case a displacement near its solution, to start from.
    tolerance : float, default 1e-4
        Relative residual.
    """
    axial = (Strand() if strand is None else strand).stiffness(goal.parts[0].modulus)
    with_strands, ratios, works = [], [], []
    for k, part in enumerate(goal.parts):
        near = () if known is None else (known[k],)
        with_fibre = equilibrium(
            part, strands, axial, known=near, tolerance=tolerance, prepare=not goal.prepared
        )
        stiffness = part.stiffness(with_fibre.displacement, 0.5 * with_fibre.work)
        bare = part.unreinforced
        ratio = stiffness / part.stiffness(bare.displacement, bare.strain_energy)
        before = 2.0 * bare.strain_energy
        with_strands.append(with_fibre)
        ratios.append(ratio)
        works.append(before / ratio if part.forced else before * ratio)
    return Equilibria(tuple(with_strands), np.array(ratios), np.array(works))


def most_merit(
    goal: Goal,
    strands: Strands,
    length: float,
    displacements: Sequence[FloatArray],
    strand: Strand | None = None,
) -> float:
    """Merit that no choice of some strands exceeds, by the least energy of all displacements.

    With fibre on the pieces P, any displacement v that the supports allow gives the compliance
    ``W >= (f.v)^2 / (v.K v + sum over P of EA l eps(v)^2)``, and where supports move the energy
    ``W <= v.K v + sum over P of EA l eps(v)^2``. The sum is largest over the pieces that v
    stretches most.

    Parameters
    ----------
    length : float, mm
        Largest length of fibre of a choice.
    displacements : sequence of (n, 3) arrays, mm
        Of each load case: the nearer to the solution with the best choice, the lower the bound.
    strand : Strand, optional
        As of `equilibria`.
    """
    axial = (Strand() if strand is None else strand).stiffness(goal.parts[0].modulus)
    pieces, ratios = bars(strands, goal.mesh), []
    for part, u in zip(goal.parts, displacements, strict=True):
        squares = np.maximum(pieces.strain(u), 0.0) ** 2
        order = np.argsort(-squares, kind="stable")
        before = np.cumsum(strands.length[order]) - strands.length[order]
        taken = np.clip(length - before, 0.0, strands.length[order])
        energy = np.vdot(u, part.matrix @ u.reshape(-1)) + axial * (squares[order] @ taken)
        work = 2.0 * part.unreinforced.strain_energy
        force = np.vdot(part.forces, u)
        ratios.append(work * energy / force**2 if part.forced else energy / work)
    return goal.merit(np.array(ratios))


@dataclass(frozen=True)
class Judged:
    """Result of a test of paths.

    Attributes
    ----------
    value : float
        Value to be maximised.
    displacements : tuple of (n, 3) arrays, mm
        Of each load case.
    strain_worths : callable
        Returns the worth of fibre by its strain, for each load case. With strength this takes
        further solves, so it is computed only when called.
    """

    value: float
    displacements: tuple[FloatArray, ...]
    strain_worths: Callable[[], tuple[StrainWorth, ...]]

    __repr__ = in_brief


class Judge(Protocol):
    """Tests paths."""

    def __call__(self, toolpaths: Toolpaths, near: Sequence[FloatArray] | None = None) -> Judged:
        """Test paths; the displacements of similar ones under each case save time."""


def stiffness_judge(
    part: StressField | Specimen | Goal,
    machine: Machine,
    strand: Strand | None = None,
    layers: Sequence[Layer] = (),
    tolerance: float = _TOLERANCE,
) -> Judge:
    """Judge of paths by the stiffness in all load cases, of what carries of the printed strands.

    Strands need room, and carry nothing in folds, where they cross, and outside their layers if
    those are given: as a comparison tests them.
    """
    goal = Goal.of(part)

    def judge(toolpaths: Toolpaths, near: Sequence[FloatArray] | None = None) -> Judged:
        strands = _carrying(toolpaths, goal, machine, layers)
        tested = equilibria(goal, strands, strand, near, tolerance)
        counts = goal.counts(tested.ratios) / tested.work
        worths = partial(_stiff_worths, counts, tested.displacements)
        return Judged(goal.merit(tested.ratios), tested.displacements, worths)

    return judge


def strength_judge(
    part: StressField | Specimen | Goal,
    layers: Sequence[Layer],
    machine: Machine,
    strand: Strand,
    strength: float,
    for_both: bool = True,
    tolerance: float = _TOLERANCE,
) -> Judge:
    """Judge of paths by the stiffness in all load cases and the load at first failure.

    The value is ``merit^(1 - strength) factor^strength``, the factor being the least load at first
    failure over the load of its case: at a strength of one half, relative changes of both count
    equally. Where supports move, the load of the case is the one that they take in the part without
    fibre. With `for_both` the worth of fibre by its strain is that for both, else that for the
    stiffness alone. The error of a load at first failure is of the size of the residual.
    """
    goal = Goal.of(part)
    worth = Worth.of(goal.parts, strand, strength)
    bare = [one.force(one.unreinforced.reactions) for one in goal.parts]

    def judge(toolpaths: Toolpaths, near: Sequence[FloatArray] | None = None) -> Judged:
        strands = _carrying(toolpaths, goal, machine, layers)
        tested = virtual_tests(strands, goal.parts, strand, known=near, tolerance=tolerance)
        displaced = tuple(one.solution.displacement for one in tested.tests)
        loads = [one.load for one in cases_failure(tested, strand, layers=layers).each]
        factor = min(load / size for load, size in zip(loads, bare, strict=True))
        value = goal.merit(tested.ratios) ** (1.0 - strength) * factor**strength
        normal, counts = layer_normal(toolpaths), goal.counts(tested.ratios)

        def strain_worths() -> tuple[StrainWorth, ...]:
            if not for_both:
                work = [2.0 * one.solution.strain_energy for one in tested.tests]
                return _stiff_worths(counts / work, displaced)
            equilibrium_of = equilibria(goal, strands, strand, displaced, tolerance).found
            return worth.strain_worths(strands, equilibrium_of, normal, counts)

        return Judged(float(value), displaced, strain_worths)

    return judge


def _carrying(
    toolpaths: Toolpaths, goal: Goal, machine: Machine, layers: Sequence[Layer]
) -> Strands:
    """Strands of a strategy that plans no height of crossings, with what of them carries."""
    return cut_strands(toolpaths, goal.mesh, machine=machine, layers=layers, crosses=False)


def stiffest(candidates: Sequence[Toolpaths], judge: Judge) -> Toolpaths:
    """Return the toolpaths of highest value, the first of equal ones; one alone is not tested."""
    filled = [paths for paths in candidates if len(paths)]
    if len(filled) < 2:
        return filled[0] if filled else candidates[0]
    values = in_processes(lambda paths: judge(paths).value, filled)
    return filled[int(np.argmax(list(values)))]


def _stiff_worths(
    counts: FloatArray, displacements: Sequence[FloatArray]
) -> tuple[StrainWorth, ...]:
    """Worth of fibre by its strain, where a squared strain counts so much in each load case."""
    pairs = zip(counts.tolist(), displacements, strict=True)
    return tuple(StrainWorth(count, displacement) for count, displacement in pairs)
