"""The solve: from a problem to the stress field of every load case."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import perf_counter
from typing import Protocol, TypeVar

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.assembly import Pattern, assemble, pattern
from ccfem.elasticity.loads import load_cases
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.recovery import cell_stress, nodal_stress
from ccfem.elasticity.solvers import LARGEST_DIRECT, Solver, direct_backend, factorise
from ccfem.elasticity.stress_field import SolveRecord, StressField
from ccfem.elasticity.supports import Held, held
from ccfem.errors import InputError, SolveError
from ccfem.mesh.check import about_slivers
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.tensor import rotate_stiffness

__all__ = ["System", "cell_stiffness", "prepare", "solve", "solve_system"]

FieldT = TypeVar("FieldT", covariant=True)


def cell_stiffness(problem: Problem) -> FloatArray:
    """Stiffness in the global frame without density: (6, 6), or (m, 6, 6) per cell, MPa."""
    if problem.stiffness is not None:
        return problem.stiffness
    if problem.axes is None:
        return problem.material.stiffness
    return rotate_stiffness(problem.material.stiffness, problem.axes)


@dataclass(frozen=True)
class System:
    """The equations of a problem: everything that stays when only the stiffness changes.

    Attributes
    ----------
    problem : Problem
    where : Pattern
        Of the stiffness matrix.
    held : Held
        The supports.
    forces : dict of load case name to (n, 3) array, N
    """

    problem: Problem
    where: Pattern
    held: Held
    forces: dict[str, FloatArray]

    @cached_property
    def stiffness(self) -> FloatArray:
        """Stiffness of the problem in the global frame, (6, 6) or (m, 6, 6), MPa."""
        return cell_stiffness(self.problem)

    def assemble(self, stiffness: FloatArray | None = None) -> sp.bsr_array:
        """Stiffness matrix (3n, 3n), N/mm, of the problem or of another stiffness of its cells."""
        chosen = self.stiffness if stiffness is None else stiffness
        return assemble(self.problem.mesh, chosen, self.problem.density, self.where)

    def factorise(self, matrix: sp.bsr_array, backend: str = "auto", solves: int = 1) -> Solver:
        """Factorise a stiffness matrix (3n, 3n) with the supports in place.

        Parameters
        ----------
        matrix : bsr_array (3n, 3n), N/mm
        backend : str, default "auto"
        solves : int, default 1
            Right-hand sides to expect.
        """
        mesh, nodes = self.problem.mesh, self.held.nodes
        parents = _parents(mesh, nodes) if mesh.order == 2 else None
        return factorise(self.held.reduce(matrix), mesh.points[nodes], backend, parents, solves)

    def field(
        self, case: str, displacement: FloatArray, matrix: sp.bsr_array, record: SolveRecord
    ) -> StressField:
        """Stress, reactions and energy of a displacement (n, 3), mm."""
        problem = self.problem
        scaled = self.stiffness
        if problem.density is not None:
            scaled = problem.density[:, None, None] * scaled
        internal = (matrix @ displacement.reshape(-1)).reshape(-1, 3)
        return StressField(
            problem=problem,
            case=case,
            displacement=displacement,
            stress=cell_stress(problem.mesh, displacement, scaled),
            nodal=nodal_stress(problem.mesh, displacement, scaled),
            reactions=np.where(self.held.free, 0.0, internal - self.forces[case]),
            strain_energy=0.5 * float(np.vdot(displacement, internal)),
            record=record,
        )


def _parents(mesh: TetMesh, nodes: IntArray) -> IntArray:
    """Rows of the two corners that each row's node is the middle of; -1 for a held corner."""
    place = np.full(len(mesh.points), -1)
    place[nodes] = np.arange(len(nodes))
    ends = np.repeat(np.arange(len(mesh.points))[:, None], 2, axis=1)
    ends[mesh.cells[:, 4:]] = mesh.cells[:, mesh.edges]
    return place[ends[nodes]]


def prepare(problem: Problem) -> System:
    """Check a problem and collect what its solves share.

    Raises
    ------
    InputError
        For an invalid mesh, support or load.
    """
    if not np.isfinite(problem.mesh.points).all():
        raise InputError("the mesh has points that are NaN or infinite: correct its coordinates")
    if not problem.mesh.volumes.min() > 0.0:
        raise InputError(
            f"cell {problem.mesh.volumes.argmin()} of the mesh has volume "
            f"{problem.mesh.volumes.min():.3g} mm^3: repair flat and inverted cells first"
        )
    forces = load_cases(problem)
    return System(problem, pattern(problem.mesh), held(problem), forces)


def solve(
    problem: Problem, backend: str = "auto", tolerance: float = 1e-8
) -> dict[str, StressField]:
    """Solve a problem for all its load cases with one factorisation.

    Parameters
    ----------
    problem : Problem
    backend : str, default "auto"
        One of `ccfem.elasticity.BACKENDS`; "auto" chooses by size and by what is installed, and
        where an iterative backend misses the tolerance goes on with a direct one. The record
        names the one that solved.
    tolerance : float, default 1e-8
        Largest relative residual that is accepted.

    Returns
    -------
    dict of load case name to StressField
        The time of the factorisation counts in the record of the first load case.

    Raises
    ------
    InputError
        For an invalid mesh, support, load or backend.
    SolveError
        When a relative residual stays above the tolerance; very flat cells are named.
    """
    try:
        return solve_system(partial(prepare, problem), backend, tolerance)
    except SolveError as error:
        slivers = about_slivers(problem.mesh)
        if not slivers:
            raise
        raise SolveError(f"{error}; {slivers}") from error


class _Equations(Protocol[FieldT]):
    """What `solve_system` asks of the equations of a problem, in space or in the plane."""

    @property
    def held(self) -> Held: ...

    @property
    def forces(self) -> dict[str, FloatArray]: ...

    def assemble(self) -> sp.bsr_array: ...

    def factorise(self, matrix: sp.bsr_array, backend: str, solves: int = 1) -> Solver: ...

    def field(
        self, case: str, displacement: FloatArray, matrix: sp.bsr_array, record: SolveRecord
    ) -> FieldT: ...


def solve_system(
    prepare: Callable[[], _Equations[FieldT]], backend: str, tolerance: float
) -> dict[str, FieldT]:
    """Prepare a problem and solve it for all its load cases: see `solve`."""
    started = perf_counter()
    system = prepare()
    matrix = system.assemble()
    assembled = perf_counter()
    solver = system.factorise(matrix, backend, len(system.forces))
    record = SolveRecord(solver.backend, 0, 0.0, assembled - started, 0.0, 0)
    record = replace(record, unknowns=int(system.held.free.sum()))
    fields = {}
    started = assembled
    for case, forces in system.forces.items():
        rhs = system.held.right_hand_side(matrix, forces)
        try:
            solution = solver.solve(rhs, tolerance=tolerance)
        except SolveError:
            if backend != "auto" or solver.exact or record.unknowns > LARGEST_DIRECT:
                raise
            solver = system.factorise(matrix, direct_backend())
            solution = solver.solve(rhs, tolerance=tolerance)
        displacement = system.held.expand(solution.values)
        now = perf_counter()
        record = replace(
            record,
            backend=solver.backend,
            iterations=solution.iterations,
            residual=solution.residual,
            solve_seconds=now - started,
        )
        fields[case] = system.field(case, displacement, matrix, record)
        started = perf_counter()
    return fields
