"""The equations of a problem: everything that does not depend on the stiffness."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.assembly import Pattern, assemble, pattern
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.loads import free_strain, load_cases, strain_forces
from ccfem.fem.elasticity.multigrid import Coarse
from ccfem.fem.elasticity.plausibility import check_balance, check_effect
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import cell_stress, nodal_stress, times
from ccfem.fem.elasticity.solvers import Solver, factorise
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.elasticity.supports import add_springs, held, held_in, soft_supports, spring_forces


@dataclass(frozen=True)
class System:
    """The equations of a problem: everything that does not depend on the stiffness.

    Attributes
    ----------
    held : Held
        The supports, as far as no load case moves them.
    forces : dict of load case name to (n, 3) array, N
        Of the loads; for heat, the reverse of the forces that would prevent expansion.
    moved : dict of load case name to (n, 3) array, mm
        Values of the held components, where they differ from those of `held`.
    """

    problem: Problem
    held: Held
    forces: dict[str, FloatArray]
    moved: Mapping[str, FloatArray] = field(default_factory=dict)

    @cached_property
    def where(self) -> Pattern:
        """Pattern of the stiffness matrix."""
        return pattern(self.problem.mesh)

    @cached_property
    def stiffness(self) -> FloatArray:
        """Stiffness of the problem in the global frame, (6, 6) or (m, 6, 6), MPa."""
        return self.problem.cell_stiffness

    @property
    def combinations(self) -> Mapping[str, Mapping[str, float]]:
        """Combinations of load cases, with their factors."""
        return self.problem.combinations

    def held_in(self, case: str) -> Held:
        """Return what is held, at its values in one load case or combination of them."""
        factors = self.problem.factors(case)
        if factors == {case: 1.0} and case not in self.moved:
            return self.held
        values = (k * self.moved.get(name, self.held.value) for name, k in factors.items())
        return self.held.at(sum(values, np.zeros_like(self.held.value)))

    def forces_in(self, case: str) -> FloatArray:
        """Return the forces (n, 3), N, of one load case or combination of them."""
        factors = self.problem.factors(case)
        if factors == {case: 1.0}:
            return self.forces[case]
        parts = (k * self.forces[name] for name, k in factors.items())
        return sum(parts, np.zeros_like(self.problem.mesh.points))

    def assemble(
        self, stiffness: FloatArray | None = None, density: FloatArray | None = None
    ) -> sp.bsr_array:
        """Stiffness matrix (3n, 3n), N/mm, springs included.

        Parameters
        ----------
        stiffness : (6, 6) or (m, 6, 6) array, MPa, optional
            Replaces the stiffness of the problem.
        density : (m,) array, optional
            Replaces the density of the problem, the factor on the stiffness.
        """
        problem = self.problem
        chosen = self.stiffness if stiffness is None else stiffness
        factor = problem.density if density is None else density
        matrix = assemble(problem.mesh, chosen, factor, self.where)
        add_springs(matrix, problem.mesh, soft_supports(problem))
        return matrix

    def factorise(
        self, matrix: sp.bsr_array, backend: str = "auto", solves: int = 1, held: Held | None = None
    ) -> Solver:
        """Factorise a stiffness matrix (3n, 3n) with the supports in place.

        Parameters
        ----------
        matrix : bsr_array (3n, 3n), N/mm
        backend : str, default "auto"
        solves : int, default 1
            Right-hand sides to expect.
        held : Held, optional
            The supports in another contact; default all in contact.
        """
        mesh, held = self.problem.mesh, self.held if held is None else held
        ends = _ends(mesh) if mesh.order == 2 else None
        if held.ties is None:
            parents = None if ends is None else held.parents(ends)
            return factorise(held.reduce(matrix), mesh.points[held.nodes], backend, parents, solves)
        return factorise(
            held.reduce(matrix),
            held.modes(mesh.points),
            backend,
            None if ends is None else Coarse(*held.prolongation(ends)),
            solves,
        )

    def reactions(self, case: str, displacement: FloatArray, internal: FloatArray) -> FloatArray:
        """Reactions (n, 3), N, to a displacement (n, 3), mm, that needs the given forces (n, 3)."""
        forces, held = self.forces_in(case), self.held_in(case)
        residual = internal - forces
        result = held.supported(residual)
        if soft := soft_supports(self.problem):
            result = result + spring_forces(self.problem.mesh, soft, displacement)
        outside, moved = result + held.lost_in_ties(residual), bool(held.value.any())
        check_balance(self.problem, case, displacement, forces, outside, moved)
        return result

    def field(
        self, case: str, displacement: FloatArray, matrix: Any, record: SolveRecord
    ) -> StressField:
        """Stress, reactions and energy of a displacement (n, 3), mm.

        ``matrix @ displacement`` gives the forces (3n,), N, of a displacement (3n,).
        """
        problem = self.problem
        scaled = self.stiffness
        if problem.density is not None:
            scaled = problem.density[:, None, None] * scaled
        internal = (matrix @ displacement.reshape(-1)).reshape(-1, 3)
        free, mesh = free_strain(problem, case), problem.mesh
        reactions = self.reactions(case, displacement, internal)
        energy = 0.5 * float(np.vdot(displacement, internal))
        if free is not None:
            stress = times(scaled, free)
            energy -= float(np.vdot(displacement, strain_forces(mesh, stress)))
            # The mean over a cell of a product of two quantities that are linear in it.
            both = np.einsum("mai,mai->m", stress, free)
            both += np.einsum("mi,mi->m", stress.sum(axis=1), free.sum(axis=1))
            energy += 0.5 * float(mesh.volumes @ both) / 20.0
        return StressField(
            problem=problem,
            case=case,
            displacement=displacement,
            stress=cell_stress(mesh, displacement, scaled, free),
            nodal=nodal_stress(mesh, displacement, scaled, free),
            reactions=reactions,
            strain_energy=energy,
            record=record,
        )


def _ends(mesh: TetMesh) -> IntArray:
    """Corners (n, 2) of which each node is the midpoint; a corner is its own."""
    ends = np.repeat(np.arange(len(mesh.points))[:, None], 2, axis=1)
    ends[mesh.cells[:, 4:]] = mesh.cells[:, mesh.edges]
    return ends


def prepare(problem: Problem) -> System:
    """Collect what the solves of a problem share, on its mesh as it is.

    Raises
    ------
    InputError
        For supports or loads that make no sense, load cases with different supports, and those
        under which nothing moves.
    """
    if problem.case_supports:
        raise InputError(
            f"load cases {', '.join(problem.case_supports)} have supports of their own, and one "
            "set of supports is expected here: leave them out, or solve each set on its own "
            "(ccfem.solve does)"
        )
    forces = load_cases(problem)
    at_rest = held(problem)
    moved = {}
    for case in problem.loads:
        here = held_in(problem, case, at_rest)
        if here is not at_rest:
            moved[case] = here.value
    system = System(problem, at_rest, forces, moved)
    for case in problem.cases:
        size = sum(
            abs(factor) * float(np.linalg.norm(forces[name], axis=1).sum())
            for name, factor in problem.factors(case).items()
        )
        check_effect(problem, case, system.held_in(case), system.forces_in(case), size)
    return system
