"""SIMP: densities of least compliance for a given volume, by optimality criteria."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.arrays import BoolArray, FloatArray, IntArray
from ccfem.elasticity.plane_problem import PlaneProblem
from ccfem.elasticity.problem import Problem
from ccfem.errors import InputError
from ccfem.progress import Progress, silent
from ccfem.topopt.compliance import (
    GroupedCompliance,
    PlaneCompliance,
    TetCompliance,
    compliance_of,
)
from ccfem.topopt.criteria import optimality_criteria
from ccfem.topopt.design import Design
from ccfem.topopt.filters import ConeFilter

__all__ = ["FILTERS", "Parametrisation", "simp", "simp_factor"]

FILTERS = ("sensitivity", "density")

_WINDOW = 10
"""Iterations over which the objective must stand still (addendum of the prototype, A6)."""


def simp_factor(
    density: FloatArray, penalty: float = 3.0, least: float = 1e-9
) -> tuple[FloatArray, FloatArray]:
    """Factor (m,) on the stiffness, and its derivative by the density (m,).

    ``least + density**penalty * (1 - least)`` (Sigmund, Struct. Multidisc. Optim. 33 (2007) 401).
    """
    factor = least + density**penalty * (1.0 - least)
    return factor, penalty * density ** (penalty - 1.0) * (1.0 - least)


@dataclass(frozen=True)
class Parametrisation:
    """How variables become densities and stiffness, with the gradients back.

    Attributes
    ----------
    cone : ConeFilter
    filter : str
        One of `FILTERS`.
    penalty, least : float
        Of `simp_factor`.
    solid, void : (m,) bool arrays
        Cells whose density stays 1 or 0.
    """

    cone: ConeFilter
    filter: str
    penalty: float
    least: float
    solid: BoolArray
    void: BoolArray

    @property
    def free(self) -> BoolArray:
        """Cells whose density is to be found, (m,)."""
        return ~(self.solid | self.void)

    def density(self, variables: FloatArray) -> FloatArray:
        """Densities (m,) of the variables (m,)."""
        density = self.cone.average(variables) if self.filter == "density" else variables.copy()
        density[self.solid], density[self.void] = 1.0, 0.0
        return density

    def gradient(self, density: FloatArray, energy: FloatArray) -> FloatArray:
        """Differentiate the compliance by the variables, exactly: (m,) array.

        Parameters
        ----------
        density : (m,) array
        energy : (m,) array, N mm
            ``u^T k u`` of each cell at full density.
        """
        _, slope = simp_factor(density, self.penalty, self.least)
        own = np.where(self.free, -slope * energy, 0.0)
        return self.cone.transposed(own) if self.filter == "density" else own

    def volume_gradient(self) -> FloatArray:
        """Differentiate the volume by the variables: (m,) array, mm^3."""
        own = np.where(self.free, self.cone.volumes, 0.0)
        return self.cone.transposed(own) if self.filter == "density" else own


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
    settings = (volume_fraction, penalty, radius, filter)
    if groups is None:
        space = parametrise(model, *settings, solid, void, least)
        return iterate(problem, model, space, limits, start, progress)
    member, first = _grouped(groups, len(model.volumes))
    solid = None if solid is None else np.asarray(solid)[first]
    void = None if void is None else np.asarray(void)[first]
    model = GroupedCompliance(model, member)
    space = parametrise(model, *settings, solid, void, least)
    start = None if start is None else np.asarray(start)[first]
    design = iterate(problem, model, space, limits, start, progress)
    return replace(
        design,
        density=design.density[member],
        variables=design.variables[member],
        factor=design.factor[member],
    )


def _grouped(groups: IntArray, m: int) -> tuple[IntArray, IntArray]:
    """Give groups numbers from 0 without gaps: that of each cell, and a cell of each group."""
    given = np.asarray(groups)
    if given.shape != (m,) or not np.issubdtype(given.dtype, np.integer):
        raise InputError(f"groups must be {m} integers, one a cell; got shape {given.shape}")
    _, first, member = np.unique(given, return_index=True, return_inverse=True)
    return member.reshape(-1), first


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


def parametrise(
    model: PlaneCompliance | TetCompliance | GroupedCompliance,
    volume_fraction: float,
    penalty: float,
    radius: float,
    filter: str,
    solid: BoolArray | None,
    void: BoolArray | None,
    least: float,
) -> Parametrisation:
    """Check the parameters of an optimisation and make its filter."""
    m = len(model.volumes)
    if not 0.0 < volume_fraction < 1.0 or not penalty >= 1.0 or not 0.0 < least < 1.0:
        raise InputError(
            f"expected 0 < volume fraction < 1, penalty >= 1 and 0 < least < 1; got "
            f"{volume_fraction}, {penalty} and {least}"
        )
    if filter not in FILTERS:
        raise InputError(f"no filter named '{filter}'; there are: {', '.join(FILTERS)}")
    passive = []
    for name, chosen in (("solid", solid), ("void", void)):
        mask = np.zeros(m, dtype=bool) if chosen is None else np.asarray(chosen)
        if mask.shape != (m,) or mask.dtype != np.bool_:
            raise InputError(f"{name} must be a bool array of shape ({m},); got {mask.shape}")
        passive.append(mask)
    if (passive[0] & passive[1]).any():
        raise InputError("a cell cannot be both solid and void: correct the masks")
    filled, empty = (float(model.volumes[mask].sum()) for mask in passive)
    total = float(model.volumes.sum())
    if not filled < volume_fraction * total < total - empty:
        raise InputError(
            f"volume fraction {volume_fraction} cannot be met: solid cells fill "
            f"{filled / total:.3g} and void cells {empty / total:.3g} of the volume"
        )
    cone = ConeFilter.of_cells(model.centres, model.volumes, radius)
    return Parametrisation(cone, filter, penalty, least, *passive)


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
