"""Linear or quadratic cells: which a solve takes on a mesh of linear ones, and why.

Linear tetrahedra lock in bending and where the material hardly changes its volume: one layer of
them through a plate shows a tenth of its deflection. What they leave of the error is estimated
with every solve; where it is too much, the part is solved again on quadratic cells.
"""

from dataclasses import replace

from ccfem.elasticity.conditioning import incompressibility
from ccfem.elasticity.problem import Problem

__all__ = ["LARGEST_ERROR", "MOST_CELLS", "about_error", "linear_locks", "on_quadratic"]

LARGEST_ERROR = 0.1
"""Estimated error, in energy norm, up to which cells are fine enough: 1 % of the displacement."""

_LOCKS = 2.0 * 1.45 / (3.0 * (1.0 - 2.0 * 0.45))
"""Bulk over shear modulus from which linear cells lock: Poisson's ratio 0.45."""

MOST_CELLS = 300_000
"""Cells up to which quadratic ones are taken by themselves: about 4 GB, minutes (measured)."""


def linear_locks(problem: Problem) -> bool:
    """Whether linear cells are known to be poor whatever the load: nu above 0.45."""
    if problem.stiffness is not None:
        count = len(problem.stiffness)
        sample = problem.stiffness[:: max(1, count // 1000)]
        return incompressibility(sample) > _LOCKS
    return any(incompressibility(m.stiffness) > _LOCKS for m, _ in problem.materials)


def about_error(error: float, problem: Problem) -> str:
    """Say what to do about an estimated error; empty where it is small enough.

    Parameters
    ----------
    error : float
        Energy norm of the error over that of the solution.
    problem : Problem
        As it was solved.
    """
    if not error > LARGEST_ERROR:
        return ""
    cure = "shorten the edges of the cells"
    if problem.mesh.order == 1:
        cure = "take quadratic cells (order = 2), or shorten the edges"
    return (
        f"the cells leave an estimated error of {error:.0%} in energy norm, about {error**2:.0%} "
        f"of the displacement: {cure}"
    )


def on_quadratic(problem: Problem) -> Problem:
    """Return the same problem on quadratic cells."""
    return replace(problem, mesh=problem.mesh.quadratic(), order=2)
