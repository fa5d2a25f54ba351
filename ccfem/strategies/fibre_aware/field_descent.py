"""Design of fields by L-BFGS, preconditioned by a positive definite matrix.

There are two steps: for the objective alone, then also for levels at the border.
"""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from scipy.optimize import minimize
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import SolveError
from ccfem.strategies.fibre_aware.border_levels import BorderLevels

_AT_BORDERS = 0.4
"""Share of the evaluations in which levels are drawn to the border."""

_MEMORY = 20
"""Steps that L-BFGS remembers."""

_PREPARED = 16
"""Evaluations after which the solves are prepared for the fibre of the field then."""

_REACH = 1.0
"""Radius of the filter, in squares of the grid."""

TOLERANCE = 5e-3
"""Relative residual of the solves of a design. The error of the compliance is its square."""


@dataclass(frozen=True)
class FieldMetric:
    """Unknowns x of a field s, with ``x.x = s.A s`` for a positive definite matrix A.

    A descent method that knows nothing of its objective treats all directions of its unknowns as
    equal. They are about equal where A approximates the second derivative of the objective. With
    ``A = C C^T`` the field is ``A^-1 C x``.

    Attributes
    ----------
    factor : SuperLU
        Of A, (c, c).
    root : sparse (c, c) array
        C.
    """

    factor: Any
    root: Any

    @classmethod
    def of(cls, matrix: Any) -> "FieldMetric":
        """Metric of a symmetric positive definite sparse matrix (c, c)."""
        options = {"SymmetricMode": True}
        order = "MMD_AT_PLUS_A"
        factor = splu(sp.csc_array(matrix), order, diag_pivot_thresh=0.0, options=options)
        pivot = factor.U.diagonal()
        if pivot.min() <= 0.0 or (factor.perm_r != factor.perm_c).any():
            raise SolveError("metric of fields: the matrix is not positive definite")
        root = (factor.L @ sp.diags_array(np.sqrt(pivot))).tocsr()
        return cls(factor, root[factor.perm_r].tocsc())

    def unknowns(self, field: FloatArray) -> FloatArray:
        """Unknowns (c,) of a field (c,)."""
        return np.asarray(self.root.T @ field)

    def field(self, unknowns: FloatArray) -> FloatArray:
        """Field (c,) of unknowns (c,)."""
        return np.asarray(self.factor.solve(self.root @ unknowns))

    def pulled(self, gradient: FloatArray) -> FloatArray:
        """Turn a derivative (c,) by the field into that by the unknowns."""
        return np.asarray(self.root.T @ self.factor.solve(gradient))


class _Evaluated(Protocol):
    """An objective that `improved` can minimise."""

    @property
    def laplacian(self) -> Any: ...

    def evaluate(self, field: FloatArray, start: Any, tolerance: float) -> Any: ...
    def prepared(self, field: FloatArray, solutions: Any) -> "_Evaluated": ...


def improved(
    problem: _Evaluated,
    start: FloatArray,
    evaluations: int,
    metric: FieldMetric | None = None,
    solution: Any = None,
) -> tuple[FloatArray, Any, tuple[Any, ...]]:
    """Return coefficients, the objective there, and stiffness ratios at all evaluations of L-BFGS.

    The solves start from a solution, if one is given. The default metric is that of
    ``(1 + Laplacian)^2``, with the Laplacian in squares of the grid.
    """
    if metric is None:
        smoother = sp.eye_array(len(start)) + _REACH**2 * problem.laplacian
        metric = FieldMetric.of(smoother @ smoother)
    tried: list[tuple[FloatArray, Any]] = []
    ratios: list[Any] = []
    near = [problem]

    def objective(x: FloatArray) -> tuple[float, FloatArray]:
        field = metric.field(x)
        # The last solution is near to this one; the best one is to be returned.
        last = tried[-1][1].solution if tried else solution
        if len(ratios) == _PREPARED:
            near[0] = problem.prepared(field, last)
        objective_at = near[0].evaluate(field, last, TOLERANCE)
        ratios.append(objective_at.ratio)
        if len(tried) == 2:
            tried.pop() if tried[0][1].value <= tried[1][1].value else tried.pop(0)
        tried.append((field, objective_at))
        return objective_at.value, metric.pulled(objective_at.gradient)

    options = {"maxfun": evaluations, "maxiter": evaluations, "maxcor": _MEMORY, "ftol": 1e-9}
    minimize(objective, metric.unknowns(start), jac=True, method="L-BFGS-B", options=options)
    field, evaluated = min(tried, key=lambda trial: trial[1].value)
    return field, evaluated, tuple(ratios)


class _Posed(Protocol):
    """A problem that fields are designed for: `StreamProblem` or `StrengthProblem`."""

    @property
    def laplacian(self) -> Any: ...
    def evaluate(self, field: FloatArray, start: Any = None, tolerance: float = 1e-5) -> Any: ...
    def prepared(self, field: FloatArray, solutions: Any = None) -> "_Posed": ...
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

    def prepared(self, field: FloatArray, solutions: Any) -> "_AtBorders":
        return replace(self, problem=self.problem.prepared(field, solutions))

    def evaluate(self, field: FloatArray, start: Any, tolerance: float) -> Any:
        objective = self.problem.evaluate(field, start, tolerance)
        cost, slope = self.levels.cost(field)
        return replace(objective, value=objective.value + cost, gradient=objective.gradient + slope)


def designed_fields(
    problem: _Posed, start: FloatArray, evaluations: int
) -> tuple[FloatArray, Any, tuple[Any, ...]]:
    """Improve fields by L-BFGS, in unknowns of about even curvature.

    In the last evaluations the whole numbers of the fields are drawn to half a width inside the
    border, where it is stretched along the strands (`BorderLevels`).

    Parameters
    ----------
    start : (c,) array
    evaluations : int
        Maximum number of evaluations of the objective, one or a few solves each; at least 1.

    Returns
    -------
    field, objective, ratios
        As in `improved`; the objective is given without the cost of levels.
    """
    last = int(_AT_BORDERS * evaluations)
    problem = problem.prepared(start)
    before = problem.evaluate(start, tolerance=TOLERANCE)
    metric = FieldMetric.of(problem.curvature(start, before.solution))
    designed = improved(problem, start, evaluations - last, metric, before.solution)
    if not last:
        return designed
    field, objective, ratios = designed
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
    problem = problem.prepared(lifted, solution)
    metric = FieldMetric.of(problem.curvature(lifted, solution) + levels.curvature())
    posed = _AtBorders(problem, levels)
    field, drawn, ratios = improved(posed, lifted, evaluations, metric, solution)
    return field, problem.evaluate(field, drawn.solution, TOLERANCE), ratios
