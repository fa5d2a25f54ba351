"""The result of a solve: displacement, stress, reactions, and the record of the solve."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ccfem.arrays import FloatArray, freeze
from ccfem.elasticity.error_estimate import ErrorEstimate, estimate_error
from ccfem.elasticity.order import about_error
from ccfem.elasticity.part_stress import PartStress
from ccfem.elasticity.problem import Problem
from ccfem.elasticity.volume_loads import free_strain
from ccfem.errors import InputError
from ccfem.geometry.locate import locate_tets
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["SolveRecord", "StressField", "about_cells", "solved"]


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
        ``|f - K u| / (|K| |u| + |f|)``: how far equations that u solves exactly are from these.
    energy_error : float
        Bound of the energy norm of the error that the solve leaves, over that of u; NaN where it
        was not looked for.
    error : float
        Estimated energy norm of the error that the cells leave, over that of the exact solution;
        NaN where it was not looked for.
    order_because : str
        Which order of the displacement was chosen and why, where it was left open.
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


@dataclass(frozen=True)
class StressField:
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

    @property
    def findings(self) -> tuple[str, ...]:
        """One line for each thing worth knowing about the solution."""
        found = about_error(self.error.relative, self.problem)
        return (found,) if found else ()

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load."""
        return self.problem.held_or_loaded

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
        cell, weights = locate_tets(self.mesh.points, self.mesh.corners, points, tolerance)
        if (cell < 0).any():
            first = int(np.flatnonzero(cell < 0)[0])
            raise InputError(
                f"stress is known in the part only; {int((cell < 0).sum())} of {len(cell)} points "
                f"lie outside, the first at {np.round(points[first], 6).tolist()}: check the frame"
            )
        return np.einsum("qk,qkij->qij", weights, self.nodal[self.mesh.corners[cell]])


def about_cells(field: StressField) -> str:
    """Say in one line on what cells a solution stands, why, and what error they leave."""
    record, mesh = field.record, field.mesh
    why = f" ({record.order_because})" if record.order_because else ""
    kind = "linear" if mesh.order == 1 else "quadratic"
    return (
        f"{len(mesh.cells):,} {kind} cells{why}; estimated error {field.error.relative:.1%} in "
        "energy norm"
    )


def solved(stress: PartStress, purpose: str) -> StressField:
    """Return the stress as the result of a solve, for what has to solve the part again.

    Raises
    ------
    InputError
        When the stress was given; `purpose` says what cannot be done then.
    """
    if not isinstance(stress, StressField):
        raise InputError(
            f"{purpose} solves the part again and needs its problem; got stress without one: solve "
            "the part with ccfem.solve, or choose another strategy"
        )
    return stress
