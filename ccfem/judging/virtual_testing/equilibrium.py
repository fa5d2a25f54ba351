"""Equilibrium of the part with its fibres, bonded or carrying tension only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, freeze
from ccfem.base.checks import check_known, check_number
from ccfem.base.errors import SolveError
from ccfem.fem.elasticity.contact import check_pressed
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.solvers import preconditioned_cg
from ccfem.judging.virtual_testing.bars import Bars, bars
from ccfem.judging.virtual_testing.reinforced import Reduced, Reinforced
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strands import Strands

BONDED, TENSION = MODES = ("bonded", "tension")

_UPDATES = 30
"""Updates of the displacement after which to give up."""

_SETTLING = 1e-4
"""Residual below which the contact with supports is checked."""

_PROGRESS = 1e-2
"""Factor by which each update reduces the residual while the set of carrying fibres may change."""


@dataclass(frozen=True)
class Equilibrium:
    """Displacement of the part with its fibres.

    Attributes
    ----------
    displacement : (n, 3) array, mm
    matrix : Reinforced
        Stiffness of part and carrying fibres.
    strain : (s,) array
        Along each piece of fibre.
    carries : (s,) bool array
        Which pieces lend their stiffness.
    updates : int
        Solves until the set of carrying fibres and the displacement were converged.
    iterations : int
        Of conjugate gradients, over all updates.
    residual : float
        ``|f - K(u) u| / |f|``, with the carrying set of u itself.
    """

    displacement: FloatArray
    matrix: Reinforced
    strain: FloatArray
    carries: BoolArray
    updates: int
    iterations: int
    residual: float

    def __post_init__(self) -> None:
        freeze(self, displacement=float, strain=float, carries=bool)

    @property
    def work(self) -> float:
        """Twice the strain energy of part and fibres, N mm."""
        u = self.displacement.reshape(-1)
        return float(u @ (self.matrix @ u))


def equilibrium(
    specimen: Specimen,
    strands: Strands,
    axial_stiffness: float,
    mode: str = TENSION,
    known: Sequence[FloatArray] = (),
    tolerance: float = 1e-8,
) -> Equilibrium:
    """Find the displacement of a part with fibres.

    With fibres that carry tension only, the energy is convex and piecewise quadratic. Newton's
    method takes the fibres that the last displacement stretches, solves, and repeats until the
    residual with the new set meets the tolerance. Each solve uses conjugate gradients, with the
    factorisation of the part without fibres as preconditioner. The same iterations find the contact
    with supports that only press.

    Parameters
    ----------
    axial_stiffness : float, N
        EA of one strand.
    mode : str
        "bonded" (all fibres carry) or "tension" (those that are stretched).
    known : sequence of (n, 3) arrays, mm, optional
        Displacements of the same part with less and more fibre, the nearest last. The start is the
        mixture of them with the least energy. Default: the part without fibres.
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
    known = known or (specimen.unreinforced.displacement,)
    u, total = known[-1], 0
    held, forces = specimen.held.touching(u), specimen.forces
    most = _UPDATES if held.presses is None else 2 * _UPDATES
    pieces = bars(strands, specimen.system.problem.mesh)
    full = axial_stiffness * strands.share
    strain, carries = _state(pieces, u, mode)
    matrix = Reinforced(specimen.matrix, pieces, carries * full)
    if len(known) > 1 and held.presses is None:
        u = _mixed(matrix, forces, known)
        strain, carries = _state(pieces, u, mode)
        matrix = Reinforced(specimen.matrix, pieces, carries * full)
    part, x = _reduced(specimen, held), held.restrict(u)
    for update in range(most):
        reduced, rest, residual = _imbalance(part, matrix, held, x, forces)
        if residual <= max(tolerance, _SETTLING if held.presses is not None else 0.0):
            # Near enough to say which supports still press; with others the balance is another.
            internal = (matrix @ u.reshape(-1)).reshape(u.shape)
            following = held.following(u, internal - forces)
            if following is not held:
                held = following
                x = held.restrict(u)
                u, part = held.expand(x), _reduced(specimen, held)
                reduced, rest, residual = _imbalance(part, matrix, held, x, forces)
        if residual <= tolerance:
            check_pressed(held, (matrix @ u.reshape(-1)).reshape(u.shape) - forces, forces)
            return Equilibrium(u, matrix, strain, carries, update, total, residual)
        goal = max(0.5 * tolerance / residual, _PROGRESS if mode == TENSION else 0.0)
        step = preconditioned_cg(reduced, rest, specimen.solver, tolerance=min(goal, 0.5))
        total += step.iterations
        x = x + step.values
        u = held.expand(x)
        before = carries
        strain, carries = _state(pieces, u, mode)
        if (before != carries).any():
            matrix = Reinforced(specimen.matrix, pieces, carries * full)
    raise SolveError(
        f"virtual test: relative residual {residual:.1e} after {most} updates of the fibres "
        f"that carry tension, above the tolerance {tolerance:.1e}"
    )


def _imbalance(
    part: sp.bsr_array, matrix: Reinforced, held: Held, x: FloatArray, forces: FloatArray
) -> tuple[Reduced, FloatArray, float]:
    """Stiffness on the free components, the forces out of balance there, and their share."""
    reduced, rhs = Reduced(part, matrix, held), held.right_hand_side(matrix, forces)
    rest = rhs - reduced @ x
    return reduced, rest, float(np.linalg.norm(rest) / np.linalg.norm(rhs))


def _reduced(specimen: Specimen, held: Held) -> sp.bsr_array:
    """Stiffness of the part without fibres on the free components of the given contact."""
    return specimen.solver.matrix if held.presses is None else held.reduce(specimen.matrix)


def _mixed(matrix: Reinforced, forces: FloatArray, known: Sequence[FloatArray]) -> FloatArray:
    """Mixture of displacements (n, 3), by shares that add to 1, of least energy for a matrix."""
    last = known[-1]
    moves = np.array([(state - last).reshape(-1) for state in known[:-1]])
    images = np.array([matrix @ move for move in moves])
    rest = forces.reshape(-1) - matrix @ last.reshape(-1)
    shares = np.linalg.lstsq(moves @ images.T, moves @ rest, rcond=1e-12)[0]
    return last + (shares @ moves).reshape(last.shape)


def _state(pieces: Bars, displacement: FloatArray, mode: str) -> tuple[FloatArray, BoolArray]:
    """Strain (s,) of the pieces, and which of them carry."""
    strain = pieces.strain(displacement)
    return strain, strain > 0.0 if mode == TENSION else np.ones(len(strain), dtype=bool)
