"""Design of stream functions for stiffness and the load at first failure together.

As `ccfem.strategies.fibre_aware.stream_design`, but the objective also contains how near the part
is to its first failure (`ccfem.judging.virtual_testing.near_failure`), under one load case or under
any of several, one at a time. At every evaluation an adjoint solve for each case gives the
gradient.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, in_brief
from ccfem.base.tensor import to_voigt
from ccfem.fem.elasticity.loads import strain_forces
from ccfem.fem.elasticity.zone import ball_averages
from ccfem.judging.virtual_testing import Strand
from ccfem.judging.virtual_testing.near_failure import (
    POWER,
    MatrixPeaks,
    Peak,
    check_stretched,
    nearness,
    stretched_index,
)
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.judging.virtual_testing.strands import AVERAGING_LENGTH
from ccfem.strategies.fibre_aware.border_levels import BorderLevels
from ccfem.strategies.fibre_aware.field_descent import drawn_to_borders
from ccfem.strategies.fibre_aware.smeared import SmearedSolution
from ccfem.strategies.fibre_aware.stream_design import (
    SLACK,
    Objective,
    Pull,
    SmearedFibre,
    StreamDesign,
    StreamProblem,
)

_TOLERANCE = 1e-3
"""Relative residual of the adjoint solve."""

_NONE = 1e-300
"""Share or length used in place of zero: a field without layers is divided by it."""


@dataclass(frozen=True)
class _CasePeaks:
    """Indices under one load case, and the weight (f, m) of each field's fibre in the fibre index.

    Where no fibre is stretched there is no such index, and `counted` is zero.
    """

    peaks: dict[str, Peak]
    stretch: FloatArray
    counted: FloatArray


@dataclass(frozen=True)
class StrengthProblem:
    """Objective of a stream function where strength counts.

    It is that of `StreamProblem`, with ``w log(nearness to failure) + (1 - w) x`` in place of its
    stiffness term x. The nearness to failure is the largest index of all load cases.

    Attributes
    ----------
    strength : float in [0, 1]
        The share w.
    judges : tuple of MatrixPeaks
        One for each load case.
    factors : mapping of (int, str) to float
        Index over norm of fibre, matrix and further laws in each case, by `at`.
    """

    problem: StreamProblem
    limits: Limits
    strength: float
    judges: tuple[MatrixPeaks, ...]
    factors: dict[tuple[int, str], float]

    __repr__ = in_brief

    @classmethod
    def at(
        cls,
        problem: StreamProblem,
        limits: Limits,
        strength: float,
        field: FloatArray,
        solutions: tuple[SmearedSolution, ...],
    ) -> "StrengthProblem":
        """Problem whose indices are exact at given fields, and follow their norms from there."""
        judges = tuple(MatrixPeaks(part.specimen.unreinforced) for part in problem.parts)
        bare = cls(problem, limits, strength, judges, {})
        peaks = bare._peaks(problem.smeared(field), solutions)
        check_stretched([one.stretch for one in peaks])
        factors = {
            (k, name): peak.index / peak.norm
            for k, one in enumerate(peaks)
            for name, peak in one.peaks.items()
        }
        return replace(bare, factors=factors)

    @property
    def laplacian(self) -> Any:
        """Graph Laplacian of all fields."""
        return self.problem.laplacian

    def prepared(
        self, field: FloatArray, solutions: Sequence[SmearedSolution] | None = None
    ) -> "StrengthProblem":
        """Return the problem prepared for fields near to these, as `StreamProblem.prepared`."""
        return replace(self, problem=self.problem.prepared(field, solutions))

    def evaluate(
        self,
        field: FloatArray,
        start: tuple[SmearedSolution, ...] | None = None,
        tolerance: float = 1e-5,
    ) -> Objective:
        """Evaluate the objective and its gradient; parameters as in `StreamProblem.evaluate`."""
        problem, w = self.problem, self.strength
        smeared = problem.smeared(field)
        solutions = problem.solve(smeared, start, tolerance)
        near, nearer = self._near(smeared, solutions)
        soft, counts = problem.worth(problem.ratios(solutions))
        softer = problem.pulls(smeared, solutions, counts)
        pulls = [
            (w * a[0] + (1.0 - w) * b[0], w * a[1] + (1.0 - w) * b[1])
            for a, b in zip(nearer, softer, strict=True)
        ]
        return problem.objective(field, smeared, solutions, w * near + (1.0 - w) * soft, pulls)

    def curvature(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> Any:
        """Curvature of the stiffness alone."""
        return self.problem.curvature(field, solutions)

    def levels(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> BorderLevels:
        """Cost of levels that lie farther from the border than they need to."""
        return self.problem.levels(field, solutions)

    def _peaks(
        self, smeared: tuple[SmearedFibre, ...], solutions: tuple[SmearedSolution, ...]
    ) -> list[_CasePeaks]:
        """Find the indices under each load case, for the load on the part without fibre."""
        problem, alone = self.problem, self.problem.model
        limit = self.limits.fibre / alone.axial_stiffness
        size = np.stack([one.size for one in smeared])
        length = (problem.shares[:, None] * alone.room * size).ravel()
        case_peaks = []
        for part, judge, solution in zip(problem.parts, self.judges, solutions, strict=True):
            stretch = np.stack(
                [np.einsum("ci,ci->c", one.along, solution.strain) for one in smeared]
            )
            fibre, counted = None, np.zeros_like(stretch)
            if stretch.max() > 0.0:
                strain = (stretch / size**2).ravel()
                peak = self._highest(stretch / size**2, length.reshape(size.shape))
                index, norm, share = stretched_index(strain, length, peak, limit)
                counted = share.reshape(stretch.shape)
                by_stretch = counted / np.where(stretch > 0.0, stretch, 1.0)
                along = np.stack([one.along for one in smeared])
                forces = self._forces(np.einsum("fc,fci->ci", by_stretch, along))
                fibre = Peak(index, norm, forces)
            normal = part.axes.normal
            peaks = judge.peaks(solution.displacement, fibre, self.limits, normal)
            # For the same load, which falls with the stiffness where supports move.
            load = 1.0 if part.forced else part.ratio(solution.work)
            scaled = {name: peak.over(load) for name, peak in peaks.items()}
            case_peaks.append(_CasePeaks(scaled, stretch, counted))
        return case_peaks

    def _highest(self, strain: FloatArray, length: FloatArray) -> float:
        """Highest strain of all fields (f, m), averaged over as much fibre as that of strands."""
        mesh, radius = self.problem.parts[0].specimen.unreinforced.mesh, 0.5 * AVERAGING_LENGTH
        cells = np.arange(len(mesh.cells))
        return max(
            float(ball_averages(mesh.centres, of_field[:, None], weight, cells, radius).max())
            for of_field, weight in zip(strain, np.maximum(length, _NONE), strict=True)
        )

    def _forces(self, by_strain: FloatArray) -> FloatArray:
        """Turn a derivative by the strains (m, 3) in the plane into one by the displacement."""
        part = self.problem.model.part
        a, b = part.frame[..., 0, :, None], part.frame[..., 1, :, None]
        pairs = np.stack([a * a.mT, b * b.mT, a * b.mT + b * a.mT], axis=-3)
        density = by_strain / part.mesh.volumes[:, None]
        tensor = np.einsum("ci,cijk->cjk" if part.axes.curved else "ci,ijk->cjk", density, pairs)
        return strain_forces(part.mesh, to_voigt(tensor))

    def _near(
        self, smeared: tuple[SmearedFibre, ...], solutions: tuple[SmearedSolution, ...]
    ) -> tuple[float, list[Pull]]:
        """Logarithm of the index that fails first, and its derivatives by each field's slope."""
        problem = self.problem
        case_peaks = self._peaks(smeared, solutions)
        peaks = {(k, name): p for k, one in enumerate(case_peaks) for name, p in one.peaks.items()}
        near, counts = nearness(peaks, self.factors)
        pulls = [(np.zeros(len(one.size)), np.zeros(len(one.size))) for one in smeared]
        cases = zip(problem.parts, case_peaks, solutions, strict=True)
        for k, (part, one, solution) in enumerate(cases):
            failing = {name: counts[k, name] for name in one.peaks}
            load = sum(count * one.peaks[name].by_displacement for name, count in failing.items())
            stiffness = problem.stiffness(smeared, solution.strain)
            adjoint = part.respond(stiffness, np.asarray(load), _TOLERANCE)
            fibre_factor = failing.get("fibre", 0.0) * one.counted
            moved = 0.0 if part.forced else sum(failing.values())
            for f, fibre in enumerate(smeared):
                share = max(float(problem.shares[f]), _NONE)
                dx, dy = self._nearer(fibre, solution.strain, adjoint, fibre_factor[f] / share)
                if moved:
                    softer = problem.model.pull(fibre, solution)
                    dx, dy = dx + moved * softer[0], dy + moved * softer[1]
                pulls[f] = (pulls[f][0] + dx, pulls[f][1] + dy)
        return near, pulls

    def _nearer(
        self, smeared: SmearedFibre, strain: FloatArray, adjoint: FloatArray, nearness: FloatArray
    ) -> Pull:
        """Derive the logarithm of the indices of one case by the slope of one field.

        Parameters
        ----------
        smeared : SmearedFibre
            Its fibre, in all layers.
        strain, adjoint : (m, 3) array
            Of the part with its fibre, and of the adjoint solution.
        nearness : (m,) array
            Weight of the fibre of each cell in the index of the fibre itself.
        """
        alone = self.problem.model
        stretch, other = (np.einsum("ci,ci->c", smeared.along, one) for one in (strain, adjoint))
        gx, gy, size = smeared.gx, smeared.gy, smeared.size
        share = np.where(stretch > 0.0, 1.0, SLACK)
        # The work of fibre between both displacements is stretch * other / size^3.
        factor = -alone.axial_stiffness * alone.room * share / size**3
        fall = 3.0 * stretch * other / size**2
        # The fibre norm to its power is room * stretch^p / size^(2 p - 1) a cell.
        power = nearness / np.where(stretch > 0.0, stretch, 1.0)
        thin = (2.0 - 1.0 / POWER) * nearness / size**2
        (ux, uy), (ax, ay) = _turned(smeared, strain), _turned(smeared, adjoint)
        dx = factor * (ux * other + ax * stretch - fall * gx) + power * ux - thin * gx
        dy = factor * (uy * other + ay * stretch - fall * gy) + power * uy - thin * gy
        return dx, dy


def _turned(smeared: SmearedFibre, strain: FloatArray) -> Pull:
    """Derive the stretch by the components of g: (m,) each."""
    e1, e2, e12 = strain.T
    return 2.0 * smeared.gx * e2 - smeared.gy * e12, 2.0 * smeared.gy * e1 - smeared.gx * e12


def design_for_strength(
    problem: StreamProblem,
    field: FloatArray,
    solutions: tuple[SmearedSolution, ...],
    strength: float,
    evaluations: int = 50,
) -> StreamDesign:
    """Improve a design for stiffness with regard to the load at first failure too.

    Parameters
    ----------
    field : (n * c,) array
        Designed for stiffness alone, field after field.
    solutions : tuple of SmearedSolution
        Of each case at that.
    strength : float in [0, 1]
        Weight of the load at first failure; the stiffness has the rest.
    evaluations : int, default 50
        Evaluations of stiffness and strength, at least 1.

    Raises
    ------
    InputError
        When the strength of the matrix is not known, or no fibre is stretched.
    """
    limits = Limits.of(problem.parts[0].specimen.system.problem.material, Strand())
    whole = StrengthProblem.at(problem, limits, strength, field, solutions)
    field, objective, ratios = drawn_to_borders(whole, field, solutions, evaluations)
    return StreamDesign(field.reshape(len(problem.shares), -1), objective, tuple(ratios))
