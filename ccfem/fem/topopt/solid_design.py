"""Densities of a part in space, as the brackets that come with ccfem are optimised."""

from ccfem.base.arrays import BoolArray
from ccfem.base.progress import Progress, silent
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.simp import Simp


def solid_design(
    problem: Problem,
    volume_fraction: float,
    element_size: float,
    solid: BoolArray,
    max_iterations: int,
    progress: Progress = silent,
) -> Design:
    """Optimise a part of tetrahedra for the sum of the compliances of its load cases.

    By `Simp`, until the compliance no longer changes; the filter reaches over 1.6 cells, and 3 mm
    at least.

    Parameters
    ----------
    problem : Problem
        Of linear tetrahedra.
    volume_fraction : float in (0, 1)
    element_size : float, mm
        Of its cells.
    solid : (m,) bool array
        Cells that stay full.
    progress : callable, optional
    """
    method = Simp(
        volume_fraction,
        radius=max(3.0, 1.6 * element_size),
        minimum_stiffness=1e-6,
        tolerance=0.0,
        max_iterations=max_iterations,
    )
    return method(problem, solid=solid, progress=progress)
