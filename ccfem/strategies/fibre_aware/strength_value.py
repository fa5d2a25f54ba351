"""Worth of fibre for the stiffness and for the load at first failure together.

One adjoint solve, loaded with the derivative of the indices by the displacement, gives the effect
of every piece of fibre: ``-EA eps eps_adjoint`` per length, plus its own part in the index of the
fibre (`ccfem.judging.virtual_testing.near_failure`). Of several load cases, one at a time, the case
counts that fails first, at the least multiple of its load. Each case has its own adjoint solve.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, in_brief
from ccfem.base.checks import check_number
from ccfem.fem.elasticity import preconditioned_cg
from ccfem.judging.virtual_testing import Specimen, Strand, Strands
from ccfem.judging.virtual_testing.equilibrium import Bars, Equilibrium, Reduced, bars
from ccfem.judging.virtual_testing.near_failure import (
    POWER,
    MatrixPeaks,
    Peak,
    check_stretched,
    nearness,
    stretched_index,
)
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.judging.virtual_testing.strands import Windows
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware.strain_worth import StrainWorth

_LITTLE = 1e-3
"""Share of the largest value below which values count as little when negative ones are raised."""

_TOLERANCE = 1e-4
"""Relative residual of the adjoint solve."""

_NONE = 1e-300
"""Used in place of zero as a divisor."""


def layer_normal(toolpaths: Toolpaths) -> FloatArray | None:
    """Find the normal (3,) of the layers of all paths; None where they do not share one."""
    normals = toolpaths.normals
    return (
        normals[0] if len(normals) and (np.abs(normals @ normals[0]) > 1.0 - 1e-9).all() else None
    )


def raised(value: FloatArray) -> FloatArray:
    """Values (s,) in the same order, none below zero, so that any wanted length can be kept.

    Negative values are mapped to between zero and the least value that counts.
    """
    most, least = float(value.max(initial=0.0)), float(value.min(initial=0.0))
    if not least < 0.0:
        return value
    little = _LITTLE * most
    return np.where(value > 0.0, little + (1.0 - _LITTLE) * value, little * (1.0 - value / least))


@dataclass(frozen=True)
class Worth:
    """Worth of fibre in a part, for any number of sets of paths.

    Attributes
    ----------
    parts : tuple of Specimen
        The part without fibre under each load case.
    strength : float in [0, 1]
        Weight of the load at first failure; the stiffness has the rest.
    judges : tuple of MatrixPeaks
        One for each load case.
    """

    parts: tuple[Specimen, ...]
    strand: Strand
    limits: Limits
    strength: float
    judges: tuple[MatrixPeaks, ...]

    __repr__ = in_brief

    @classmethod
    def of(cls, parts: Sequence[Specimen], strand: Strand | None, strength: float) -> "Worth":
        """Worth of strands in a part of one material, under one or several load cases."""
        check_number("strength", strength, at_least=0.0, at_most=1.0)
        strand = Strand() if strand is None else strand
        limits = Limits.of(parts[0].system.problem.material, strand)
        judges = tuple(MatrixPeaks(part.unreinforced) for part in parts)
        return cls(tuple(parts), strand, limits, strength, judges)

    def __call__(
        self,
        strands: Strands,
        equilibria: Sequence[Equilibrium],
        normal: FloatArray | None = None,
        counts: FloatArray | None = None,
    ) -> FloatArray:
        """Value of each piece of fibre, (s,), per mm; negative if the part is better without it.

        It is the first-order change of ``(1 - w) log(stiffness) + w log(load at first failure)``
        with the length of the piece. Parameters and errors as of `strain_worths`.
        """
        pieces = bars(strands, self.parts[0].system.problem.mesh)
        value = np.zeros(len(strands.length))
        for worth in self.strain_worths(strands, equilibria, normal, counts):
            assert worth.adjoint is not None
            value += worth.value(pieces.strain(worth.displacement), pieces.strain(worth.adjoint))
        return value

    def strain_worths(
        self,
        strands: Strands,
        equilibria: Sequence[Equilibrium],
        normal: FloatArray | None = None,
        counts: FloatArray | None = None,
    ) -> tuple[StrainWorth, ...]:
        """Find the worth of fibre by its strain in each load case; these worths add up.

        Parameters
        ----------
        equilibria : sequence of Equilibrium
            Of the part with them, under each load case.
        normal : (3,) array, optional
            Of all layers. Without it the bond between layers does not count.
        counts : (n,) array, optional
            Weight of each load case in the stiffness, 1 in all; default equal.
        """
        share = np.full(len(equilibria), 1.0 / len(equilibria)) if counts is None else counts
        axial, w = self.strand.stiffness(self.parts[0].modulus), self.strength
        pieces = bars(strands, self.parts[0].system.problem.mesh)
        length, windows = strands.length * strands.share, Windows(strands)
        strains = [pieces.strain(equilibrium.displacement) for equilibrium in equilibria]
        check_stretched(strains)
        works = [equilibrium.work for equilibrium in equilibria]
        peaks: dict[tuple[int, str], Peak] = {}
        for k, (judge, equilibrium, strain) in enumerate(
            zip(self.judges, equilibria, strains, strict=True)
        ):
            fibre = _fibre(
                pieces, windows, strain, equilibrium.displacement, self.limits.fibre / axial
            )
            of_case = judge.peaks(equilibrium.displacement, fibre, self.limits, normal)
            load = _load_share(self.parts[k], works[k])
            peaks |= {(k, name): peak.over(load) for name, peak in of_case.items()}
        failing = nearness(
            peaks, {key: equilibrium.index / equilibrium.norm for key, equilibrium in peaks.items()}
        )[1]
        worths = []
        for k, (part, equilibrium, strain) in enumerate(
            zip(self.parts, equilibria, strains, strict=True)
        ):
            case_failing = {name: failing[case, name] for case, name in failing if case == k}
            loads = [count * peaks[k, name].by_displacement for name, count in case_failing.items()]
            adjoint = _respond(part, equilibrium, np.sum(loads, axis=0))
            # The load grows with the stiffness where supports move.
            stiff = (1.0 - w) * share[k] + w * (0.0 if part.forced else sum(case_failing.values()))
            most = max(float(strain.max(initial=0.0)), _NONE)
            whole = float(length @ (np.maximum(strain, 0.0) / most) ** POWER)
            peak = w * case_failing.get("fibre", 0.0) / (POWER * max(whole, _NONE))
            squared = float(stiff) * axial / works[k]
            worths.append(
                StrainWorth(squared, equilibrium.displacement, w * axial, adjoint, peak, most)
            )
        return tuple(worths)


def _load_share(part: Specimen, work: float) -> float:
    """Load over that of the part without fibre: 1 where forces load it."""
    if part.forced:
        return 1.0
    return work / (2.0 * part.unreinforced.strain_energy)


def _respond(part: Specimen, equilibrium: Equilibrium, load: FloatArray) -> FloatArray:
    """Displacement (n, 3) under nodal forces (n, 3) of a part with its fibre, supports at rest."""
    held = part.held.touching(equilibrium.displacement)
    matrix = part.solver.matrix if held.presses is None else held.reduce(part.matrix)
    reduced = Reduced(matrix, equilibrium.matrix, held)
    solved = preconditioned_cg(reduced, held.project(load), part.solver, tolerance=_TOLERANCE)
    return np.asarray(held.motion(solved.values))


def _fibre(
    pieces: Bars, windows: Windows, strain: FloatArray, displacement: FloatArray, limit: float
) -> Peak | None:
    """Index of the fibre; none where no fibre is stretched."""
    if not strain.max(initial=0.0) > 0.0:
        return None
    length = windows.strands.length * windows.strands.share
    peak, _ = windows.highest(np.maximum(strain, 0.0))
    index, norm, counted = stretched_index(strain, length, peak, limit)
    squared = np.where(strain > 0.0, strain, 1.0) ** 2 * pieces.length
    return Peak(index, norm, pieces.forces(counted / squared, displacement))
