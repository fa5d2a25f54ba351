"""What a solve will take, by the number of its unknowns, and what is said of it before."""

from dataclasses import dataclass

import numpy as np

from ccfem.fem.elasticity.plausibility import MOST_CELLS
from ccfem.fem.elasticity.problem import Problem

_SECONDS = {1: 40e-6, 2: 30e-6}
"""CPU time for each unknown of linear and quadratic cells (benchmarks/speed/solve_cost.py)."""
_BYTES = {1: 2.8e3, 2: 2.5e3}
"""Memory for each unknown, likewise."""
_PROGRAM = 0.4e9
"""Memory of the program itself, bytes."""


@dataclass(frozen=True)
class Cost:
    """What a solve will take, to a factor of two or so: CPU seconds a load case, and bytes.

    Unknowns are counted before supports; the order is that of the cells.
    """

    order: int
    unknowns: int
    seconds: float
    memory: float

    @property
    def about(self) -> str:
        """One phrase."""
        kind = "linear" if self.order == 1 else "quadratic"
        return (
            f"{kind} cells: {self.unknowns:,} unknowns, about {max(self.seconds, 1.0):.0f} s and "
            f"{self.memory / 1e9:.1f} GB"
        )


def solve_costs(problem: Problem) -> tuple[Cost, ...]:
    """Estimate what a solve takes: of each order of cells that it may come to."""
    mesh = problem.mesh
    linear, quadratic = len(mesh.points), len(mesh.points)
    if mesh.order == 1:
        edges = np.sort(mesh.cells[:, mesh.edges].reshape(-1, 2), axis=1)
        quadratic += len(np.unique(edges[:, 0] * len(mesh.points) + edges[:, 1]))
    if mesh.order == 2 or problem.order == 2:
        return (_cost(2, quadratic),)
    if problem.order == 1 or len(mesh.cells) > MOST_CELLS:
        return (_cost(1, linear),)
    return _cost(1, linear), _cost(2, quadratic)


def _cost(order: int, nodes: int) -> Cost:
    unknowns = 3 * nodes
    return Cost(order, unknowns, _SECONDS[order] * unknowns, _PROGRAM + _BYTES[order] * unknowns)


def about_quadratic(problem: Problem, why: str) -> str:
    """Say what the quadratic cells that "auto" takes cost, why, and how linear ones are kept."""
    return f"{solve_costs(problem)[-1].about}, because {why} (order = 1 keeps these)"
