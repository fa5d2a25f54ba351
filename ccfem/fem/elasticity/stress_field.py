"""The result of a solve: displacement, stress, reactions, and the record of the solve."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, read_only
from ccfem.base.checks import check_number
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.base.tensor import strain_from_voigt, to_voigt
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.error_estimate import ErrorEstimate, estimate_error
from ccfem.fem.elasticity.load_kinds import patches_in_use
from ccfem.fem.elasticity.nodes import patch_nodes
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.fem.elasticity.plausibility import about_problem, about_solution
from ccfem.fem.elasticity.probe import Probe, displacement_at, located, support_forces
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import cell_strain, nodal_stress
from ccfem.fem.elasticity.supports import held
from ccfem.fem.elasticity.volume_loads import free_strain
from ccfem.fem.materials import Material


@dataclass(frozen=True)
class SolveRecord:
    """How a solve went.

    Attributes
    ----------
    backend : str
    iterations : int
        0 for a direct solve.
    residual : float
        Relative residual ``|f - K u| / |f|`` over the free components.
    assembly_seconds, solve_seconds : float
    unknowns : int
        Free components of the displacement.
    backward_error : float
        ``|f - K u| / (|K| |u| + |f|)``: distance to the equations that u solves exactly.
    energy_error : float
        Bound of the energy norm of the solver's error, over that of u; NaN if not computed.
    error : float
        Estimated energy norm of the discretisation error, over that of the exact solution; NaN if
        not computed.
    order_because : str
        The order of the displacement that was chosen, and why, if it was left open.
    backend_because : str
        The rule that chose the backend, or why another backend replaced it.
    """

    backend: str
    iterations: int
    residual: float
    assembly_seconds: float
    solve_seconds: float
    unknowns: int
    backward_error: float = np.nan
    energy_error: float = np.nan
    error: float = np.nan
    order_because: str = ""
    backend_because: str = ""


@dataclass(frozen=True)
class StressField(Shown):
    """Displacement and stress of one load case.

    Attributes
    ----------
    problem : Problem
    case : str
        Name of the load case.
    displacement : (n, 3) array, mm
    stress : (m, 3, 3) array, MPa
        Per cell (P2: at the centroid).
    nodal : (n, 3, 3) array, MPa
        Recovered at the nodes: volume-weighted average of the cells round each.
    reactions : (n, 3) array, N
        Force that the supports put on the part; zero away from them.
    strain_energy : float, N mm
    record : SolveRecord
    """

    problem: Problem
    case: str
    displacement: FloatArray
    stress: FloatArray
    nodal: FloatArray
    reactions: FloatArray
    strain_energy: float
    record: SolveRecord

    def __post_init__(self) -> None:
        freeze(self, displacement=float, stress=float, nodal=float, reactions=float)

    def __repr__(self) -> str:
        largest = float(np.linalg.norm(self.displacement, axis=1).max())
        return (
            f"StressField of load case {self.case}: {len(self.stress):,} cells, largest "
            f"displacement {largest:.4g} mm, strain energy {self.strain_energy:.4g} N mm"
        )

    @property
    def mesh(self) -> TetMesh:
        """Mesh of the problem."""
        return self.problem.mesh

    @cached_property
    def error(self) -> ErrorEstimate:
        """Estimated error of the stress of each cell."""
        problem = self.problem
        stiffness = problem.cell_stiffness
        if problem.density is not None:
            stiffness = problem.density[:, None, None] * stiffness
        free = free_strain(problem, self.case)
        return estimate_error(self.mesh, self.displacement, stiffness, free)

    @cached_property
    def findings(self) -> tuple[str, ...]:
        """Remarks on the part and its solution, one line each (`plausibility`)."""
        problem, error, cases = self.problem, self.record.error, self.problem.factors(self.case)
        return (
            *about_problem(problem, held(problem), cases, error),
            *about_solution(problem, self.case, self.displacement, self.stress, error),
        )

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load."""
        return self.problem.held_or_loaded

    @property
    def loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a load in its load case."""
        return patches_in_use((), {self.case: self.problem.loads_of(self.case)})

    @property
    def material(self) -> Material:
        """Material of the part, outside its regions."""
        return self.problem.material

    def at(self, points: FloatArray, tolerance: float = 1e-3) -> FloatArray:
        """Recovered stress at any points of the part.

        Parameters
        ----------
        points : (k, 3) array, mm
        tolerance : float, mm
            Points outside the mesh by no more than this take the stress of its surface.

        Returns
        -------
        (k, 3, 3) array, MPa
            Interpolated linearly between the corner nodes of the cell that holds each point.

        Raises
        ------
        InputError
            When a point lies further outside.
        """
        cell, weights = located(self.mesh, points, tolerance)
        return np.einsum("qk,qkij->qij", weights, self.nodal[self.mesh.corners[cell]])

    @cached_property
    def strain(self) -> FloatArray:
        """Strain tensor of each cell (P2: at the centroid), (m, 3, 3), with tensor shear."""
        return read_only(strain_from_voigt(cell_strain(self.mesh, self.displacement)))

    @cached_property
    def nodal_strain(self) -> FloatArray:
        """Strain at the nodes, (n, 3, 3), averaged like the stress."""
        engineering = nodal_stress(self.mesh, self.displacement, np.eye(6))
        return read_only(strain_from_voigt(to_voigt(engineering)))

    def probe(self, points: FloatArray, tolerance: float = 1e-3) -> Probe:
        """Displacement, and recovered strain and stress, at points.

        Parameters
        ----------
        points : (k, 3) array, mm
        tolerance : float, mm
            As in `at`.

        Raises
        ------
        InputError
            When a point lies further outside.
        """
        points = np.asarray(points, dtype=np.float64)
        mesh = self.mesh
        cell, weights = located(mesh, points, tolerance)
        corner = mesh.corners[cell]
        return Probe(
            points,
            displacement_at(mesh, self.displacement, cell, weights),
            np.einsum("qk,qkij->qij", weights, self.nodal_strain[corner]),
            np.einsum("qk,qkij->qij", weights, self.nodal[corner]),
        )

    def along(self, start: Sequence[float], end: Sequence[float], count: int = 101) -> Probe:
        """`probe` at `count` >= 2 points of the straight line between two points, mm, of the part.

        Its `distance` is measured from the start.
        """
        check_number("number of points of a line", count, at_least=2)
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        return self.probe(first + np.linspace(0.0, 1.0, count)[:, None] * (last - first))

    def on(self, patch: str) -> Probe:
        """Return the result of `probe` at the nodes of a patch."""
        nodes = patch_nodes(self.mesh, patch)
        strain, stress = self.nodal_strain[nodes], self.nodal[nodes]
        return Probe(self.mesh.points[nodes], self.displacement[nodes], strain, stress)

    @property
    def support_forces(self) -> dict[str, FloatArray]:
        """Force (3,), N, of each support on the part: see `ccfem.fem.elasticity.probe`."""
        return support_forces(self.problem, self.reactions)


def about_cells(field: StressField) -> str:
    """Say in one line which cells a solution uses, why, and what error they leave."""
    record, mesh = field.record, field.mesh
    why = f" ({record.order_because})" if record.order_because else ""
    kind = "linear" if mesh.order == 1 else "quadratic"
    error = "not estimated" if np.isnan(record.error) else f"{record.error:.1%} in energy norm"
    return f"{len(mesh.cells):,} {kind} cells{why}; error {error}"


def solved(stress: PartStress, purpose: str) -> StressField:
    """Return the stress as the result of a solve, for methods that must solve the part again.

    Raises
    ------
    InputError
        When the stress was given; `purpose` names what is then impossible.
    """
    if not isinstance(stress, StressField):
        raise InputError(
            f"{purpose} solves the part again and needs its problem; got stress without one: solve "
            "the part with ccfem.solve, or choose another strategy"
        )
    return stress
