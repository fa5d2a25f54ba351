"""Compliance of a part with a factor on the stiffness of each cell, solved again and again."""

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.solvers import Solver
from ccfem.errors import InputError
from ccfem.plates.problem import PlaneProblem
from ccfem.topopt.equations import PlateEquations, TetEquations
from ccfem.topopt.model import Response

__all__ = ["Compliance"]

_TOLERANCE = 1e-6
"""Relative residual of a solve; contrasts of 1e9 leave no less in double precision."""


class Compliance:
    """Compliance of a plate or of a part of linear tetrahedra: an `OrientableModel`.

    It keeps the last factorisation and displacement: iterative backends start at the latter.

    Parameters
    ----------
    problem : PlaneProblem or Problem
        With the stiffness of full density; supports at rest.
    weights : mapping of load case name to float, optional
        One non-negative weight a load case; default 1 each.
    backend : str, default "auto"

    Raises
    ------
    InputError
        For weights that do not fit the load cases, supports that move, quadratic tetrahedra, and a
        problem that has a density already.
    """

    def __init__(
        self,
        problem: PlaneProblem | Problem,
        weights: Mapping[str, float] | None = None,
        backend: str = "auto",
    ) -> None:
        self.weights = _checked_weights(problem, weights)
        self._equations: PlateEquations | TetEquations = (
            PlateEquations(problem) if isinstance(problem, PlaneProblem) else TetEquations(problem)
        )
        system = self._equations.system
        if any(system.held_in(case).value.any() for case in system.forces):
            raise InputError("topology optimisation takes supports at rest: hold them at zero")
        self._backend = self._equations.backend() if backend == "auto" else backend
        self._solver: Solver | None = None
        self._displacement: dict[str, FloatArray] = {}
        self.centres, self.volumes = self._equations.centres, self._equations.volumes

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Response:
        """Response with factors on the stiffness of the cells.

        Parameters
        ----------
        factor : (m,) array in (0, 1]
        stiffness : (m, k, k) array, MPa, optional
            Of full density, where it is not the problem's: k is 3 for plates, 6 for tetrahedra.

        Raises
        ------
        SolveError
            When a solve misses its tolerance.
        """
        equations = self._equations
        elements = equations.elements(stiffness)
        self._solve(equations.assemble(factor, elements))
        cases, energy = {}, np.zeros(len(factor))
        for case, displacement in self._displacement.items():
            forces = equations.system.forces[case]
            cases[case] = float(np.einsum("ij,ij->", forces, displacement))
            energy += self.weights[case] * equations.energy(displacement, elements)
        compliance = sum(self.weights[case] * work for case, work in cases.items())
        return Response(cases, compliance, energy, dict(self._displacement))

    def _solve(self, matrix: sp.bsr_array) -> None:
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
        """Energy ``u^T k u`` (m,), N mm, of a displacement (n, d) and a stiffness (m, k, k)."""
        return self._equations.energy(displacement, self._equations.elements(stiffness))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] at the centre of each cell in the x-y plane."""
        return self._equations.stress(displacement, stiffness)


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
