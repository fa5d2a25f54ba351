"""SIMP: densities of least compliance for a given volume, by optimality criteria."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.progress import Progress, silent
from ccfem.fem.elasticity import Problem
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.compliance import Compliance, Response
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.parametrisation import Parameters, Parametrisation


@dataclass(frozen=True)
class Simp(Parameters):
    """Densities of least compliance with a given volume.

    Modified SIMP with optimality criteria (Andreassen et al., Struct. Multidisc. Optim. 43 (2011)
    1: the 88 lines), on plates and on linear tetrahedra alike.

    Attributes
    ----------
    volume_fraction : float in (0, 1)
        Of all cells, passive ones included.
    penalty : float, default 3
        Exponent of the density in the stiffness, at least 1.
    radius : float, mm, default 2.5
        Of the filter.
    filter : str, default "sensitivity"
        "sensitivity" or "density".
    minimum_stiffness : float in (0, 1), default 1e-9
        Share of the stiffness that an empty cell keeps.
    move : float in (0, 1], default 0.2
        Largest change of a variable in one iteration.
    tolerance : float, default 0.01
        Stop when no variable changes by more; 0 for never.
    objective_tolerance : float, default 1e-4
        Stop when the compliance changed less, relatively, over ten iterations; 0 for never.
    max_iterations : int, default 200
    backend : str, default "auto"
        Of the solves.
    """

    def __call__(
        self,
        problem: PlaneProblem | Problem,
        *,
        weights: Mapping[str, float] | None = None,
        solid: BoolArray | None = None,
        void: BoolArray | None = None,
        groups: IntArray | None = None,
        start: FloatArray | None = None,
        progress: Progress = silent,
    ) -> Design:
        """Optimise a plate or a part.

        Parameters
        ----------
        problem : PlaneProblem or Problem
            With the stiffness of full density; supports at rest.
        weights : mapping of load case name to float, optional
            Compliances are summed with these; default 1 each.
        solid, void : (m,) bool arrays, optional
            Passive cells, which stay full or empty.
        groups : (m,) int array, optional
            Cells with the same number share one density: the columns of a plate of tetrahedra.
        start : (m,) array in [0, 1], optional
            Variables to start from (`Design.variables` to continue a run); default uniform.
        progress : callable, optional
            Told the compliance, volume and change of each iteration.

        Raises
        ------
        InputError
            For data that do not fit the problem, and a volume that passive cells make impossible.
        SolveError
            When a solve misses its tolerance.
        """
        part = Compliance(problem, weights, self.backend, groups)
        space = Parametrisation.of_part(self, part, solid, void)
        return iterate(problem, part, space, start, progress)[0]


# Densities of a part in space, as the brackets that come with ccfem are optimised.


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
    """
    method = Simp(
        volume_fraction,
        radius=max(3.0, 1.6 * element_size),
        minimum_stiffness=1e-6,
        tolerance=0.0,
        max_iterations=max_iterations,
    )
    return method(problem, solid=solid, progress=progress)


# The iterations of a topology optimisation, and when they stop.


_WINDOW = 10
"""Iterations over which the objective must not change."""

ModelT = TypeVar("ModelT", bound=Callable[[FloatArray], Response])
"""Response of a part to factors (g,) on the stiffness of its groups of cells."""


def iterate(
    problem: PlaneProblem | Problem,
    model: ModelT,
    space: Parametrisation,
    start: FloatArray | None,
    progress: Progress,
    turn: Callable[[ModelT, Response, FloatArray], ModelT] | None = None,
) -> tuple[Design, ModelT]:
    """Iterate to convergence: the design of a problem, and the model of the last iteration.

    The problem is that of full density. `turn`, where given, makes the model of the next iteration
    from that of this one, its response and the factors (g,); start and progress as in `Simp`.
    """
    parameters, volumes, free = space.parameters, space.cone.volumes, space.free
    variables, per_volume = space.start(start), space.volume_gradient()[free]
    # Cells that are not free hold a part of the volume, whatever the design.
    fixed = float(space.density(np.where(free, 0.0, variables)) @ volumes)
    target = parameters.volume_fraction * float(volumes.sum()) - fixed
    compliance: list[float] = []
    changes: list[float] = []
    while True:
        density = space.density(variables)
        factor = space.factor(density)
        response = model(factor)
        compliance.append(response.compliance)
        converged = _converged(compliance, changes, parameters)
        if converged or len(changes) == parameters.max_iterations:
            break
        # Response, sensitivities through the filter, update under the constraint on the volume.
        gradient = space.sensitivities(variables, density, response.energy)
        updated = variables.copy()
        updated[free] = optimality_criteria(
            variables[free], gradient[free], per_volume, target, parameters.move
        )
        changes.append(float(np.abs(updated - variables).max()))
        variables = updated
        if turn is not None:
            model = turn(model, response, factor)
        share = float(volumes @ density / volumes.sum())
        progress(
            f"iteration {len(changes)}: compliance {compliance[-1]:.5g}, volume {share:.4f}, "
            f"change {changes[-1]:.3f}",
            len(changes) / parameters.max_iterations,
        )
    member = space.cells.member
    design = Design(
        full=problem,
        density=density[member],
        variables=variables[member],
        factor=factor[member],
        compliance=np.array(compliance),
        change=np.array(changes),
        converged=converged,
    )
    return design, model


def _converged(compliance: list[float], changes: list[float], parameters: Parameters) -> str:
    """Name what has converged, if anything."""
    if changes and changes[-1] < parameters.tolerance:
        return "change"
    if len(compliance) > _WINDOW:
        recent = np.array(compliance[-_WINDOW - 1 :])
        if np.abs(recent - recent[-1]).max() < parameters.objective_tolerance * recent[-1]:
            return "objective"
    return ""


# The optimality criteria update of densities under one constraint on the volume.


def optimality_criteria(
    density: FloatArray, gradient: FloatArray, volume: FloatArray, target: float, move: float
) -> FloatArray:
    """Densities in [0, 1] that balance gain and volume (Bendsoe, Struct. Optim. 1 (1989) 193).

    Parameters
    ----------
    density : (m,) array
    gradient : (m,) array
        Of the objective by each density; positive entries count as zero.
    volume : (m,) array
        Of the total volume by each density, positive.
    target : float
        Wanted ``volume @ density``.
    move : float
        Largest change of a density.

    Returns
    -------
    (m,) array
        ``clip(density * sqrt(-gradient / (multiplier * volume)))`` with the multiplier found by
        bisection; on the nearest bound where the target is out of reach.
    """
    low = np.maximum(0.0, density - move)
    high = np.minimum(1.0, density + move)
    gain = np.maximum(0.0, -gradient) / volume
    root = density * np.sqrt(gain)
    largest = float(np.sqrt(gain.max()))
    if not largest > 0.0:
        return np.clip(density, low, high)
    # Bisection of the logarithm of the root of the multiplier, over 16 decades.
    least, most = np.log(largest) - 18.5, np.log(largest) + 18.5
    for _ in range(60):
        middle = 0.5 * (least + most)
        density_at = np.minimum(high, np.maximum(low, root * np.exp(-middle)))
        excess = float(volume @ density_at) - target
        if abs(excess) <= 1e-9 * target:
            break
        least, most = (middle, most) if excess > 0.0 else (least, middle)
    return density_at
