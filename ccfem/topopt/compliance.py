"""Compliance of a part with a density per cell, and the energies behind its sensitivities."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.assembly import assemble
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.recovery import cell_strain
from ccfem.elasticity.solve import System, prepare
from ccfem.elasticity.solvers import LARGEST_DIRECT, Solver, choose_direct, direct_backend
from ccfem.errors import InputError
from ccfem.plates.problem import PlaneProblem
from ccfem.plates.solve import PlaneSystem
from ccfem.plates.solve import prepare as prepare_plane

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
    _solver: Solver | None = None
    _before: dict[str, FloatArray] = field(default_factory=dict)

    def _factorised(self, matrix: sp.bsr_array) -> Solver:
        if self._solver is None:
            self._solver = self.system.factorise(matrix, self.backend, len(self.system.forces))
        else:
            self._solver = self._solver.refactorise(self.system.held.reduce(matrix))
        return self._solver

    def solved(self, matrix: sp.bsr_array) -> dict[str, FloatArray]:
        """Displacement of every load case; iterative backends start at the one before."""
        held = self.system.held
        solver = self._factorised(matrix)
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
        if backend == "auto":
            first = self.system.held.reduce(self.system.assemble())
            backend = choose_direct(first, renewed=True)
        self._answer = _Answer(self.system, weights, backend)
        self.centres = problem.mesh.centres
        self.volumes = problem.mesh.areas * problem.thickness

    @cached_property
    def _full(self) -> FloatArray:
        """Element matrices at full density: one where all are equal, else one a cell."""
        matrices = self.system.matrices
        return matrices[:1] if (matrices == matrices[:1]).all() else matrices

    def _matrices(self, stiffness: FloatArray) -> FloatArray:
        """Element matrices (m, 2q, 2q), N/mm, of a stiffness (m, 3, 3)."""
        thickness = np.asarray(self.system.problem.thickness)[:, None, None]
        return thickness * self.system.elements.matrices(stiffness)

    def _energy(self, displacement: FloatArray, matrices: FloatArray) -> FloatArray:
        own = self.system.elements.cell_displacement(displacement)
        one = len(matrices) == 1
        image = own @ matrices[0] if one else np.einsum("mij,mj->mi", matrices, own)
        return np.einsum("mi,mi->m", own, image)

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell.

        Parameters
        ----------
        factor : (m,) array in (0, 1]
        stiffness : (m, 3, 3) array, MPa, optional
            Of full density, where it is not the problem's.
        """
        full = self._full if stiffness is None else self._matrices(stiffness)
        matrix = self.system.assemble(factor[:, None, None] * full)
        energies = {
            case: self._energy(displacement, full)
            for case, displacement in self._answer.solved(matrix).items()
        }
        return self._answer.loaded(energies)

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` (m,), N mm, of a displacement (n, 2) and a stiffness (m, 3, 3)."""
        return self._energy(displacement, self._matrices(stiffness))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] at the centre of each cell."""
        strain = self.system.elements.centre_strain(displacement)
        return np.einsum("mij,mj->mi", stiffness, strain)


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
        self.weights = weights
        if backend == "auto":
            backend = _quick(3 * len(self.system.held.nodes))
        self._answer = _Answer(self.system, weights, backend)
        self.centres = problem.mesh.points[problem.mesh.cells].mean(axis=1)
        self.volumes = problem.mesh.volumes

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Loaded:
        """Answer with a factor (m,) on the stiffness of each cell.

        Parameters
        ----------
        factor : (m,) array in (0, 1]
        stiffness : (m, 6, 6) array, MPa, optional
            Of full density, where it is not the problem's.
        """
        full = self.system.stiffness if stiffness is None else stiffness
        matrix = assemble(self.system.problem.mesh, full, factor, self.system.where)
        energies = {
            case: self.energy(displacement, full)
            for case, displacement in self._answer.solved(matrix).items()
        }
        return self._answer.loaded(energies)

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` (m,), N mm, of a displacement (n, 3) and a stiffness (m, 6, 6)."""
        strain = cell_strain(self.system.problem.mesh, displacement)
        return self.volumes * np.einsum("mi,mi->m", strain, _times(stiffness, strain))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] of each cell in the x-y plane."""
        strain = cell_strain(self.system.problem.mesh, displacement)
        return _times(stiffness[..., [0, 1, 5], :], strain)


def _quick(unknowns: int) -> str:
    """Name the backend for many solves of parts with voids, which a multigrid is slow on."""
    backend = direct_backend()
    return backend if backend != "superlu" and unknowns <= LARGEST_DIRECT else "auto"


def _times(stiffness: FloatArray, strain: FloatArray) -> FloatArray:
    """Stress (m, k) of strain (m, 6) with one stiffness (k, 6), or one a cell (m, k, 6)."""
    if stiffness.ndim == 2:
        return strain @ stiffness.T
    return np.einsum("mki,mi->mk", stiffness, strain)


class GroupedCompliance:
    """Compliance of a part with one density for each group of its cells, such as a column.

    Parameters
    ----------
    model : PlaneCompliance or TetCompliance
    groups : (m,) int array
        Group of each cell, 0 to g - 1, none empty.
    """

    def __init__(self, model: PlaneCompliance | TetCompliance, groups: IntArray) -> None:
        self.model, self.groups, self.weights = model, groups, model.weights
        self.volumes: FloatArray = np.bincount(groups, model.volumes).astype(np.float64)
        sums = [np.bincount(groups, model.volumes * x) for x in model.centres.T]
        self.centres = np.stack(sums, axis=1) / self.volumes[:, None]

    def _sum(self, values: FloatArray) -> FloatArray:
        """Sum values (m,) over each group, (g,)."""
        return np.bincount(self.groups, values, len(self.volumes)).astype(np.float64)

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Loaded:
        """Answer with a factor (g,), and where given a stiffness (g, k, k), of each group.

        The energy of the answer is per group.
        """
        own = None if stiffness is None else stiffness[self.groups]
        answer = self.model(factor[self.groups], own)
        return answer._replace(energy=self._sum(answer.energy))

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy (g,), N mm, of a displacement and a stiffness (g, k, k)."""
        return self._sum(self.model.energy(displacement, stiffness[self.groups]))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Mean stress (g, 3), MPa, in the x-y plane of each group."""
        own = self.model.stress(displacement, stiffness[self.groups])
        sums = [self._sum(self.model.volumes * part) for part in own.T]
        return np.stack(sums, axis=1) / self.volumes[:, None]


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
