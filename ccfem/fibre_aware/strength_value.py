"""What fibre is worth for the stiffness and for the load at first failure together.

One adjoint solve, with the derivative of the indices by the displacement as its load, says what
every piece of fibre changes: ``-EA eps eps_adjoint`` per length, and what it itself adds to the
index of the fibre (`ccfem.virtual_testing.near_failure`).
"""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, in_brief
from ccfem.checks import check_number
from ccfem.elasticity.solvers import preconditioned_cg
from ccfem.errors import InputError
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.bars import Bars, bars
from ccfem.virtual_testing.equilibrium import Equilibrium
from ccfem.virtual_testing.near_failure import (
    POWER,
    MatrixPeaks,
    Peak,
    nearness,
    stretched_index,
)
from ccfem.virtual_testing.reinforced import Reduced
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import Strands
from ccfem.virtual_testing.strengths import Limits

__all__ = ["Worth", "layer_normal", "raised", "refuse_strength"]

_LITTLE = 1e-3
"""Share of the largest value below which values that are negative are raised."""

_TOLERANCE = 1e-4
"""Relative residual of the adjoint solve."""


def layer_normal(toolpaths: Toolpaths) -> FloatArray | None:
    """Find the normal (3,) of the layers of all paths; None where they do not share one."""
    normals = toolpaths.normals
    return (
        normals[0] if len(normals) and (np.abs(normals @ normals[0]) > 1.0 - 1e-9).all() else None
    )


def refuse_strength(strategy: str, strength: float) -> None:
    """Say that strength is planned for under one load case only.

    Raises
    ------
    InputError
        Where `strength` is not zero.
    """
    if strength:
        raise InputError(
            f"{strategy} plans for strength under one load case; got strength = {strength:g} and "
            "several cases: name one of them, or set strength = 0"
        )


def raised(value: FloatArray) -> FloatArray:
    """Values (s,) in the same order, none below zero: as long a part of all as wanted can be kept.

    Negative ones come to lie between zero and the least that counts.
    """
    most, least = float(value.max(initial=0.0)), float(value.min(initial=0.0))
    if not least < 0.0:
        return value
    little = _LITTLE * most
    return np.where(value > 0.0, little + (1.0 - _LITTLE) * value, little * (1.0 - value / least))


@dataclass(frozen=True)
class Worth:
    """What fibre in a part is worth, for any number of sets of paths.

    Attributes
    ----------
    specimen : Specimen
    strand : Strand
    limits : Limits
    strength : float in [0, 1]
        How much a share of the load at first failure counts; a share of stiffness counts the rest.
    judge : MatrixPeaks
    """

    specimen: Specimen
    strand: Strand
    limits: Limits
    strength: float
    judge: MatrixPeaks

    __repr__ = in_brief

    @classmethod
    def of(cls, specimen: Specimen, strand: Strand | None, strength: float) -> "Worth":
        """Worth of strands in a part of one material.

        Raises
        ------
        InputError
            When `strength` is outside [0, 1], or the strength of matrix or fibre is missing.
        """
        check_number("strength", strength, at_least=0.0, at_most=1.0)
        strand = Strand() if strand is None else strand
        limits = Limits.of(specimen.system.problem.material, strand)
        return cls(specimen, strand, limits, strength, MatrixPeaks(specimen.unreinforced))

    def __call__(
        self, strands: Strands, found: Equilibrium, normal: FloatArray | None = None
    ) -> FloatArray:
        """Value of each piece of fibre, (s,), per mm; negative where the part is better without.

        It is the first-order change of ``(1 - w) log(stiffness) + w log(load at first failure)``
        with the length of the piece.

        Parameters
        ----------
        strands : Strands
        found : Equilibrium
            Of the part with them.
        normal : (3,) array, optional
            Of all layers. Without it the bond between layers does not count.
        """
        specimen, u = self.specimen, found.displacement
        axial = self.strand.stiffness(specimen.modulus)
        pieces = bars(strands, specimen.system.problem.mesh)
        limit = self.limits.fibre / axial
        fibre, own = _fibre(pieces, strands.length * strands.share, u, limit)
        peaks = self.judge.peaks(u, fibre, self.limits, normal)
        factors = {name: one.index / one.norm for name, one in peaks.items()}
        counts = nearness(peaks, factors)[1]
        load = np.sum([counts[name] * one.by_displacement for name, one in peaks.items()], axis=0)
        held = specimen.held.touching(u)
        part = specimen.solver.matrix if held.presses is None else held.reduce(specimen.matrix)
        reduced = Reduced(part, found.matrix, held)
        solved = preconditioned_cg(
            reduced, held.project(load), specimen.solver, tolerance=_TOLERANCE
        )
        adjoint = pieces.strain(held.motion(solved.values))
        work = float(np.vdot(u, (found.matrix @ u.reshape(-1)).reshape(u.shape)))
        stiff = np.where(found.carries, axial * found.strain**2, 0.0) / work
        strong = np.where(found.carries, axial * found.strain * adjoint, 0.0)
        strong -= counts["fibre"] * own
        if specimen.held.value.any():  # the load grows with the stiffness where supports move
            strong += stiff
        return np.asarray((1.0 - self.strength) * stiff + self.strength * strong)


def _fibre(
    pieces: Bars, length: FloatArray, displacement: FloatArray, limit: float
) -> tuple[Peak, FloatArray]:
    """Index of the fibre, and the derivative (s,) of its norm's logarithm by the length."""
    strain = pieces.strain(displacement)
    index, norm, counted = stretched_index(strain, length, limit)
    squared = np.where(strain > 0.0, strain, 1.0) ** 2 * pieces.length
    forces = pieces.forces(counted / squared, displacement)
    own = np.divide(counted, POWER * length, out=np.zeros_like(counted), where=length > 0.0)
    return Peak(index, norm, forces), own
