"""Equilibrium of a part on supports that only press, with the contact that results."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, SolveError
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.solution import Solution
from ccfem.fem.elasticity.solvers import Solver

EXPECTED = 8
"""Number of solves expected until a contact has converged."""

_ROUGH = 1e-4
"""Relative residual of the solves until the contact has converged."""

_ROUNDS = 200
"""Largest number of changes of the contact: a slender part lifts off cell by cell."""

_SLOW = 40
"""Iterations above which a factorisation with the present contact pays off."""

_CARRIED = 1e-4
"""Share of the load that may be carried by what keeps a loose part in place."""


@dataclass(frozen=True)
class Contact:
    """Solution on supports that only press.

    Attributes
    ----------
    held : Held
        The supports with the converged contact.
    solver : Solver
        For the matrix with this contact, for further load cases.
    right : (n,) array
        Right-hand side.
    iterations : int
        Of conjugate gradients, over all rounds.
    """

    held: Held
    solver: Solver
    right: FloatArray
    solution: Solution
    iterations: int


def find_contact(
    matrix: sp.bsr_array,
    held: Held,
    forces: FloatArray,
    solver: Solver,
    tolerance: float,
) -> Contact:
    """Solve, release components that pull and hold those that sink in, until nothing changes.

    The first round is solved with all components in contact. A direct backend then renews its
    factorisation with the same ordering. With multigrid, the following rounds use conjugate
    gradients with the preconditioner of the first round, which is renewed where they are slow.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n), N/mm
    held : Held
        With all components in contact.
    forces : (n, 3) array, N
    solver : Solver
        For the matrix with these supports, in any contact; it may be invalidated.
    tolerance : float
        Relative residual of the solution.

    Raises
    ------
    InputError
        Where the load lifts the part off its supports.
    SolveError
        Where a solve fails, or the contact does not converge.
    """
    start, slow, total, goal = None, False, 0, max(tolerance, _ROUGH)
    for _ in range(_ROUNDS):
        rhs = held.right_hand_side(matrix, forces)
        reduced = held.reduce(matrix)
        if not np.array_equal(reduced.data, solver.matrix.data):
            renewed = slow or solver.exact
            solver = solver.refactorise(reduced) if renewed else replace(solver, matrix=reduced)
        solution = solver.solve(rhs, start, goal)
        total += solution.iterations
        slow = solution.iterations > _SLOW
        displacement = held.expand(solution.values)
        internal = (matrix @ displacement.reshape(-1)).reshape(forces.shape)
        following = held.following(displacement, internal - forces)
        # The contact is found with a rough residual, then kept where it stays with the wanted one.
        if following is held and goal > tolerance:
            goal = tolerance
        elif following is held:
            check_pressed(held, internal - forces, forces)
            return Contact(held, solver, rhs, solution, total)
        held = following
        start = held.restrict(displacement)
    raise SolveError(
        f"contact did not converge in {_ROUNDS} iterations; the part barely touches its pressing "
        "supports: add a support, or use a finer mesh"
    )


def check_pressed(held: Held, reactions: FloatArray, forces: FloatArray) -> None:
    """Refuse a part that the load lifts off its supports.

    Parameters
    ----------
    reactions : (n, 3) array, N
        Reactions of all supports, and of what keeps a loose part in place.
    forces : (n, 3) array, N
        Of the load.
    """
    if held.presses is None:
        return
    carried = float(np.abs(held.along_pressing(reactions)[~held.contact]).sum())
    if carried > _CARRIED * float(np.linalg.norm(forces, axis=1).sum()):
        raise InputError(
            "the load lifts the part off its supports that only press, so nothing holds it: hold "
            "it by another support, or turn the load round"
        )
