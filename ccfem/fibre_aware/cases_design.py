"""Design of stream functions for several load cases: one field a case, all designed together.

Each field is laid in its share of the layers, evenly over the height, so every cell contains fibre
of all fields. One solve for each case gives its compliance; L-BFGS changes all fields at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray, freeze
from ccfem.fibre_aware.border_levels import BorderLevels
from ccfem.fibre_aware.field_design import designed_fields
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution
from ccfem.fibre_aware.stream_design import OVER_BUDGET, Laid, StreamProblem
from ccfem.fibre_aware.stream_start import field_along, mixed_tension
from ccfem.fibre_aware.upper_bound import LEAST, SUM, WORST
from ccfem.fields.layer_tension import layer_tension
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import stress_on

__all__ = [
    "DESIGN_POWERS",
    "CasesDesign",
    "CasesObjective",
    "CasesProblem",
    "Pull",
    "design_cases",
    "start_fields",
]

DESIGN_POWERS = {WORST: 4.0, SUM: 1.0, LEAST: 4.0}
"""Power of ``bound / ratio`` in the sum over the cases, for each objective."""

Pull: TypeAlias = tuple[FloatArray, FloatArray]
"""Derivatives (m,) by the two components of a field's gradient in the cells."""


@dataclass(frozen=True)
class CasesObjective:
    """The objective of several cases at some fields.

    Attributes
    ----------
    value : float
    gradient : (n * c,) array
        With respect to the coefficients, field after field.
    ratio : (n,) array
        Stiffness of each case over that of the part without fibre.
    length : float, mm
        Of fibre.
    solution : tuple of SmearedSolution
        Of each case.
    """

    value: float
    gradient: FloatArray
    ratio: FloatArray
    length: float
    solution: tuple[SmearedSolution, ...]


@dataclass(frozen=True)
class CasesProblem:
    """What fields for several cases are designed for.

    Minimised is ``log(sum of w_i (bound_i / ratio_i)^p) / p`` plus the penalties of
    `StreamProblem`, those of each field weighted by its share of the layers.

    Attributes
    ----------
    problem : StreamProblem
        Of each field alone; its part is that of the first case.
    parts : tuple of SmearedPart
        One for each case.
    weights : (n,) array
        Of the cases; their sum is 1.
    bounds : (n,) array
        Stiffness ratio of each case that no paths exceed.
    shares : (n,) array
        Of the layers, of each field; their sum is 1.
    power : float, default 1
        The p above: the larger, the more the worst case counts.
    """

    problem: StreamProblem
    parts: tuple[SmearedPart, ...]
    weights: FloatArray
    bounds: FloatArray
    shares: FloatArray
    power: float = 1.0

    def __post_init__(self) -> None:
        freeze(self, weights=float, bounds=float, shares=float)

    @classmethod
    def alone(cls, problem: StreamProblem) -> "CasesProblem":
        """Problem of one load case, of one field in all layers: the same objective."""
        one = np.ones(1)
        return cls(problem, (problem.part,), one, one, one)

    @cached_property
    def laplacian(self) -> Any:
        """Graph Laplacian of all fields."""
        return sp.block_diag(len(self.shares) * [self.problem.laplacian], format="csr")

    def evaluate(
        self,
        field: FloatArray,
        start: tuple[SmearedSolution, ...] | None = None,
        tolerance: float = 1e-5,
    ) -> CasesObjective:
        """Evaluate the objective and its gradient.

        Parameters
        ----------
        field : (n * c,) array
            Coefficients, field after field.
        start : tuple of SmearedSolution, optional
            Where the solves start.
        tolerance : float
            Relative residual of the solves.
        """
        laid = self.laid(field)
        found = self.solve(laid, start, tolerance)
        value, counts = self.worth(self.ratios(found))
        return self.objective(field, laid, found, value, self.pulls(laid, found, counts))

    def laid(self, field: FloatArray) -> tuple[Laid, ...]:
        """Fibre that each field lays."""
        return tuple(self.problem.laid(one) for one in field.reshape(len(self.shares), -1))

    def stiffness(self, laid: Sequence[Laid], strain: FloatArray) -> FloatArray:
        """Stiffness (m, 3, 3), MPa, of the fibre of all fields at strains (m, 3)."""
        found = np.zeros((len(strain), 3, 3))
        for share, one in zip(self.shares, laid, strict=True):
            found += share * one.stiffness(strain)
        return found

    def solve(
        self,
        laid: Sequence[Laid],
        start: tuple[SmearedSolution, ...] | None = None,
        tolerance: float = 1e-5,
    ) -> tuple[SmearedSolution, ...]:
        """Solve each case; parameters as in `evaluate`."""
        starts = start if start is not None else (None,) * len(self.parts)
        return tuple(
            part.solve(lambda strain: self.stiffness(laid, strain), one, tolerance)
            for part, one in zip(self.parts, starts, strict=True)
        )

    def ratios(self, solutions: Sequence[SmearedSolution]) -> FloatArray:
        """Stiffness (n,) of each case over that of the part without fibre."""
        found = [part.ratio(one.work) for part, one in zip(self.parts, solutions, strict=True)]
        return np.array(found)

    def worth(self, ratios: FloatArray) -> tuple[float, FloatArray]:
        """Objective at stiffness ratios (n,) without penalties, and the weight of each case."""
        terms = self.bounds / ratios
        powers = self.weights * (terms / terms.max()) ** self.power
        return float(np.log(terms.max()) + np.log(powers.sum()) / self.power), powers / powers.sum()

    def pulls(
        self, laid: Sequence[Laid], solutions: Sequence[SmearedSolution], counts: FloatArray
    ) -> list[Pull]:
        """Derive -log(stiffness), the cases weighted (n,), by each field if in all layers."""
        found = []
        for one in laid:
            x, y = zip(*(self.problem.pull(one, each) for each in solutions), strict=True)
            found.append((counts @ np.stack(x), counts @ np.stack(y)))
        return found

    def objective(
        self,
        field: FloatArray,
        laid: Sequence[Laid],
        solutions: tuple[SmearedSolution, ...],
        value: float,
        pulls: Sequence[Pull],
    ) -> CasesObjective:
        """Objective from a value without penalties.

        Parameters
        ----------
        field : (n * c,) array
        laid, solutions
            Fibre of the field, and the solution of each case with it.
        value : float
        pulls : sequence of two (m,) arrays
            Derivatives of the value by the gradient of each field, if it were in all layers.
        """
        problem, fields, shares = self.problem, field.reshape(len(self.shares), -1), self.shares
        length = sum(share * problem.length(one) for share, one in zip(shares, laid, strict=True))
        over = max(length / problem.budget - 1.0, 0.0)
        value, gradient = value + OVER_BUDGET * over**2, []
        for share, one, own, pull in zip(shares, laid, fields, pulls, strict=True):
            value += share * sum(problem.penalties(own, one))
            gradient.append(share * problem.gradient(own, one, pull, over))
        ratios = self.ratios(solutions)
        return CasesObjective(value, np.concatenate(gradient), ratios, float(length), solutions)

    def _counts(self, solutions: Sequence[SmearedSolution]) -> FloatArray:
        """How much each case counts (n,)."""
        return self.worth(self.ratios(solutions))[1]

    def curvature(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> Any:
        """Matrix with a block for each field: mean over the cases of `StreamProblem.curvature`."""
        counts, blocks = self._counts(solutions), []
        for share, own in zip(self.shares, field.reshape(len(self.shares), -1), strict=True):
            each = [self.problem.curvature(own, one) for one in solutions]
            mean = sum(count * one for count, one in zip(counts, each, strict=True))
            blocks.append((share or 1.0) * mean)  # a field without layers changes nothing
        return sp.block_diag(blocks, format="csc")

    def levels(self, field: FloatArray, solutions: tuple[SmearedSolution, ...]) -> BorderLevels:
        """Cost, over all cases, of levels that lie farther from the border than they need to."""
        counts, found = self._counts(solutions), []
        for share, own in zip(self.shares, field.reshape(len(self.shares), -1), strict=True):
            each = [self.problem.levels(own, one) for one in solutions]
            weight = share * (counts @ np.stack([one.weight for one in each]))
            found.append(replace(each[0], weight=weight))
        return BorderLevels.side_by_side(found)


@dataclass(frozen=True)
class CasesDesign:
    """Designed fields of several cases.

    Attributes
    ----------
    fields : (n, c) array
        Coefficients of each field.
    objective : CasesObjective
        At these fields.
    ratios : tuple of (n,) arrays
        Stiffness ratios of the cases at every evaluation.
    """

    fields: FloatArray
    objective: CasesObjective
    ratios: tuple[FloatArray, ...]


def design_cases(problem: CasesProblem, start: FloatArray, evaluations: int = 50) -> CasesDesign:
    """Improve fields (n * c,) of several cases as `stream_design.design` does those of one.

    The unknowns are scaled with the curvature of all cases. The levels of each field are drawn to
    the borders that any case stretches along it.
    """
    field, found, ratios = designed_fields(problem, start, evaluations)
    return CasesDesign(field.reshape(len(problem.shares), -1), found, ratios)


def start_fields(
    problem: CasesProblem, fields: Sequence[Any], layers: Sequence[Layer], cap: float, tilt: float
) -> FloatArray:
    """Make fields (n * c,) to start with: each mainly follows the tension of its own case.

    Field k follows ``sum over i of v_i s_i t_i t_i^T / sqrt(C_i)``, s_i the tension along t_i and
    C_i the compliance without fibre, v_i the tilt for its own case and equal for the others.

    Parameters
    ----------
    problem : CasesProblem
    fields : sequence of StressField
        Of the part without fibre, one for each case.
    layers : sequence of Layer
        One for each group of layers.
    cap : float
        As in `start_field`.
    tilt : float in (0, 1]
        Weight of a field's own case. At 1 the initial fields are independent of each other; at
        1 / n they start alike, and stay so.
    """
    count = len(fields)
    tensions = [[layer_tension(stress_on(layer, field)) for field in fields] for layer in layers]
    size = np.sqrt([part.unreinforced.work for part in problem.parts])
    found = []
    for k in range(count):
        factors = np.full(count, (1.0 - tilt) / max(count - 1, 1))
        factors[k] = tilt
        own = [mixed_tension(each, factors / size) for each in tensions]
        found.append(field_along(problem.problem, layers, own, cap))
    return np.concatenate(found)
