"""Plane stress: the solve of a thin plate, cell by cell of any stiffness."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, freeze
from ccfem.elasticity.loads import load_case
from ccfem.elasticity.solve import solve_system
from ccfem.elasticity.solvers import DIRECT, Solver, choose_direct, factorise
from ccfem.elasticity.stress_field import SolveRecord
from ccfem.elasticity.supports import Held, held
from ccfem.errors import InputError
from ccfem.plates.assembly import PlaneElements
from ccfem.plates.plane_mesh import PlaneMesh, raster_mesh
from ccfem.plates.problem import PlaneProblem
from ccfem.plates.stiffness import (
    plane_harmonics,
    rotate_plane,
    stack_plane,
    strain_in_axes,
    stress_in_axes,
)

__all__ = [
    "PlaneField",
    "PlaneMesh",
    "PlaneProblem",
    "PlaneSystem",
    "plane_harmonics",
    "prepare_plane",
    "raster_mesh",
    "rotate_plane",
    "solve_plane",
    "stack_plane",
]


@dataclass(frozen=True)
class PlaneField:
    """Displacement, strain and stress of one load case of a plate.

    Attributes
    ----------
    problem : PlaneProblem
    case : str
        Name of the load case.
    displacement : (n, 2) array, mm
    strain : (m, 3) array
        [e11, e22, 2 e12] at the centre of each cell, in the global axes.
    stress : (m, 3) array, MPa
        [s11, s22, s12] there; of layers stacked in one cell, their mean.
    cell_energy : (m,) array, N mm
        Strain energy of each cell.
    reactions : (n, 2) array, N
        Force that the supports put on the plate; zero away from them.
    record : SolveRecord
    """

    problem: PlaneProblem
    case: str
    displacement: FloatArray
    strain: FloatArray
    stress: FloatArray
    cell_energy: FloatArray
    reactions: FloatArray
    record: SolveRecord

    def __post_init__(self) -> None:
        freeze(self, displacement=float, reactions=float)
        freeze(self, strain=float, stress=float, cell_energy=float)

    @property
    def mesh(self) -> PlaneMesh:
        """Mesh of the problem."""
        return self.problem.mesh

    @property
    def strain_energy(self) -> float:
        """Strain energy of the plate, N mm."""
        return float(self.cell_energy.sum())

    @property
    def energy_density(self) -> FloatArray:
        """Strain energy of each cell over its volume, (m,), MPa."""
        return self.cell_energy / (self.mesh.areas * self.problem.thickness)

    def stress_in(self, angle: FloatArray, stiffness: FloatArray | None = None) -> FloatArray:
        """Stress at the centre of each cell in its material axes.

        Parameters
        ----------
        angle : (m,) array or float, radians
            From global axis x to material axis 1.
        stiffness : (3, 3) or (m, 3, 3) array, MPa, optional
            In material axes: of the one layer that the stress is wanted in. By default the mean
            stress of the cell is turned.

        Returns
        -------
        (m, 3) array, MPa
            [s11, s22, s12].
        """
        if stiffness is None:
            return stress_in_axes(self.stress, angle)
        return np.einsum("...ij,...j->...i", stiffness, self.strain_in(angle))

    def strain_in(self, angle: FloatArray) -> FloatArray:
        """Strain [e11, e22, 2 e12] (m, 3) at the centres in axes turned by (m,) angles, radians."""
        return strain_in_axes(self.strain, angle)


@dataclass(frozen=True)
class PlaneSystem:
    """The equations of a plate: everything that stays when only the stiffness changes.

    For many solves on one mesh keep one system and call ``system.assemble(matrices)`` with
    ``matrices = thickness * system.elements.matrices(stiffness)``.

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
        thickness = np.asarray(self.problem.thickness)[:, None, None]
        return thickness * self.elements.matrices(self.problem.stiffness)

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


def prepare_plane(problem: PlaneProblem, elements: PlaneElements | None = None) -> PlaneSystem:
    """Check a plate and collect what its solves share.

    Parameters
    ----------
    problem : PlaneProblem
    elements : PlaneElements, optional
        Of the same mesh, when at hand from an earlier system.

    Raises
    ------
    InputError
        For a mesh, supports or loads that nothing sensible can follow from.
    """
    mesh = problem.mesh
    if not problem.loads:
        raise InputError("the plate has no load case: give at least one load")
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
    forces = {name: load_case(problem, name) for name in problem.loads}
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
        For a mesh, supports, loads or a backend that nothing sensible can follow from.
    SolveError
        When a relative residual stays above the tolerance.
    """

    def prepare(problem: PlaneProblem) -> PlaneSystem:
        return prepare_plane(problem, elements)

    return solve_system(prepare, problem, backend, tolerance)
