"""The iterations of a topology optimisation, and when they stop."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.progress import Progress
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.compliance import Response
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.parameters import Parameters
from ccfem.fem.topopt.parametrisation import Parametrisation

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
    density: FloatArray,
    gradient: FloatArray,
    volume: FloatArray,
    target: float,
    move: float,
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
