"""Design of fields in two steps: for the stiffness alone, then also for levels at the border."""

from dataclasses import dataclass, replace
from typing import Any, Protocol

from ccfem.arrays import FloatArray
from ccfem.fibre_aware.border_levels import BorderLevels
from ccfem.fibre_aware.field_descent import TOLERANCE, FieldMetric, improved

__all__ = ["designed_fields", "drawn_to_borders"]

_AT_BORDERS = 0.4
"""Share of the evaluations in which levels are drawn to the border."""


class _Posed(Protocol):
    """A problem that fields are designed for.

    `StreamProblem` of one load case, `CasesProblem` of several, `StrengthProblem`.
    """

    @property
    def laplacian(self) -> Any: ...
    def evaluate(self, field: FloatArray, start: Any = None, tolerance: float = 1e-5) -> Any: ...
    def curvature(self, field: FloatArray, solution: Any) -> Any: ...
    def levels(self, field: FloatArray, solution: Any) -> BorderLevels: ...


@dataclass(frozen=True)
class _AtBorders:
    """The problem plus the cost of levels that lie farther from the border than they need to."""

    problem: _Posed
    levels: BorderLevels

    @property
    def laplacian(self) -> Any:
        return self.problem.laplacian

    def evaluate(self, field: FloatArray, start: Any, tolerance: float) -> Any:
        found = self.problem.evaluate(field, start, tolerance)
        cost, slope = self.levels.cost(field)
        return replace(found, value=found.value + cost, gradient=found.gradient + slope)


def designed_fields(
    problem: _Posed, start: FloatArray, evaluations: int
) -> tuple[FloatArray, Any, tuple[Any, ...]]:
    """Improve fields by L-BFGS, in unknowns of about even curvature.

    In the last evaluations the whole numbers of the fields are drawn to half a width inside the
    border, where it is stretched along the strands (`BorderLevels`).

    Parameters
    ----------
    problem : StreamProblem or CasesProblem
    start : (c,) array
    evaluations : int
        Maximum number of evaluations of the objective, one or a few solves each; at least 1.

    Returns
    -------
    field, objective, ratios
        As in `improved`; the objective is given without the cost of levels.
    """
    last = int(_AT_BORDERS * evaluations)
    before = problem.evaluate(start, tolerance=TOLERANCE)
    metric = FieldMetric.of(problem.curvature(start, before.solution))
    found = improved(problem, start, evaluations - last, metric, before.solution)
    if not last:
        return found
    field, objective, ratios = found
    field, objective, more = drawn_to_borders(problem, field, objective.solution, last)
    return field, objective, (*ratios, *more)


def drawn_to_borders(
    problem: _Posed, field: FloatArray, solution: Any, evaluations: int
) -> tuple[FloatArray, Any, tuple[Any, ...]]:
    """Improve fields (c,) further, and draw their whole numbers to the border.

    Parameters and results as in `designed_fields`, with the solution at the fields.
    """
    levels = problem.levels(field, solution)
    lifted = levels.lifted(field)
    metric = FieldMetric.of(problem.curvature(lifted, solution) + levels.curvature())
    posed = _AtBorders(problem, levels)
    field, drawn, ratios = improved(posed, lifted, evaluations, metric, solution)
    return field, problem.evaluate(field, drawn.solution, TOLERANCE), ratios
