"""SIMP: densities of least compliance for a given volume, by optimality criteria."""

from collections.abc import Mapping
from typing import Any

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.elasticity.problem import Problem
from ccfem.plates.problem import PlaneProblem
from ccfem.progress import Progress, silent
from ccfem.topopt.compliance import GroupedCompliance, compliance_of
from ccfem.topopt.design import Design
from ccfem.topopt.groups import CellGroups
from ccfem.topopt.iteration import Limits, iterate
from ccfem.topopt.parametrisation import parametrise

__all__ = ["simp"]


def simp(
    problem: PlaneProblem | Problem,
    volume_fraction: float,
    penalty: float = 3.0,
    radius: float = 2.5,
    filter: str = "sensitivity",
    *,
    weights: Mapping[str, float] | None = None,
    solid: BoolArray | None = None,
    void: BoolArray | None = None,
    start: FloatArray | None = None,
    groups: IntArray | None = None,
    least: float = 1e-9,
    move: float = 0.2,
    tolerance: float = 0.01,
    objective_tolerance: float = 1e-4,
    iterations: int = 200,
    backend: str = "auto",
    progress: Progress = silent,
) -> Design:
    """Find densities of least compliance with a given volume.

    Modified SIMP with optimality criteria (Andreassen et al., Struct. Multidisc. Optim. 43 (2011)
    1: the 88 lines), on plates and on linear tetrahedra alike.

    Parameters
    ----------
    problem : PlaneProblem or Problem
        With the stiffness of full density; supports at rest.
    volume_fraction : float in (0, 1)
        Of all cells, passive ones included.
    penalty : float, default 3
    radius : float, mm, default 2.5
        Of the filter.
    filter : str, default "sensitivity"
        "sensitivity" or "density".
    weights : mapping of load case name to float, optional
        Compliances are summed with these; default 1 each.
    solid, void : (m,) bool arrays, optional
        Cells that stay full or empty.
    start : (m,) array in [0, 1], optional
        Variables to start from (`Design.variables` to go on with a run); default uniform.
    groups : (m,) int array, optional
        Cells with the same number share one density: the columns of a plate of tetrahedra.
    least : float, default 1e-9
        Share of the stiffness that an empty cell keeps.
    move : float, default 0.2
        Largest change of a variable in one iteration.
    tolerance : float, default 0.01
        Stop when no variable changes more.
    objective_tolerance : float, default 1e-4
        Stop when the compliance changed less, relatively, over ten iterations; 0 for never.
    iterations : int, default 200
        Most iterations.
    backend : str, default "auto"
        Of the solves.
    progress : callable, optional
        Told the compliance, the volume and the change of each iteration.

    Returns
    -------
    Design

    Raises
    ------
    InputError
        For parameters out of range, and a volume that passive cells make impossible.
    SolveError
        When a solve misses its tolerance.
    """
    model: Any = compliance_of(problem, weights, backend)
    limits = Limits(volume_fraction, move, tolerance, objective_tolerance, iterations)
    cells = None if groups is None else CellGroups.of_cells(groups, len(model.volumes))
    if cells is not None:
        model = GroupedCompliance(model, cells.member)
        solid, void = cells.reduced("solid", solid), cells.reduced("void", void)
        start = cells.reduced("start", start)
    space = parametrise(model, volume_fraction, penalty, radius, filter, solid, void, least)
    design = iterate(problem, model, space, limits, start, progress)
    return design if cells is None else cells.expanded(design)
