"""The specimen of a virtual test: the part without fibres, clamped, loaded and factorised."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, in_brief
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Solver, StressField, System, Temperature, prepare
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.statics import EQUATIONS

_SOLVES = 30
"""Right-hand sides to expect: a virtual test takes some twenty, a design hundreds."""


@dataclass(frozen=True)
class Specimen:
    """A part without fibres under one load case, kept for any number of virtual tests.

    Attributes
    ----------
    unreinforced : StressField
        Solution without fibres.
    system : System
        Equations of its problem.
    matrix : bsr_array (3n, 3n), N/mm
        Stiffness matrix without fibres.
    backend : str
        Solver that factorises the matrix, once, as the preconditioner of all tests.
    """

    unreinforced: StressField
    system: System
    matrix: sp.bsr_array
    backend: str = "auto"

    __repr__ = in_brief

    @classmethod
    def of(cls, unreinforced: StressField, backend: str = "auto") -> "Specimen":
        """Make the specimen of a solved problem, or return the one that was made before.

        The field stores it, so that all planning and testing on the field share one factorisation.
        The backend "auto" is the one that solved the field.

        Raises
        ------
        InputError
            When forces act and supports move too: no single stiffness describes that.
        """
        known = unreinforced.__dict__.setdefault("specimens", {})
        if backend == "auto":
            backend = unreinforced.record.backend
        if backend not in known:
            known[backend] = cls._made(unreinforced, backend)
        specimen: Specimen = known[backend]
        return specimen

    @classmethod
    def _made(cls, unreinforced: StressField, backend: str) -> "Specimen":
        solved = unreinforced.__dict__.pop(EQUATIONS, None)
        taken = solved is not None and solved[-1].backend == backend
        system = solved[0] if taken else prepare(unreinforced.problem)
        _check_case(system, unreinforced.case)
        if not taken:
            return cls(unreinforced, system, system.assemble(), backend)
        made = cls(unreinforced, system, solved[1], backend)
        made.__dict__["solver"] = solved[2]
        return made

    def under(self, other: StressField) -> "Specimen":
        """Return the same part under another load case, with one factorisation.

        Parameters
        ----------
        other : StressField
            Without fibres, of the same mesh, material and supports.
        """
        known = other.__dict__.setdefault("specimens", {})
        other.__dict__.pop(EQUATIONS, None)
        if self.backend not in known:
            same = other.problem is self.system.problem
            system = self.system if same else prepare(other.problem)
            _check_case(system, other.case)
            made = Specimen(other, system, self.matrix, self.backend)
            if np.array_equal(made.held.free, self.held.free):
                made.__dict__["solver"] = self.solver
            known[self.backend] = made
        specimen: Specimen = known[self.backend]
        return specimen

    def weakened(self, matrix: sp.bsr_array, solver: Solver) -> "Specimen":
        """Return the part with another stiffness, and a solver of a similar one.

        Parameters
        ----------
        matrix : bsr_array (3n, 3n), N/mm
            Of the pattern of `matrix`.
        solver : Solver
            Of a similar matrix under the same supports: the preconditioner.
        """
        made = replace(self, matrix=matrix)
        reduced = self.solver.matrix if matrix is self.matrix else self.held.reduce(matrix)
        made.__dict__["held"] = self.held
        made.__dict__["solver"] = replace(solver, matrix=reduced, exact=False)
        return made

    def for_fibre(self, stiffness: FloatArray) -> "Specimen":
        """Return the same part with a preconditioner of it with fibre.

        Parameters
        ----------
        stiffness : (m, 6, 6) array, MPa
            That the fibre adds to each cell.
        """
        system, density = self.system, self.system.problem.density
        scale = 1.0 if density is None else density[:, None, None]
        with_fibre = system.assemble(scale * system.stiffness + stiffness, np.ones(len(stiffness)))
        # Fast to set up, and at least as good where fibre is stiff along layers (measured).
        solver = system.factorise(with_fibre, self.backend, held=self.held)
        return self.weakened(self.matrix, solver)

    @cached_property
    def solver(self) -> Solver:
        """Factorisation, or preconditioner, of the part without fibres."""
        return self.system.factorise(self.matrix, self.backend, _SOLVES, held=self.held)

    @property
    def forces(self) -> FloatArray:
        """Nodal forces (n, 3), N."""
        return self.system.forces_in(self.unreinforced.case)

    @cached_property
    def forced(self) -> bool:
        """Whether forces load the part; otherwise supports move."""
        return not self.held.value.any()

    @cached_property
    def held(self) -> Held:
        """Supports of the load case, with the contact found without fibres."""
        before = self.unreinforced
        return self.system.held_in(before.case).touching(before.displacement)

    @property
    def modulus(self) -> float:
        """Young's modulus of the material along its first axis, MPa."""
        compliance = np.linalg.inv(self.system.problem.material.stiffness)
        return float(1.0 / compliance[0, 0])

    def force(self, reactions: FloatArray) -> float:
        """Size of the load, N, where the supports react with (n, 3), N.

        The resultant of the forces, or of the reactions of the supports that move; where they
        balance, half the sum of their sizes.
        """
        forces = self.forces
        if self._moving.any():
            forces = np.where(self._moving[:, None], reactions, 0.0)
        resultant = float(np.linalg.norm(forces.sum(axis=0)))
        sizes = float(np.linalg.norm(forces, axis=1).sum())
        return resultant if resultant > 1e-6 * sizes else 0.5 * sizes

    def stiffness(self, displacement: FloatArray, strain_energy: float) -> float:
        """Stiffness of the part, N/mm.

        Under forces ``F^2 / W`` with F their size (`force`) and W the work ``f . u``, taken as
        ``2 f . u - 2 U``: that is right to the square of the displacement's error. Under moving
        supports ``2 U / d^2`` with d the largest of their displacements.
        """
        if self._moving.any():
            largest = float(np.linalg.norm(self._support_motion, axis=1).max())
            return 2.0 * strain_energy / largest**2
        work = 2.0 * float(np.vdot(self.forces, displacement)) - 2.0 * strain_energy
        return self.force(np.zeros_like(displacement)) ** 2 / work

    @property
    def _moving(self) -> BoolArray:
        """Nodes (n,) that a support moves."""
        return (self._support_motion != 0.0).any(axis=1)

    @cached_property
    def _support_motion(self) -> FloatArray:
        """Displacement (n, 3), mm, that the supports ask for; zero elsewhere."""
        held = self.held
        return held.value if held.ties is None else held.ties.expand(held.value)


def _check_case(system: System, case: str) -> None:
    """Refuse a load case that no stiffness follows from."""
    if system.held_in(case).value.any() and system.forces_in(case).any():
        raise InputError(
            f"load case '{case}' has forces and moving supports; a virtual test needs one or "
            "the other: split it"
        )
    if any(isinstance(load, Temperature) for load in system.problem.loads_of(case)):
        raise InputError(
            f"load case '{case}' heats the part; a virtual test needs forces or moving supports: "
            "remove the temperature change"
        )
