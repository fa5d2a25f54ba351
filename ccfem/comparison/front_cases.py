"""What one plan of a front does under several load cases."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, freeze
from ccfem.comparison.tested_cases import TestedCases
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

WORST = "worst case, share of its bound"
"""What counts of several load cases, on an axis."""

Curves = dict[str, list[tuple[float, float]]]


@dataclass(frozen=True)
class PointCase:
    """Stiffness and first failure of one plan in its only load case: as `PointCases` of several."""

    # Stiffness over that of the part without fibre, and what no paths of this length exceed.
    ratio: float
    bound: float
    failure: float  # N: load at first failure; NaN where that is not known

    drawn: ClassVar[tuple[float, str]] = (1e-3, "first failure, kN")
    """Factor and title of the failure in pictures."""

    @property
    def ratios(self) -> FloatArray:
        """The ratio, (1,)."""
        return np.array([self.ratio])

    @property
    def share(self) -> float:
        """The ratio: one case is measured by the part without fibre."""
        return self.ratio

    def share_of(self, ratios: ArrayLike) -> float:
        """Return the same of other paths."""
        return float(np.min(ratios))

    def columns(self) -> dict[str, float | str]:
        """Columns of the table: what a plan reaches."""
        return {
            "stiffness_ratio_tension": self.ratio,
            "bound": self.bound,
            "share_of_gain": (self.ratio - 1.0) / (self.bound - 1.0),
            "first_failure_load": self.failure,
        }


@dataclass(frozen=True)
class PointCases:
    """Stiffness and first failure of one plan in every load case."""

    names: tuple[str, ...]
    # (n,): stiffness over that of the part without fibre, fibres in tension only
    ratios: FloatArray
    # (n,): load at first failure over the load of the case; NaN where that is not known
    factors: FloatArray
    bound: UpperBound  # what no paths of this length exceed

    drawn: ClassVar[tuple[float, str]] = (1.0, "first failure, times the load")

    def __post_init__(self) -> None:
        freeze(self, names=tuple, ratios=float, factors=float)

    @classmethod
    def of(cls, tested: TestedCases, bound: UpperBound) -> "PointCases":
        """Keep what a front shows of the tests of a plan."""
        known, failure = tested.tension, tested.failure
        factors = np.full(len(known.names), np.nan) if failure is None else failure.factors
        return cls(known.names, known.ratios, np.asarray(factors), bound)

    @property
    def share(self) -> float:
        """Least share, over the cases, of what no paths of this length exceed in a case alone."""
        return self.share_of(self.ratios)

    def share_of(self, ratios: ArrayLike) -> float:
        """Return the same of other paths, with ratios (n,), by the bounds of this length."""
        return float(self.bound.shares(ratios).min())

    @property
    def worst(self) -> int:
        """Number of the case with the least share."""
        return int(np.argmin(self.bound.shares(self.ratios)))

    @property
    def fails_first(self) -> str:
        """Case that fails at the least multiple of its load; empty where that is not known."""
        unknown = np.isnan(self.factors).any()
        return "" if unknown else self.names[int(np.argmin(self.factors))]

    @property
    def failure(self) -> float:
        """Least load at first failure over the load of its case; NaN where one is not known."""
        return float(self.factors.min())

    def columns(self) -> dict[str, float | str]:
        """Columns of the table: what a plan reaches."""
        failure: dict[str, float | str] = {
            "first_failure_factor": self.failure,
            "fails_first": self.fails_first,
        }
        return {**self.values(), **failure}

    def values(self) -> dict[str, float]:
        """Values by column, as `TestedCases.values` names them, with the bound of each case."""
        values: dict[str, float] = {}
        shares = self.bound.shares(self.ratios)
        for k, name in enumerate(self.names):
            values[f"stiffness_ratio_tension[{name}]"] = float(self.ratios[k])
            values[f"bound[{name}]"] = float(self.bound.singles[k])
            values[f"share_of_bound[{name}]"] = float(shares[k])
            values[f"first_failure_factor[{name}]"] = float(self.factors[k])
        values["worst_share_of_bound"] = self.share
        values["most_share_of_bound"] = 1.0 / self.bound.least
        values["above_bound"] = self.bound.gap(self.ratios)
        return values


def stiffness_panels(
    plans: Sequence[PointCases], bounds: Sequence[tuple[float, UpperBound]]
) -> tuple[dict[str, list[float]], Curves, Curves]:
    """Panels of a picture: what counts of the plans, then the stiffness in every case.

    Parameters
    ----------
    plans : sequence of PointCases
        At least one.
    bounds : sequence of (float, UpperBound)
        By length, mm.

    Returns
    -------
    dict of label to list of float
        Values of the plans.
    dict of label to list of (float, float)
        Lengths, mm, from none on, and what no paths exceed; of the stiffness in that case alone.
    dict of label to list of (float, float)
        Lengths, mm, and ratios that no paths exceed in all cases at once.
    """
    start = (0.0, 1.0)
    values = {WORST: [point.share for point in plans]}
    alone: Curves = {WORST: [start, *((length, 1.0 / bound.least) for length, bound in bounds)]}
    together: Curves = {}
    for k, name in enumerate(plans[0].names):
        label = f"{name}: stiffness ratio"
        values[label] = [float(point.ratios[k]) for point in plans]
        alone[label] = [start, *((length, float(bound.singles[k])) for length, bound in bounds)]
        at_once = ((length, float(bound.singles[k]) / bound.least) for length, bound in bounds)
        together[label] = [start, *at_once]
    return values, alone, together
