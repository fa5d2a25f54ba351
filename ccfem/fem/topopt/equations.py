"""Stiffness equations of plates and of tetrahedra, assembled again for other stiffnesses."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import cell_strain
from ccfem.fem.elasticity.solvers import LARGEST_DIRECT, choose_direct, direct_backend
from ccfem.fem.elasticity.system import prepare as prepare_tets
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.plates.solve import prepare as prepare_plate


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
        own = self.system.elements.cell_displacement(displacement)
        one = len(elements) == 1
        image = own @ elements[0] if one else np.einsum("mij,mj->mi", elements, own)
        return np.einsum("mi,mi->m", own, image)

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Stress (m, 3), MPa, [s11, s22, s12] at the centre of each cell."""
        strain = self.system.elements.centre_strain(displacement)
        return np.einsum("mij,mj->mi", stiffness, strain)


class TetEquations:
    """Equations of linear tetrahedra; their elements are the stiffness, (6, 6) or (m, 6, 6), MPa.

    Raises
    ------
    InputError
        For quadratic tetrahedra, and a problem that has a density already.
    """

    def __init__(self, problem: Problem) -> None:
        if problem.mesh.order != 1:
            raise InputError("topology optimisation takes linear tetrahedra; got quadratic ones")
        if problem.density is not None:
            raise InputError(
                "the problem has a density already: give it as `start`, or fold it into stiffness"
            )
        self.system = prepare_tets(problem)
        self.centres = problem.mesh.points[problem.mesh.cells].mean(axis=1)
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
