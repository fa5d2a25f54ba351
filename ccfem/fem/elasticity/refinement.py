"""Refinement of the cells where the estimated error of a solution is large."""

from dataclasses import replace

import numpy as np

from ccfem.base.arrays import BoolArray, IntArray
from ccfem.base.checks import check_number
from ccfem.body.mesh.bisection import bisected
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.order import LARGEST_ERROR, MOST_CELLS
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField

_SHARE = 0.7
"""Share of the squared error in the cells that a round refines (Doerfler 1996)."""

_HALVINGS = 3
"""Largest number of times that a cell is halved in a round: its edges are then half as long."""

_ROUNDS = 8
"""Largest number of rounds."""


def refine(
    problem: Problem, error: float = LARGEST_ERROR, most_cells: int = MOST_CELLS // 3
) -> Problem:
    """Refine the cells of a problem until their estimated error is small enough.

    In every round the cells with most of the error (Doerfler, SIAM J. Numer. Anal. 33, 1996,
    1106-1124) are halved up to three times. The surface does not change: a curved wall gets more
    facets but is no rounder.

    Parameters
    ----------
    problem : Problem
        On quadratic cells, the corners are refined and the cells made quadratic again.
    error : float, default 0.1
        Estimated error, in energy norm, of the worst load case.
    most_cells : int, default 100,000
        Limit that no round exceeds. The error may then stay above what was asked for, and every
        solve says so.

    Returns
    -------
    Problem
        The same part, supports, loads and materials on the finer mesh.
    """
    check_number("error to refine to", error, above=0.0, below=1.0)
    if problem.mesh.order == 2:
        order = 2 if problem.order == "auto" else problem.order
        problem = replace(problem, mesh=problem.mesh.linear(), order=order)
    for _ in range(_ROUNDS):
        fields = solve(problem)
        worst = max(fields.values(), key=lambda field: field.record.error)
        if worst.record.error <= error:
            break
        # The error scales with edge length to the power of the order; three halvings halve an edge.
        wanted = 3.0 * np.log2(worst.record.error / error) / worst.mesh.order
        finer, chosen = problem, _worst(fields, error)
        for _ in range(int(np.clip(np.ceil(wanted), 1, _HALVINGS))):
            mesh, parent = bisected(finer.mesh, chosen)
            finer, chosen = _on(finer, mesh, parent), chosen[parent]
            if len(mesh.cells) > most_cells:
                return problem
        problem = finer
    return problem


def _worst(fields: dict[str, StressField], error: float) -> BoolArray:
    """Cells (m,) with most of the error of any load case whose error is above the wanted one."""
    chosen = np.zeros(len(next(iter(fields.values())).mesh.cells), dtype=bool)
    for field in fields.values():
        if field.record.error <= error:
            continue
        cells = field.error.cells
        order = np.argsort(-cells, kind="stable")
        held = np.cumsum(cells[order])
        chosen[order[: 1 + int(np.searchsorted(held, _SHARE * held[-1]))]] = True
    return chosen


def _on(problem: Problem, mesh: TetMesh, parent: IntArray) -> Problem:
    """Return a problem on finer cells, each of which is a piece of a previous one."""
    arrays = {
        name: value[parent]
        for name in ("axes", "density", "stiffness")
        if (value := getattr(problem, name)) is not None
    }
    regions = tuple(
        replace(region, cells=np.flatnonzero(np.isin(parent, region.cells)))
        for region in problem.regions
    )
    return replace(problem, mesh=mesh, regions=regions, **arrays)
