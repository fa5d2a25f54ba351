"""Tests of paths under several load cases, and what they say the fibre is worth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, freeze, in_brief
from ccfem.checks import check_known
from ccfem.fibre_aware.judges import Judge, Judged
from ccfem.fibre_aware.strain_worth import StrainWorth
from ccfem.fibre_aware.strength_value import Worth, layer_normal
from ccfem.fibre_aware.upper_bound import LEAST, OBJECTIVES, SUM, WORST
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.equilibrium import Equilibrium, equilibrium
from ccfem.virtual_testing.several_cases import cases_failure, virtual_tests
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import Strands, cut_strands

__all__ = ["CasesGoal", "CasesTested", "cases_judge", "cases_strength_judge", "cases_tests"]

_POWERS = {WORST: 20.0, SUM: 1.0, LEAST: 20.0}
_TOLERANCE = 1e-5
"""Relative residual of the tests; the error of the stiffness is of its square."""


@dataclass(frozen=True)
class CasesGoal:
    """What is wanted of a part under several load cases.

    Attributes
    ----------
    parts : tuple of Specimen
        The part without fibre under each case.
    weights : (n,) array
        Of the cases.
    bounds : (n,) array
        Stiffness ratio of each case that it is measured by, one that no paths exceed
        (`ccfem.fibre_aware.upper_bound.measures`).
    objective : {"worst", "sum", "least"}
        What counts: the case that is farthest below what it is measured by, or the weighted mean.

    Raises
    ------
    InputError
        For an unknown objective.
    """

    parts: tuple[Specimen, ...]
    weights: FloatArray
    bounds: FloatArray
    objective: str = WORST

    __repr__ = in_brief

    def __post_init__(self) -> None:
        check_known("objective", self.objective, OBJECTIVES)
        freeze(self, weights=float, bounds=float)

    def counts(self, ratios: FloatArray) -> FloatArray:
        """How much each case counts at stiffness ratios (n,): (n,), the sum is 1."""
        terms = self.bounds / np.asarray(ratios)
        counts = self.weights * (terms / terms.max()) ** _POWERS[self.objective]
        return np.asarray(counts / counts.sum())

    def merit(self, ratios: FloatArray) -> float:
        """Mean of ratio over bound, weighted by `counts`.

        With the objectives "worst" and "least" it is close to the value of the worst case.
        """
        power, shares = _POWERS[self.objective], self.weights / self.weights.sum()
        return float(shares @ (self.bounds / np.asarray(ratios)) ** power) ** (-1.0 / power)


@dataclass(frozen=True)
class CasesTested:
    """Equilibria under all load cases.

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


def cases_tests(goal: CasesGoal, strand: Strand | None) -> Callable[[Strands], CasesTested]:
    """Return a test of strands under all load cases; each test starts from the last solutions."""
    parts = goal.parts
    axial = (Strand() if strand is None else strand).stiffness(parts[0].modulus)
    before = np.array([2.0 * part.unreinforced.strain_energy for part in parts])
    pulled = np.array([part.forced for part in parts])
    known: list[tuple[FloatArray, ...]] = [()] * len(parts)

    def test(strands: Strands) -> CasesTested:
        found = tuple(
            equilibrium(part, strands, axial, known=near, tolerance=_TOLERANCE)
            for part, near in zip(parts, known, strict=True)
        )
        known[:] = [(one.displacement,) for one in found]
        work = np.array([_work(part, one) for part, one in zip(parts, found, strict=True)])
        return CasesTested(found, np.where(pulled, before / work, work / before), work)

    return test


def cases_judge(goal: CasesGoal, machine: Machine, strand: Strand | None = None) -> Judge:
    """Judge of paths by the stiffness in all load cases, with the room that strands need."""
    test = cases_tests(goal, strand)

    def judge(toolpaths: Toolpaths) -> Judged:
        mesh = goal.parts[0].unreinforced.mesh
        tested = test(cut_strands(toolpaths, mesh, machine=machine))
        counts = goal.counts(tested.ratios) / tested.work
        worths = _stiff_worths(counts, [one.displacement for one in tested.found])
        return Judged(goal.merit(tested.ratios), lambda: worths)

    return judge


def cases_strength_judge(
    goal: CasesGoal,
    layers: Sequence[Layer],
    machine: Machine,
    strand: Strand,
    strength: float,
    for_both: bool = True,
) -> Judge:
    """Judge of paths by the stiffness in all load cases and the load at first failure.

    The value is ``merit^(1 - strength) factor^strength``, the factor being the least load at first
    failure over the load of its case. Where supports move, the latter is the load that they take in
    the part without fibre. With `for_both` the worth of fibre by its strain is that for both,
    else that for the stiffness alone.
    """
    known: list[FloatArray] = []
    worth, axial = Worth.of(goal.parts, strand, strength), strand.stiffness(goal.parts[0].modulus)
    bare = [part.force(part.unreinforced.reactions) for part in goal.parts]

    def judge(toolpaths: Toolpaths) -> Judged:
        near = known or None
        tested = virtual_tests(toolpaths, goal.parts, strand, machine=machine, known=near)
        known[:] = [one.solution.displacement for one in tested.tests]
        loads = [one.load for one in cases_failure(tested, strand, layers=layers).each]
        factor = min(load / size for load, size in zip(loads, bare, strict=True))
        value = goal.merit(tested.ratios) ** (1.0 - strength) * factor**strength
        strands, displaced = tested.tests[0].strands, tuple(known)
        normal, counts = layer_normal(toolpaths), goal.counts(tested.ratios)

        def strain_worths() -> tuple[StrainWorth, ...]:
            if not for_both:
                work = [2.0 * one.solution.strain_energy for one in tested.tests]
                return _stiff_worths(counts / work, displaced)
            found = [
                equilibrium(part, strands, axial, known=(u,), tolerance=_TOLERANCE)
                for part, u in zip(goal.parts, displaced, strict=True)
            ]
            return worth.strain_worths(strands, found, normal, counts)

        return Judged(value, strain_worths)

    return judge


def _stiff_worths(
    counts: FloatArray, displacements: Sequence[FloatArray]
) -> tuple[StrainWorth, ...]:
    """Worth of fibre by its strain, where each load case has this weight in the stiffness."""
    pairs = zip(counts.tolist(), displacements, strict=True)
    return tuple(StrainWorth(count, displacement) for count, displacement in pairs)


def _work(part: Specimen, found: Equilibrium) -> float:
    """Work of the forces, or of the supports that move, N mm: twice the strain energy."""
    return float(np.vdot(part.forces, found.displacement)) if part.forced else found.work
