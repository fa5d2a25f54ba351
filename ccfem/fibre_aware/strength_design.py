"""Design of stream functions for stiffness and the load at first failure together.

As `ccfem.fibre_aware.stream_design`, with a share of the objective in how near the part is to its
first failure (`ccfem.virtual_testing.near_failure`). An adjoint solve at every evaluation gives the
gradient.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.arrays import FloatArray, in_brief
from ccfem.elasticity.volume_loads import strain_forces
from ccfem.fibre_aware.border_levels import BorderLevels
from ccfem.fibre_aware.field_design import drawn_to_borders
from ccfem.fibre_aware.smeared import SmearedSolution
from ccfem.fibre_aware.stream_design import (
    OVER_BUDGET,
    SLACK,
    Laid,
    Objective,
    StreamDesign,
    StreamProblem,
)
from ccfem.tensor import to_voigt
from ccfem.virtual_testing.near_failure import (
    POWER,
    MatrixPeaks,
    Peak,
    nearness,
    stretched_index,
)
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strengths import Limits

__all__ = ["StrengthProblem", "design_for_strength"]

_TOLERANCE = 1e-3
"""Relative residual of the adjoint solve."""


@dataclass(frozen=True)
class StrengthProblem:
    """What a stream function is designed for where strength counts.

    Minimised is what `StreamProblem` minimises, with ``w log(nearness to failure) - (1 - w)
    log(stiffness)`` in place of ``-log(stiffness)``.

    Attributes
    ----------
    problem : StreamProblem
    limits : Limits
    strength : float in [0, 1]
        The share w.
    judge : MatrixPeaks
    factors : mapping of str to float
        Index over norm of fibre, matrix and bond, from `factors_at`.
    """

    problem: StreamProblem
    limits: Limits
    strength: float
    judge: MatrixPeaks
    factors: dict[str, float]

    __repr__ = in_brief

    @classmethod
    def at(
        cls,
        problem: StreamProblem,
        limits: Limits,
        strength: float,
        field: FloatArray,
        solution: SmearedSolution,
    ) -> "StrengthProblem":
        """Problem whose indices are the true ones at a field, and follow their norms from there."""
        judge = MatrixPeaks(problem.part.specimen.unreinforced)
        bare = cls(problem, limits, strength, judge, {})
        peaks = bare._peaks(problem.laid(field), solution)[0]
        return cls(
            problem, limits, strength, judge, {k: one.index / one.norm for k, one in peaks.items()}
        )

    @property
    def laplacian(self) -> Any:
        """Graph Laplacian (c, c) of all fields."""
        return self.problem.laplacian

    def evaluate(
        self, field: FloatArray, start: SmearedSolution | None = None, tolerance: float = 1e-5
    ) -> Objective:
        """Evaluate the objective and its gradient; parameters as in `StreamProblem.evaluate`."""
        problem, w = self.problem, self.strength
        laid = problem.laid(field)
        solution = problem.part.solve(laid.stiffness, start, tolerance)
        ratio, length = problem.part.ratio(solution.work), problem.length(laid)
        over = max(length / problem.budget - 1.0, 0.0)
        near, nearer = self._near(laid, solution)
        softer = problem.pull(laid, solution)
        if not problem.part.forced:  # the load falls with the stiffness where supports move
            near -= np.log(ratio)
            nearer = (nearer[0] + softer[0], nearer[1] + softer[1])
        value = w * near - (1.0 - w) * np.log(ratio) + OVER_BUDGET * over**2
        value += sum(problem.penalties(field, laid))
        x, y = (w * a + (1.0 - w) * b for a, b in zip(nearer, softer, strict=True))
        gradient = problem.gradient(field, laid, (x, y), over)
        return Objective(float(value), gradient, ratio, length, solution)

    def curvature(self, field: FloatArray, solution: SmearedSolution) -> Any:
        """Curvature (c, c) of the stiffness alone."""
        return self.problem.curvature(field, solution)

    def levels(self, field: FloatArray, solution: SmearedSolution) -> BorderLevels:
        """Weigh what levels cost that keep farther from borders than they need."""
        return self.problem.levels(field, solution)

    def _peaks(
        self, laid: Laid, solution: SmearedSolution
    ) -> tuple[dict[str, Peak], FloatArray, FloatArray]:
        """All indices, how much each cell counts in the norm of the fibre, and its stretch."""
        problem = self.problem
        stretch = np.einsum("ci,ci->c", laid.along, solution.strain)
        limit = self.limits.fibre / problem.axial_stiffness
        length = problem.room * laid.size
        index, norm, counted = stretched_index(stretch / laid.size**2, length, limit)
        by_stretch = counted / np.where(stretch > 0.0, stretch, 1.0)
        fibre = Peak(index, norm, self._forces(by_stretch[:, None] * laid.along))
        normal = problem.part.frame[2]
        peaks = self.judge.peaks(solution.displacement, fibre, self.limits, normal)
        return peaks, counted, stretch

    def _forces(self, by_strain: FloatArray) -> FloatArray:
        """Turn a derivative by the strains (m, 3) in the plane into one by the displacement."""
        part = self.problem.part
        a, b, _ = part.frame
        pairs = np.stack([np.outer(a, a), np.outer(b, b), np.outer(a, b) + np.outer(b, a)])
        tensor = np.einsum("ci,ijk->cjk", by_strain / part.mesh.volumes[:, None], pairs)
        return strain_forces(part.mesh, to_voigt(tensor))

    def _near(
        self, laid: Laid, solution: SmearedSolution
    ) -> tuple[float, tuple[FloatArray, FloatArray]]:
        """Logarithm of the index that fails first, and its derivatives by the components of g."""
        problem = self.problem
        peaks, counted, stretch = self._peaks(laid, solution)
        near, counts = nearness(peaks, self.factors)
        load = np.sum([counts[name] * one.by_displacement for name, one in peaks.items()], axis=0)
        stiffness = laid.stiffness(solution.strain)
        adjoint = problem.part.respond(stiffness, load, _TOLERANCE)
        other = np.einsum("ci,ci->c", laid.along, adjoint)
        gx, gy, size = laid.gx, laid.gy, laid.size
        share = np.where(stretch > 0.0, 1.0, SLACK)
        # Fibre takes the work stretch * other / size^3 of both displacements in each other.
        factor = -problem.axial_stiffness * problem.room * share / size**3
        fall = 3.0 * stretch * other / size**2
        # Its norm's power is room * stretch^p / size^(2 p - 1) a cell.
        own = counts["fibre"] * counted
        power = own / np.where(stretch > 0.0, stretch, 1.0)
        thin = (2.0 - 1.0 / POWER) * own / size**2
        (ux, uy), (ax, ay) = _turned(laid, solution.strain), _turned(laid, adjoint)
        dx = factor * (ux * other + ax * stretch - fall * gx) + power * ux - thin * gx
        dy = factor * (uy * other + ay * stretch - fall * gy) + power * uy - thin * gy
        return near, (dx, dy)


def _turned(laid: Laid, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derive the stretch by the components of g: (m,) each."""
    e1, e2, e12 = strain.T
    return 2.0 * laid.gx * e2 - laid.gy * e12, 2.0 * laid.gy * e1 - laid.gx * e12


def design_for_strength(
    problem: StreamProblem, first: StreamDesign, strength: float, evaluations: int = 50
) -> StreamDesign:
    """Improve a design for stiffness, so that the load at first failure counts too.

    Parameters
    ----------
    problem : StreamProblem
    first : StreamDesign
        For stiffness alone.
    strength : float in [0, 1]
        How much a share of the load at first failure counts; one of stiffness counts the rest. At 0
        the design stays as it is.
    evaluations : int, default 50
        Of stiffness and strength, at least 1.

    Raises
    ------
    InputError
        When the strength of the matrix is not known, or no fibre is stretched.
    """
    if not strength:
        return first
    limits = Limits.of(problem.part.specimen.system.problem.material, Strand())
    start = first.field
    whole = StrengthProblem.at(problem, limits, strength, start, first.objective.solution)
    field, found, ratios = drawn_to_borders(whole, start, first.objective.solution, evaluations)
    return StreamDesign(field, found, (*first.ratios, *ratios))
