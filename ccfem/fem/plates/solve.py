"""The solve of a thin plate: from a problem to the plane stress of every load case."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import KnownNames
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.loads import load_cases
from ccfem.fem.elasticity.solve import solve_system
from ccfem.fem.elasticity.solvers import DIRECT, Solver, choose_direct, factorise
from ccfem.fem.elasticity.stress_field import SolveRecord
from ccfem.fem.elasticity.supports import held
from ccfem.fem.plates.assembly import PlaneElements
from ccfem.fem.plates.field import PlaneField
from ccfem.fem.plates.mesh import PlaneMesh
from ccfem.fem.plates.problem import PlaneProblem


@dataclass(frozen=True)
class PlaneSystem:
    """The equations of a plate: everything that stays when only the stiffness changes.

    For many solves on one mesh keep one system and call ``system.assemble(matrices)`` with
    ``matrices = system.matrices_of(stiffness)``.

    Attributes
    ----------
    problem : PlaneProblem
    elements : PlaneElements
    held : Held
        The supports.
    forces : dict of load case name to (n, 2) array, N
    """

    problem: PlaneProblem
    elements: PlaneElements
    held: Held
    forces: dict[str, FloatArray]

    @cached_property
    def matrices(self) -> FloatArray:
        """Element matrices of the problem, (m, 2q, 2q), N/mm."""
        return self.matrices_of(self.problem.stiffness)

    def matrices_of(self, stiffness: FloatArray) -> FloatArray:
        """Element matrices (m, 2q, 2q), N/mm, of another stiffness (m, 3, 3), MPa."""
        thickness = np.asarray(self.problem.thickness)[:, None, None]
        return thickness * self.elements.matrices(stiffness)

    @property
    def combinations(self) -> dict[str, dict[str, float]]:
        """Combinations of load cases: a plate has none."""
        return {}

    def held_in(self, case: str) -> Held:
        """Return what is held in one load case: the same in all."""
        return self.held

    def forces_in(self, case: str) -> FloatArray:
        """Return the forces (n, 2), N, of one load case."""
        return self.forces[case]

    def assemble(self, matrices: FloatArray | None = None) -> sp.bsr_array:
        """Stiffness matrix (2n, 2n), N/mm, of the problem or of other element matrices."""
        return self.elements.assemble(self.matrices if matrices is None else matrices)

    def factorise(self, matrix: sp.bsr_array, backend: str = "auto", solves: int = 1) -> Solver:
        """Factorise a stiffness matrix (2n, 2n) with the supports in place, directly."""
        reduced = self.held.reduce(matrix)
        if backend == "auto":
            backend = choose_direct(reduced)
        elif backend not in DIRECT:
            raise InputError(
                f"a plane problem takes a direct backend: auto, {', '.join(DIRECT)}; got "
                f"'{backend}'"
            )
        return factorise(reduced, self.problem.mesh.points[self.held.nodes], backend)

    def field(
        self, case: str, displacement: FloatArray, matrix: sp.bsr_array, record: SolveRecord
    ) -> PlaneField:
        """Strain, stress, energies and reactions of a displacement (n, 2), mm."""
        strain = self.elements.centre_strain(displacement)
        own = self.elements.cell_displacement(displacement)
        internal = (matrix @ displacement.reshape(-1)).reshape(-1, 2)
        return PlaneField(
            problem=self.problem,
            case=case,
            displacement=displacement,
            strain=strain,
            stress=np.einsum("mij,mj->mi", self.problem.stiffness, strain),
            cell_energy=0.5 * np.einsum("mi,mij,mj->m", own, self.matrices, own),
            reactions=np.where(self.held.free, 0.0, internal - self.forces[case]),
            record=record,
        )


def prepare(problem: PlaneProblem, elements: PlaneElements | None = None) -> PlaneSystem:
    """Check a plate and collect what its solves share; elements of an earlier system of its mesh.

    Raises
    ------
    InputError
        For an invalid mesh, stiffness, support or load.
    """
    mesh = problem.mesh
    if not np.isfinite(mesh.points).all():
        raise InputError("the mesh has points that are NaN or infinite: correct its coordinates")
    least = _least_corner(mesh)
    if not least.min() > 0.0:
        raise InputError(
            f"cell {least.argmin()} of the plane mesh is flat, inverted or not convex: number its "
            "corners counter-clockwise, repair the mesh"
        )
    stiffness = problem.stiffness
    scale = np.abs(stiffness).max(axis=(1, 2))
    skew = np.abs(stiffness - np.swapaxes(stiffness, 1, 2)).max(axis=(1, 2))
    bad = np.flatnonzero((skew > 1e-9 * scale) | ~(np.linalg.eigvalsh(stiffness)[:, 0] > 0.0))
    if len(bad):
        raise InputError(
            f"plane stiffness must be symmetric and positive definite; cell {bad[0]} and "
            f"{len(bad) - 1} more are not: give void cells a small positive stiffness"
        )
    forces = load_cases(problem)
    elements = PlaneElements(mesh) if elements is None else elements
    if elements.mesh is not mesh:
        raise ValueError("elements must be of the problem's own mesh")
    return PlaneSystem(problem, elements, held(problem), forces)


def _least_corner(mesh: PlaneMesh) -> FloatArray:
    """Least area of the triangles at the corners of each cell, (m,), mm^2."""

    def turned(steps: int) -> FloatArray:
        return mesh.points[np.roll(mesh.cells, steps, axis=1)]

    before, after = turned(0) - turned(1), turned(-1) - turned(0)
    areas = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    size = np.maximum((before**2).sum(axis=2), (after**2).sum(axis=2))
    return (areas - 1e-12 * size).min(axis=1)


def solve_plane(
    problem: PlaneProblem,
    backend: str = "auto",
    tolerance: float = 1e-8,
    elements: PlaneElements | None = None,
) -> dict[str, PlaneField]:
    """Solve a plate for all its load cases with one factorisation.

    Parameters
    ----------
    problem : PlaneProblem
    backend : str, default "auto"
        A direct one; "auto" chooses by the band of the matrix and by what is installed.
    tolerance : float, default 1e-8
        Largest relative residual that is accepted.
    elements : PlaneElements, optional
        From an earlier `PlaneSystem` of the same mesh: saves finding the pattern again.

    Returns
    -------
    dict of load case name to PlaneField

    Raises
    ------
    InputError
        For an invalid mesh, stiffness, support, load or backend.
    SolveError
        When a relative residual stays above the tolerance.
    """
    fields = solve_system(partial(prepare, problem, elements), backend, tolerance)
    return KnownNames("load case", fields)
