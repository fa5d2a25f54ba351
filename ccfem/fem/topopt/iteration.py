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
from ccfem.fem.topopt.optimality_criteria import optimality_criteria
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
        gradient = space.sensitivities(variables, density, response.energy)
        found = variables.copy()
        found[free] = optimality_criteria(
            variables[free], gradient[free], per_volume, target, parameters.move
        )
        changes.append(float(np.abs(found - variables).max()))
        variables = found
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
