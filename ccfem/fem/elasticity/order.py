"""Choice of linear or quadratic cells for a solve on a mesh of linear ones.

Linear tetrahedra lock in bending, and where the material is nearly incompressible: one layer of
them through a plate shows a tenth of its deflection. The error they leave is estimated with every
solve. If it is too large, the part is solved again on quadratic cells.
"""

from dataclasses import replace

from ccfem.fem.elasticity.conditioning import incompressibility
from ccfem.fem.elasticity.problem import Problem

LARGEST_ERROR = 0.1
"""Estimated error, in energy norm, up to which cells are fine enough: 1 % of the displacement."""

_LOCKS = 2.0 * 1.45 / (3.0 * (1.0 - 2.0 * 0.45))
"""Bulk over shear modulus above which linear cells lock: Poisson's ratio 0.45."""

MOST_CELLS = 300_000
"""Number of cells up to which quadratic ones are chosen automatically: about 4 GB, minutes
(measured)."""


def linear_locks(problem: Problem) -> bool:
    """Whether linear cells are known to be poor under any load: nu above 0.45."""
    if problem.stiffness is not None:
        count = len(problem.stiffness)
        sample = problem.stiffness[:: max(1, count // 1000)]
        return incompressibility(sample) > _LOCKS
    return any(incompressibility(m.stiffness) > _LOCKS for m, _ in problem.materials)


def about_error(error: float, problem: Problem) -> str:
    """Say what to do about an estimated error; empty if it is small enough.

    Parameters
    ----------
    error : float
        Energy norm of the error over that of the solution.
    problem : Problem
        The problem as it was solved.
    """
    if not error > LARGEST_ERROR:
        return ""
    cure = "use smaller cells"
    if problem.mesh.order == 1:
        cure = "use quadratic cells (order = 2), or smaller cells"
    return (
        f"the cells leave an estimated error of {error:.0%} in energy norm, about {error**2:.0%} "
        f"of the displacement: {cure}"
    )


def on_quadratic(problem: Problem) -> Problem:
    """Return the same problem on quadratic cells."""
    return replace(problem, mesh=problem.mesh.quadratic(), order=2)
