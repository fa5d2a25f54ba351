"""Equilibrium of the part with its fibres, bonded or carrying tension only."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import BoolArray, FloatArray, freeze
from ccfem.checks import check_known, check_number
from ccfem.elasticity.contact import check_pressed
from ccfem.elasticity.solvers import preconditioned_cg
from ccfem.errors import SolveError
from ccfem.virtual_testing.bars import bar_matrix, strain_operator
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strands import Strands

__all__ = ["BONDED", "MODES", "TENSION", "Equilibrium", "equilibrium"]

BONDED, TENSION = MODES = ("bonded", "tension")

_UPDATES = 30
"""Updates of the displacement after which to give up."""

_SETTLING = 1e-4
"""Residual from which on what the part touches is looked at."""

_PROGRESS = 1e-2
"""What each update leaves of the residual, as long as the set of carrying fibres may change."""


@dataclass(frozen=True)
class Equilibrium:
    """Displacement of the part with its fibres.

    Attributes
    ----------
    displacement : (n, 3) array, mm
    matrix : bsr_array (3n, 3n), N/mm
        Stiffness of part and carrying fibres.
    strain : (s,) array
        Along each piece of fibre.
    carries : (s,) bool array
        Which pieces lend their stiffness.
    updates : int
        Solves until the set of carrying fibres and the displacement were settled.
    iterations : int
        Of conjugate gradients, over all updates.
    residual : float
        ``|f - K(u) u| / |f|``, with the carrying set of u itself.
    """

    displacement: FloatArray
    matrix: sp.bsr_array
    strain: FloatArray
    carries: BoolArray
    updates: int
    iterations: int
    residual: float

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float, carries=bool)


def equilibrium(
    specimen: Specimen,
    strands: Strands,
    axial_stiffness: float,
    mode: str = TENSION,
    start: FloatArray | None = None,
    tolerance: float = 1e-8,
) -> Equilibrium:
    """Find the displacement of a part with fibres.

    With fibres that carry tension only the energy is convex and piecewise quadratic; Newton's
    method on it takes the fibres that the last displacement stretches, solves, and repeats until
    the residual with the new set meets the tolerance. Each solve is a conjugate gradient with the
    factorisation of the part without fibres as preconditioner. What the part touches of supports
    that only press is found in the same rounds.

    Parameters
    ----------
    specimen : Specimen
    strands : Strands
    axial_stiffness : float, N
        EA of one strand.
    mode : str
        "bonded" (all fibres carry) or "tension" (those that are stretched).
    start : (n, 3) array, mm, optional
        Where to start; default the part without fibres.
    tolerance : float
        Largest relative residual that is accepted.

    Raises
    ------
    InputError
        For an unknown mode or an impossible stiffness.
    SolveError
        When the residual stays above the tolerance.
    """
    check_known("mode", mode, MODES)
    check_number("axial stiffness", axial_stiffness, at_least=0.0, unit="N")
    u = specimen.unreinforced.displacement if start is None else start
    held, forces = specimen.held.touching(u), specimen.forces
    most = _UPDATES if held.presses is None else 2 * _UPDATES
    x, total = held.restrict(u), 0
    operator = strain_operator(strands, specimen.system.problem.mesh)
    strain, carries = _state(operator, u, mode)
    matrix = _reinforced(specimen, strands, axial_stiffness, carries)
    reduced, rhs = held.reduce(matrix), held.right_hand_side(matrix, forces)
    for update in range(most):
        rest = rhs - reduced @ x
        residual = float(np.linalg.norm(rest) / np.linalg.norm(rhs))
        if residual <= max(tolerance, _SETTLING if held.presses is not None else 0.0):
            internal = (matrix @ u.reshape(-1)).reshape(u.shape)
            following = held.following(u, internal - forces)
            if following is not held:
                held = following
                x = held.restrict(u)
                u = held.expand(x)
                reduced, rhs = held.reduce(matrix), held.right_hand_side(matrix, forces)
                rest = rhs - reduced @ x
                residual = float(np.linalg.norm(rest) / np.linalg.norm(rhs))
        if residual <= tolerance:
            check_pressed(held, (matrix @ u.reshape(-1)).reshape(u.shape) - forces, forces)
            return Equilibrium(u, matrix, strain, carries, update, total, residual)
        goal = max(0.5 * tolerance / residual, _PROGRESS if mode == TENSION else 0.0)
        step = preconditioned_cg(reduced, rest, specimen.solver, tolerance=min(goal, 0.5))
        total += step.iterations
        x = x + step.values
        u = held.expand(x)
        before = carries
        strain, carries = _state(operator, u, mode)
        if (before != carries).any():
            matrix = _reinforced(specimen, strands, axial_stiffness, carries)
            reduced, rhs = held.reduce(matrix), held.right_hand_side(matrix, forces)
    raise SolveError(
        f"virtual test: relative residual {residual:.1e} after {most} updates of the fibres "
        f"that carry tension, above the tolerance {tolerance:.1e}"
    )


def _state(
    operator: sp.csr_array, displacement: FloatArray, mode: str
) -> tuple[FloatArray, BoolArray]:
    """Strain (s,) of the pieces, and which of them carry."""
    strain = operator @ displacement.reshape(-1)
    return strain, strain > 0.0 if mode == TENSION else np.ones(len(strain), dtype=bool)


def _reinforced(
    specimen: Specimen, strands: Strands, axial_stiffness: float, carries: BoolArray
) -> sp.bsr_array:
    """Stiffness matrix (3n, 3n), N/mm, of the part and the pieces of fibre (s,) that carry."""
    system = specimen.system
    bars = bar_matrix(strands, system.problem.mesh, system.where, carries * strands.share)
    data = specimen.matrix.data + axial_stiffness * bars.data
    return sp.bsr_array((data, bars.indices, bars.indptr), shape=bars.shape)
