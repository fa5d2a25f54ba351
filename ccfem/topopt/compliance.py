"""Compliance of a part with a density per cell, and the energies behind its sensitivities."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.assembly import assemble
from ccfem.elasticity.plane import PlaneSystem, prepare_plane
from ccfem.elasticity.plane_problem import PlaneProblem
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.recovery import cell_strain
from ccfem.elasticity.solve import System, prepare
from ccfem.errors import InputError

__all__ = ["GroupedCompliance", "Loaded", "PlaneCompliance", "TetCompliance", "compliance_of"]

_TOLERANCE = 1e-6
"""Relative residual of a solve; contrasts of 1e9 leave no less in double precision."""


class Loaded(NamedTuple):
    """Answer of a part to its load cases.

    Attributes
    ----------
    cases : dict of load case name to float, N mm
        Work of the loads, ``f . u``.
    compliance : float, N mm
        The weighted sum.
    energy : (m,) array, N mm
        Weighted ``u^T k u`` of each cell at full density.
    displacement : dict of load case name to (n, d) array, mm
    """

    cases: dict[str, float]
    compliance: float
    energy: FloatArray
    displacement: dict[str, FloatArray]


@dataclass
class _Answer:
    """What both kinds of part share: the solves of one stiffness matrix."""

    system: PlaneSystem | System
    weights: Mapping[str, float]
    backend: str = "auto"
    _before: dict[str, FloatArray] = field(default_factory=dict)

    def solved(self, matrix: sp.bsr_array) -> dict[str, FloatArray]:
        """Displacement of every load case; iterative backends start at the one before."""
        held = self.system.held
        solver = self.system.factorise(matrix, self.backend, len(self.system.forces))
        for case, forces in self.system.forces.items():
            rhs = held.right_hand_side(matrix, forces)
            start = self._before.get(case)
            start = None if start is None else held.restrict(start)
            solution = solver.solve(rhs, start, _TOLERANCE)
            self._before[case] = held.expand(solution.values)
        return dict(self._before)

    def loaded(self, energies: dict[str, FloatArray]) -> Loaded:
        """Sum up, from the energies of the cells at full density."""
        energy = sum(
            (self.weights[case] * own for case, own in energies.items()),
            np.zeros_like(next(iter(energies.values()))),
        )
        cases = {
            case: float(np.einsum("ij,ij->", forces, self._before[case]))
            for case, forces in self.system.forces.items()
        }
        total = sum(self.weights[case] * work for case, work in cases.items())
        return Loaded(cases, total, energy, dict(self._before))


class PlaneCompliance:
    """Compliance of a plate.

    Parameters
    ----------
    problem : PlaneProblem
        With the stiffness of full density.
    weights : mapping of load case name to float
    backend : str, default "auto"
    """

    def __init__(
        self, problem: PlaneProblem, weights: Mapping[str, float], backend: str = "auto"
    ) -> None:
        self.system = prepare_plane(problem)
        self.weights = weights
        self._answer = _Answer(self.system, weights, backend)
        self.centres = problem.mesh.centres
        self.volumes = problem.mesh.areas * problem.thickness

    @cached_property
    def _full(self) -> FloatArray:
        """Element matrices at full density: one where all are equal, else one a cell."""
        matrices = self.system.matrices
        return matrices[:1] if (matrices == matrices[:1]).all() else matrices

    def __call__(self, factor: FloatArray, full: FloatArray | None = None) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell.

        Parameters
        ----------
        factor : (m,) array in (0, 1]
        full : (m, 2q, 2q) array, N/mm, optional
            Other element matrices of full density than the problem's.
        """
        full = self._full if full is None else full
        matrix = self.system.assemble(factor[:, None, None] * full)
        energies = {}
        for case, displacement in self._answer.solved(matrix).items():
            own = self.system.elements.cell_displacement(displacement)
            image = own @ full[0] if len(full) == 1 else np.einsum("mij,mj->mi", full, own)
            energies[case] = np.einsum("mi,mi->m", own, image)
        return self._answer.loaded(energies)


class TetCompliance:
    """Compliance of a part of linear tetrahedra.

    Parameters
    ----------
    problem : Problem
        With the stiffness of full density.
    weights : mapping of load case name to float
    backend : str, default "auto"
    """

    def __init__(
        self, problem: Problem, weights: Mapping[str, float], backend: str = "auto"
    ) -> None:
        if problem.mesh.order != 1:
            raise InputError("topology optimisation takes linear tetrahedra; got quadratic ones")
        if problem.density is not None:
            raise InputError(
                "the problem has a density already: give it as `start`, or fold it into stiffness"
            )
        self.system = prepare(problem)
        self._answer = _Answer(self.system, weights, backend)
        self.centres = problem.mesh.points[problem.mesh.cells].mean(axis=1)
        self.volumes = problem.mesh.volumes

    def __call__(self, factor: FloatArray) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell."""
        mesh, stiffness = self.system.problem.mesh, self.system.stiffness
        matrix = assemble(mesh, stiffness, factor, self.system.where)
        energies = {}
        for case, displacement in self._answer.solved(matrix).items():
            strain = cell_strain(mesh, displacement)
            energies[case] = self.volumes * np.einsum(
                "mi,...ij,mj->m" if stiffness.ndim == 2 else "mi,mij,mj->m",
                strain,
                stiffness,
                strain,
            )
        return self._answer.loaded(energies)


class GroupedCompliance:
    """Compliance of a part with one density for each group of its cells, such as a column.

    Parameters
    ----------
    model : PlaneCompliance or TetCompliance
    groups : (m,) int array
        Group of each cell, 0 to g - 1, none empty.
    """

    def __init__(self, model: PlaneCompliance | TetCompliance, groups: IntArray) -> None:
        self.model, self.groups = model, groups
        self.volumes: FloatArray = np.bincount(groups, model.volumes).astype(np.float64)
        sums = [np.bincount(groups, model.volumes * x) for x in model.centres.T]
        self.centres = np.stack(sums, axis=1) / self.volumes[:, None]

    def __call__(self, factor: FloatArray) -> Loaded:
        """Answer with a factor (g,) on the stiffness of each group; its energy is per group."""
        answer = self.model(factor[self.groups])
        energy = np.bincount(self.groups, answer.energy, len(self.volumes))
        return answer._replace(energy=energy.astype(np.float64))


def compliance_of(
    problem: PlaneProblem | Problem,
    weights: Mapping[str, float] | None = None,
    backend: str = "auto",
) -> PlaneCompliance | TetCompliance:
    """Prepare the compliance of a plate or of a part of tetrahedra.

    Parameters
    ----------
    problem : PlaneProblem or Problem
    weights : mapping of load case name to float, optional
        One non-negative weight a load case; default 1 each.
    backend : str, default "auto"

    Raises
    ------
    InputError
        For weights that do not fit the load cases, and for supports that move.
    """
    chosen = dict.fromkeys(problem.loads, 1.0) if weights is None else dict(weights)
    if set(chosen) != set(problem.loads) or not all(0.0 <= w < np.inf for w in chosen.values()):
        raise InputError(
            f"weights must be one number >= 0 for each load case ({', '.join(problem.loads)}); "
            f"got {chosen}"
        )
    if not any(chosen.values()):
        raise InputError("all weights of load cases are zero: give one a weight")
    if any(np.any(support.value) for support in problem.supports):
        raise InputError("topology optimisation takes supports at rest: hold them at zero")
    if isinstance(problem, PlaneProblem):
        return PlaneCompliance(problem, chosen, backend)
    return TetCompliance(problem, chosen, backend)
