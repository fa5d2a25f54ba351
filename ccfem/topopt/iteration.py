"""The iterations of a topology optimisation, and when they stop."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.elasticity.problem import Problem
from ccfem.errors import InputError
from ccfem.plates.problem import PlaneProblem
from ccfem.progress import Progress
from ccfem.topopt.design import Design
from ccfem.topopt.optimality_criteria import optimality_criteria
from ccfem.topopt.parametrisation import Parametrisation, simp_factor

__all__ = ["Limits", "iterate"]

_WINDOW = 10
"""Iterations over which the objective must stand still."""


@dataclass(frozen=True)
class Limits:
    """When to stop, and how far to go in an iteration: see `simp`."""

    volume_fraction: float
    move: float
    tolerance: float
    objective_tolerance: float
    iterations: int

    def __post_init__(self) -> None:
        if not 0.0 < self.move <= 1.0 or self.iterations < 1:
            raise InputError(
                f"expected 0 < move <= 1 and at least one iteration; got {self.move} and "
                f"{self.iterations}"
            )


def _start(
    start: FloatArray | None, space: Parametrisation, volumes: FloatArray, share: float
) -> FloatArray:
    """Variables to begin with: given, or uniform where they are free."""
    if start is not None:
        variables = np.array(start, dtype=np.float64)
        if variables.shape != volumes.shape or not ((variables >= 0) & (variables <= 1)).all():
            raise InputError(
                f"start must be {len(volumes)} densities in [0, 1]; got shape {variables.shape}"
            )
    else:
        rest = share * volumes.sum() - volumes[space.solid].sum()
        variables = np.full(len(volumes), rest / volumes[space.free].sum())
    variables[space.solid], variables[space.void] = 1.0, 0.0
    return variables


def iterate(
    problem: PlaneProblem | Problem,
    model: Any,
    space: Parametrisation,
    limits: Limits,
    start: FloatArray | None,
    progress: Progress,
) -> Design:
    """Iterate to convergence; `model` answers to factors as `PlaneCompliance` does."""
    volumes, free = model.volumes, space.free
    variables = _start(start, space, volumes, limits.volume_fraction)
    per_volume = space.volume_gradient()[free]
    fixed = float(space.density(np.where(free, 0.0, variables)) @ volumes)
    target = limits.volume_fraction * float(volumes.sum()) - fixed
    compliance: list[float] = []
    changes: list[float] = []
    converged = ""
    while True:
        density = space.density(variables)
        factor, _ = simp_factor(density, space.penalty, space.least)
        answer = model(factor)
        compliance.append(answer.compliance)
        converged = _converged(compliance, changes, limits)
        if converged or len(changes) == limits.iterations:
            break
        gradient = space.gradient(density, answer.energy)
        if space.filter == "sensitivity":
            gradient = space.cone.sensitivities(variables, gradient)
        found = variables.copy()
        found[free] = optimality_criteria(
            variables[free], gradient[free], per_volume, target, limits.move
        )
        changes.append(float(np.abs(found - variables).max()))
        variables = found
        share = float(volumes @ density / volumes.sum())
        progress(
            f"iteration {len(changes)}: compliance {compliance[-1]:.5g}, volume {share:.4f}, "
            f"change {changes[-1]:.3f}",
            len(changes) / limits.iterations,
        )
    return Design(
        full=problem,
        density=density,
        variables=variables,
        factor=factor,
        compliance=np.array(compliance),
        change=np.array(changes),
        converged=converged,
    )


def _converged(compliance: list[float], changes: list[float], limits: Limits) -> str:
    """Name what has converged, if anything."""
    if changes and changes[-1] < limits.tolerance:
        return "change"
    if len(compliance) > _WINDOW:
        recent = np.array(compliance[-_WINDOW - 1 :])
        if np.abs(recent - recent[-1]).max() < limits.objective_tolerance * recent[-1]:
            return "objective"
    return ""
