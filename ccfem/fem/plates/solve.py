"""The solve of a thin plate: from a problem to the plane stress of every load case."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief, read_only
from ccfem.base.checks import KnownNames
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Solver, SolveRecord, factorise, pattern
from ccfem.fem.elasticity.assembly import Pattern
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.loads import load_cases
from ccfem.fem.elasticity.solvers import DIRECT, choose_direct
from ccfem.fem.elasticity.statics import solve_system
from ccfem.fem.elasticity.supports import held
from ccfem.fem.plates.mesh import PlaneMesh
from ccfem.fem.plates.problem import PlaneProblem, strain_in_axes, stress_in_axes

# What the solve of a plate finds: displacement, strain, stress and energy.


@dataclass(frozen=True)
class PlaneField:
    """Displacement, strain and stress of one load case of a plate.

    Attributes
    ----------
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
    """

    problem: PlaneProblem
    case: str
    displacement: FloatArray
    strain: FloatArray
    stress: FloatArray
    cell_energy: FloatArray
    reactions: FloatArray
    record: SolveRecord

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float, stress=float)
        freeze(self, cell_energy=float, reactions=float)

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
        return self.cell_energy / self.problem.volumes

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
        return np.einsum("...ij,...j->...i", stiffness, strain_in_axes(self.strain, angle))


# Stiffness matrix of plane cells: triangles of constant strain, quadrilaterals with 2x2 Gauss.


_GAUSS = 1.0 / np.sqrt(3.0)
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Components of a symmetric (3, 3) matrix, each once."""


def _shape_gradients(points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients (c, q, 2) of the shape functions of cells (c, q, 2), and Jacobians (c,)."""
    if points.shape[1] == 3:
        local = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    else:
        local = 0.25 * _CORNERS * (1.0 + (_CORNERS * at)[:, ::-1])
    jacobian = np.swapaxes(points, 1, 2) @ local  # dx_i / dxi_j
    a, b, c, d = jacobian.reshape(-1, 4).T
    determinant = a * d - b * c
    inverse = np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2) / determinant[:, None, None]
    return local @ inverse, determinant


def _strain_matrices(points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Strain of nodal displacements at one local point (2,) in [-1, 1] of each cell (c, q, 2).

    Matrices B (c, 3, 2q), 1/mm, with ``[e11, e22, 2 e12] = B @ [u0, v0, u1, v1, ...]``, and the
    area per local area (c,), mm^2; the local triangle has area 1/2, the local square 4.
    """
    gradient, determinant = _shape_gradients(points, at)
    count, q, _ = gradient.shape
    matrix = np.zeros((count, 3, q, 2))
    matrix[:, 0, :, 0] = matrix[:, 2, :, 1] = gradient[:, :, 0]
    matrix[:, 1, :, 1] = matrix[:, 2, :, 0] = gradient[:, :, 1]
    return matrix.reshape(count, 3, 2 * q), determinant


@dataclass(frozen=True)
class PlaneElements:
    """All that the stiffness matrices of one plane mesh share."""

    mesh: PlaneMesh

    @cached_property
    def where(self) -> Pattern:
        """Pattern of the stiffness matrix."""
        return pattern(self.mesh)

    @cached_property
    def _slots(self) -> IntArray:
        """Block of the matrix that each pair of corners of each cell belongs to, (m * q * q,)."""
        n, where, cells = len(self.mesh.points), self.where, self.mesh.cells
        known = np.repeat(np.arange(n), np.diff(where.indptr)) * n + where.indices
        wanted = cells[:, :, None] * n + cells[:, None, :]
        return read_only(np.searchsorted(known, wanted.reshape(-1)), np.int64)

    @cached_property
    def shapes(self) -> FloatArray:
        """Corners of the cells that differ: (1, q, 2) where all are congruent, else (m, q, 2)."""
        corners = self.mesh.points[self.mesh.cells]
        return corners[:1] - corners[:1, :1] if self.mesh.congruent else corners

    @cached_property
    def gauss(self) -> list[tuple[FloatArray, FloatArray]]:
        """Strain matrices (c, 3, 2q) and weights (c,), mm^2, of every Gauss point."""
        if self.mesh.cells.shape[1] == 3:
            matrix, jacobian = _strain_matrices(self.shapes, np.zeros(2))
            return [(matrix, 0.5 * jacobian)]
        return [_strain_matrices(self.shapes, _GAUSS * corner) for corner in _CORNERS]

    @cached_property
    def _constant(self) -> FloatArray:
        """Element matrices (6, 4 q^2) of unit stiffness components, where cells are congruent."""
        result = np.zeros((6, *2 * (2 * self.mesh.cells.shape[1],)))
        for matrix, weight in self.gauss:
            for k, (i, j) in enumerate(_PAIRS):
                product = weight[0] * np.outer(matrix[0, i], matrix[0, j])
                result[k] += product if i == j else product + product.T
        return result.reshape(6, -1)

    def matrices(self, stiffness: FloatArray) -> FloatArray:
        """Element matrices for a thickness of 1 mm: (c, 2q, 2q) N/mm per mm.

        Parameters
        ----------
        stiffness : (c, 3, 3) array, MPa
            Symmetric; of each cell, or of any number where the cells are congruent.
        """
        size = 2 * self.mesh.cells.shape[1]
        if self.mesh.congruent:
            rows, columns = np.array(_PAIRS).T
            # Without the threads of a BLAS, which cost more than they save here.
            constant = np.einsum("ck,kl->cl", stiffness[:, rows, columns], self._constant)
            return constant.reshape(-1, size, size)
        result = np.zeros((len(stiffness), size, size))
        for matrix, weight in self.gauss:
            result += np.swapaxes(matrix, 1, 2) @ ((weight[:, None, None] * stiffness) @ matrix)
        return result

    def assemble(self, matrices: FloatArray) -> sp.bsr_array:
        """Sum element matrices (m, 2q, 2q), N/mm, to the (2n, 2n) matrix with 2x2 blocks.

        Its columns are sorted; ``indptr`` and ``indices`` are those of the pattern.
        """
        blocks = len(self.where.indices)
        data = np.empty((blocks, 2, 2))
        for i in range(2):
            for j in range(2):
                entries = matrices[:, i::2, j::2].reshape(-1)
                data[:, i, j] = np.bincount(self._slots, entries, blocks)
        n = 2 * len(self.mesh.points)
        return sp.bsr_array((data, self.where.indices, self.where.indptr), shape=(n, n))

    def cell_displacement(self, displacement: FloatArray) -> FloatArray:
        """Displacement (n, 2) of the corners of each cell, (m, 2q)."""
        return displacement[self.mesh.cells].reshape(len(self.mesh.cells), -1)

    def centre_strain(self, displacement: FloatArray) -> FloatArray:
        """Strain [e11, e22, 2 e12] at the centre of each cell, (m, 3)."""
        matrix, _ = _strain_matrices(self.shapes, np.zeros(2))
        return np.einsum(
            "...ij,...j->...i",
            matrix[0] if self.mesh.congruent else matrix,
            self.cell_displacement(displacement),
        )


@dataclass(frozen=True)
class PlaneSystem:
    """The equations of a plate: everything that stays when only the stiffness changes.

    For many solves on one mesh keep one system and call ``system.assemble(matrices)`` with
    ``matrices = system.matrices_of(stiffness)``. `forces` (n, 2), N, are by load case.
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
        by_cell = self.elements.cell_displacement(displacement)
        internal = (matrix @ displacement.reshape(-1)).reshape(-1, 2)
        return PlaneField(
            problem=self.problem,
            case=case,
            displacement=displacement,
            strain=strain,
            stress=np.einsum("mij,mj->mi", self.problem.stiffness, strain),
            cell_energy=0.5 * np.einsum("mi,mij,mj->m", by_cell, self.matrices, by_cell),
            reactions=np.where(self.held.free, 0.0, internal - self.forces[case]),
            record=record,
        )


def prepare(problem: PlaneProblem, elements: PlaneElements | None = None) -> PlaneSystem:
    """Check a plate and collect what solves share; elements of an earlier system of its mesh."""
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
    backend : str, default "auto"
        A direct one; "auto" chooses by the band of the matrix and by what is installed.
    tolerance : float, default 1e-8
        Largest relative residual that is accepted.
    elements : PlaneElements, optional
        From an earlier `PlaneSystem` of the same mesh: saves finding the pattern again.

    Returns
    -------
    dict of load case name to PlaneField
    """
    fields = solve_system(partial(prepare, problem, elements), backend, tolerance)
    return KnownNames("load case", fields)
