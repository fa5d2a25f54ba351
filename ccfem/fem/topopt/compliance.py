"""Compliance of a part with a factor on the stiffness of its cells, solved again and again."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Problem, Solver
from ccfem.fem.elasticity.recovery import cell_strain
from ccfem.fem.elasticity.solvers import LARGEST_DIRECT, choose_direct, direct_backend
from ccfem.fem.elasticity.system import prepare as prepare_tets
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.plates.solve import prepare as prepare_plate

_TOLERANCE = 1e-6
"""Relative residual of a solve; contrasts of 1e9 leave no less in double precision."""


class Response(NamedTuple):
    """Response of a part to its load cases.

    Attributes
    ----------
    cases : dict of load case name to float, N mm
        Compliance under each: the work of its loads, ``f . u``.
    compliance : float, N mm
        Their weighted sum.
    energy : (g,) array, N mm
        Weighted ``u^T k u`` of each group of cells at full density.
    displacement : dict of load case name to (n, d) array, mm
    """

    cases: dict[str, float]
    compliance: float
    energy: FloatArray
    displacement: dict[str, FloatArray]


class Compliance:
    """Compliance of a plate or of a part of linear tetrahedra.

    It keeps the last factorisation and displacement: iterative backends start at the latter. A
    stiffness is that of full density in the global axes, one of each group: a (g, k, k) array, MPa,
    with k 3 for plates and 6 for tetrahedra.

    Parameters
    ----------
    problem : PlaneProblem or Problem
        With the stiffness of full density; supports at rest.
    weights : mapping of load case name to float, optional
        One non-negative weight a load case; default 1 each.
    backend : str, default "auto"
    groups : (m,) int array, optional
        Cells with the same number share their factor; default each has its own (g = m).

    Attributes
    ----------
    centres : (g, d) array, mm
    volumes : (g,) array, mm^3

    Raises
    ------
    InputError
        For weights or groups that do not fit the problem, supports that move, quadratic
        tetrahedra, and a problem that has a density already.
    """

    def __init__(
        self,
        problem: PlaneProblem | Problem,
        weights: Mapping[str, float] | None = None,
        backend: str = "auto",
        groups: IntArray | None = None,
    ) -> None:
        self.weights = _checked_weights(problem, weights)
        self._equations: PlateEquations | TetEquations = (
            PlateEquations(problem) if isinstance(problem, PlaneProblem) else TetEquations(problem)
        )
        system = self._equations.system
        if any(system.held_in(case).value.any() for case in system.forces):
            raise InputError("topology optimisation takes supports at rest: hold them at zero")
        if system.held.presses is not None:
            raise InputError(
                "topology optimisation takes supports that hold both ways; got some that only "
                "press: hold their patches, or let them slide (SlidingSupport)"
            )
        self._backend = self._equations.backend() if backend == "auto" else backend
        self._solver: Solver | None = None
        self._displacement: dict[str, FloatArray] = {}
        volumes = self._equations.volumes
        self.cells = CellGroups.of_cells(groups, len(volumes))
        self.volumes = self.cells.sum(volumes)
        self.centres = self.cells.mean(self._equations.centres, volumes)

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Response:
        """Response with factors (g,) in (0, 1], and where given with another stiffness."""
        equations, member = self._equations, self.cells.member
        elements = equations.elements(None if stiffness is None else stiffness[member])
        self._displacements(equations.assemble(factor[member], elements))
        cases, energy = {}, np.zeros(len(member))
        for case, displacement in self._displacement.items():
            forces = equations.system.forces[case]
            cases[case] = float(np.einsum("ij,ij->", forces, displacement))
            energy += self.weights[case] * equations.energy(displacement, elements)
        compliance = sum(self.weights[case] * work for case, work in cases.items())
        return Response(cases, compliance, self.cells.sum(energy), dict(self._displacement))

    def _displacements(self, matrix: sp.bsr_array) -> None:
        """Find the displacement of every load case."""
        system = self._equations.system
        held = system.held
        if self._solver is None:
            self._solver = system.factorise(matrix, self._backend, len(system.forces))
        else:
            self._solver = self._solver.refactorise(held.reduce(matrix))
        for case, forces in system.forces.items():
            before = self._displacement.get(case)
            start = None if before is None else held.restrict(before)
            solution = self._solver.solve(held.right_hand_side(matrix, forces), start, _TOLERANCE)
            self._displacement[case] = held.expand(solution.values)

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` of each group, (g,), N mm, at a displacement (n, d)."""
        elements = self._equations.elements(stiffness[self.cells.member])
        return self.cells.sum(self._equations.energy(displacement, elements))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Mean stress [s11, s22, s12] of each group in the x-y plane, (g, 3), MPa."""
        stress = self._equations.stress(displacement, stiffness[self.cells.member])
        return self.cells.mean(stress, self._equations.volumes)


def _checked_weights(
    problem: PlaneProblem | Problem, weights: Mapping[str, float] | None
) -> dict[str, float]:
    chosen = dict.fromkeys(problem.loads, 1.0) if weights is None else dict(weights)
    if set(chosen) != set(problem.loads) or not all(0.0 <= w < np.inf for w in chosen.values()):
        raise InputError(
            f"weights must be one number >= 0 for each load case ({', '.join(problem.loads)}); "
            f"got {chosen}"
        )
    if not any(chosen.values()):
        raise InputError("all weights of load cases are zero: give one a weight")
    return chosen


# Stiffness equations of plates and of tetrahedra, assembled again for other stiffnesses.


class PlateEquations:
    """Equations of a plate; its elements are element matrices, one for all where all are equal."""

    def __init__(self, problem: PlaneProblem) -> None:
        self.system = prepare_plate(problem)
        self.centres, self.volumes = problem.mesh.centres, problem.volumes
        matrices = self.system.matrices
        self._full = matrices[:1] if (matrices == matrices[:1]).all() else matrices

    def backend(self) -> str:
        """Name the backend for many solves."""
        return choose_direct(self.system.held.reduce(self.system.assemble()), renewed=True)

    def elements(self, stiffness: FloatArray | None) -> FloatArray:
        """Element matrices (m, 2q, 2q) or (1, 2q, 2q), N/mm, of a stiffness (m, 3, 3)."""
        return self._full if stiffness is None else self.system.matrices_of(stiffness)

    def assemble(self, factor: FloatArray, elements: FloatArray) -> sp.bsr_array:
        """Stiffness matrix (2n, 2n), N/mm, with a factor (m,) on each element."""
        return self.system.assemble(factor[:, None, None] * elements)

    def energy(self, displacement: FloatArray, elements: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` (m,), N mm, of each element."""
        by_cell = self.system.elements.cell_displacement(displacement)
        single = len(elements) == 1
        image = by_cell @ elements[0] if single else np.einsum("mij,mj->mi", elements, by_cell)
        return np.einsum("mi,mi->m", by_cell, image)

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] at the centre of each cell."""
        strain = self.system.elements.centre_strain(displacement)
        return np.einsum("mij,mj->mi", stiffness, strain)


class TetEquations:
    """Equations of linear tetrahedra; elements are the stiffness, (6, 6) or (m, 6, 6), MPa."""

    def __init__(self, problem: Problem) -> None:
        if problem.mesh.order != 1:
            raise InputError("topology optimisation takes linear tetrahedra; got quadratic ones")
        if problem.density is not None:
            raise InputError(
                "the problem has a density already: give it as `start`, or fold it into stiffness"
            )
        self.system = prepare_tets(problem)
        self.centres = problem.mesh.centres
        self.volumes = problem.mesh.volumes

    def backend(self) -> str:
        """Name the backend for many solves of parts with voids, for which multigrid is slow."""
        best, unknowns = direct_backend(), 3 * len(self.system.held.nodes)
        return best if best != "superlu" and unknowns <= LARGEST_DIRECT else "auto"

    def elements(self, stiffness: FloatArray | None) -> FloatArray:
        """Return the stiffness, by default that of the problem."""
        return self.system.stiffness if stiffness is None else stiffness

    def assemble(self, factor: FloatArray, elements: FloatArray) -> sp.bsr_array:
        """Stiffness matrix (3n, 3n), N/mm, with a factor (m,) on the stiffness of each cell."""
        return self.system.assemble(elements, factor)

    def energy(self, displacement: FloatArray, elements: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` (m,), N mm, of each cell."""
        strain = cell_strain(self.system.problem.mesh, displacement)
        return self.volumes * np.einsum("mi,mi->m", strain, _times(elements, strain))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] of each cell in the x-y plane."""
        strain = cell_strain(self.system.problem.mesh, displacement)
        return _times(stiffness[..., [0, 1, 5], :], strain)


def _times(stiffness: FloatArray, strain: FloatArray) -> FloatArray:
    """Stress (m, k) of strain (m, 6) with one stiffness (k, 6), or one a cell (m, k, 6)."""
    if stiffness.ndim == 2:
        return strain @ stiffness.T
    return np.einsum("mki,mi->mk", stiffness, strain)


# Groups of cells that share their variables, such as the columns of a plate of tetrahedra.


EntryT = TypeVar("EntryT", bound=np.generic)


@dataclass(frozen=True)
class CellGroups:
    """Groups of cells, numbered from 0: of each cell (m,), and a first cell of each group (g,)."""

    member: IntArray
    first: IntArray

    @classmethod
    def of_cells(cls, groups: ArrayLike | None, m: int) -> "CellGroups":
        """Gather m cells by their number, which may be any; None leaves each by itself."""
        given = np.arange(m) if groups is None else np.asarray(groups)
        if given.shape != (m,) or not np.issubdtype(given.dtype, np.integer):
            raise InputError(f"groups must be {m} integers, one a cell; got shape {given.shape}")
        _, first, member = np.unique(given, return_index=True, return_inverse=True)
        return cls(member.reshape(-1), first)

    def sum(self, values: FloatArray) -> FloatArray:
        """Sum values (m,) of the cells over each group, (g,)."""
        return np.bincount(self.member, values).astype(np.float64)

    def mean(self, values: FloatArray, volumes: FloatArray) -> FloatArray:
        """Mean of values (m, k) of the cells over each group by volume, (g, k)."""
        if len(self.first) == len(self.member):
            return values[self.first]
        sums = [self.sum(volumes * column) for column in values.T]
        return np.stack(sums, axis=1) / self.sum(volumes)[:, None]

    def reduced(self, name: str, values: NDArray[EntryT]) -> NDArray[EntryT]:
        """Values (g,) of the groups from values (m,) of the cells, which are named in errors."""
        values = np.asarray(values)
        if values.shape != self.member.shape:
            raise InputError(
                f"{name} must have shape {self.member.shape}, one entry a cell; got {values.shape}"
            )
        reduced = values[self.first]
        if (reduced[self.member] != values).any():
            raise InputError(
                f"{name} must be the same in all cells of a group: give each group one value"
            )
        return reduced
