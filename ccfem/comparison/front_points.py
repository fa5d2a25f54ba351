"""How stiff and how strong a part gets with how much fibre on how many layers, beside the bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import BoolArray, freeze
from ccfem.base.errors import InputError
from ccfem.comparison.front import on_front
from ccfem.comparison.front_cases import WORST, PointCase, PointCases, stiffness_panels
from ccfem.comparison.plot.curves import AmountPoint, TradePoint, amount_curves, trade_curves
from ccfem.paths.planning.equal_fibre import TOLERANCE
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_STIFFNESS = "stiffness ratio"


def _layers(count: int) -> str:
    return f"{count} layers" if count > 1 else "1 layer"


@dataclass(frozen=True)
class FrontPoint:
    """One plan."""

    layers: int  # number of layers that the part is cut into
    # mm: length per layer that the strategy was asked for: asked again, it lays the same
    asked: float
    length: float  # mm: of fibre in all layers
    # Stiffness over that of the part without fibre, fibres in tension only; of several load cases
    # of the one that is farthest below its bound.
    ratio: float
    # N: load at which something fails first; NaN where that is not known. Of several load cases
    # that of the one which fails at the least multiple of its load.
    failure: float
    fails_in: str  # "matrix", "fibre" or "interlayer"; empty where that is not known
    # Ratio that no paths of this length exceed, on the largest number of layers of the front; of
    # several load cases in that case alone.
    bound: float
    why_not: str  # what keeps the paths from being printed as they are; empty where they can be
    toolpaths: Toolpaths
    strength: float = 0.0  # how much the load at first failure counted when it was planned
    # What it does in every load case, where it is planned for several.
    cases: PointCases | None = None
    with_fibre: int | None = None  # number of layers that get fibre; default all

    @property
    def _stack(self) -> int:
        return self.layers if self.with_fibre is None else self.with_fibre

    @property
    def asked_in_all(self) -> float:
        """Length in all layers that was asked for, mm."""
        return self.asked * self._stack

    @property
    def length_per_layer(self) -> float:
        """Length that it lays, mm, as a mean over the layers with fibre."""
        return self.length / self._stack

    @property
    def kind(self) -> str:
        """Name of the curve that it belongs to."""
        name = _layers(self.layers)
        return f"{name}, strength {self.strength:g}" if self.strength else name

    @property
    def measure(self) -> PointCase | PointCases:
        """What counts of it, under its load case or under all."""
        return PointCase(self.ratio, self.bound, self.failure) if self.cases is None else self.cases

    @property
    def traded(self) -> TradePoint:
        """Point of what strength costs in stiffness."""
        failure = self.measure.drawn[0] * self.measure.failure
        return TradePoint(self.measure.share, failure, self.strength, not self.why_not)

    @property
    def least_ratio(self) -> float:
        """The ratio, or the least of all load cases."""
        return float(self.measure.ratios.min())


@dataclass(frozen=True)
class FibreFront:
    """Stiffness and first failure over the length of fibre.

    Attributes
    ----------
    case : str
        Name of the part.
    points : tuple of FrontPoint
        By number of layers, then by how much strength counts, then by length.
    refused : mapping of int to str
        Numbers of layers on which the strategy found no plan, with the reason.
    bare : float, N
        Load at which the part without fibre fails; NaN where that is not known. Of several load
        cases the least multiple of their loads.
    bounds : tuple of (float, float)
        Lengths, mm, and the ratios that no paths of that length exceed; empty for several load
        cases.
    cases_bounds : tuple of (float, UpperBound)
        Lengths, mm, and what no paths of that length exceed under several load cases; empty for
        one.
    findings : tuple of str
        What is doubtful about the mesh, the part and its solution, one line each.
    """

    case: str
    strategy: str
    points: tuple[FrontPoint, ...]
    refused: Mapping[int, str]
    bare: float = float("nan")
    bounds: tuple[tuple[float, float], ...] = ()
    cases_bounds: tuple[tuple[float, UpperBound], ...] = ()
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, refused=dict)

    def __repr__(self) -> str:
        best, cases = max(self.points, key=lambda point: point.least_ratio), self.cases
        under = f" in every one of {len(cases)} load cases" if cases else ""
        return (
            f"FibreFront of '{self.case}' by {self.strategy}: {len(self.points)} plans, up to "
            f"{best.least_ratio:.3g} times as stiff{under} with {best.length / 1000.0:.4g} m on "
            f"{best.layers} layers"
        )

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the load cases that are planned for together; empty for one alone."""
        measure = self.points[0].measure
        return measure.names if isinstance(measure, PointCases) else ()

    @property
    def stiffest(self) -> BoolArray:
        """Printable plans that nothing with as little fibre, or none, exceeds in stiffness.

        With several load cases every plan is measured by what no paths of its own length exceed in
        each: no plan with as little fibre reaches a larger share of that in its worst case.
        """
        measures, marks = [point.measure for point in self.points], []
        for k, measure in enumerate(measures):
            shares = [measure.share_of(other.ratios) for other in measures]
            marks.append(self._front(measure.share_of(np.ones(len(measure.ratios))), shares)[k])
        return np.array(marks)

    @property
    def strongest(self) -> BoolArray:
        """Printable plans that nothing with as little fibre, or none, exceeds in first failure."""
        return self._front(self.bare, [point.measure.failure for point in self.points])

    def _front(self, bare: float, values: Sequence[float]) -> BoolArray:
        # Plans to one length differ by what the shortest strand leaves: these count as equal.
        fibre = np.array([point.length for point in self.points])
        asked = np.array([point.asked_in_all for point in self.points])
        lengths = np.where(np.abs(fibre - asked) <= TOLERANCE * asked, asked, fibre)
        printable = np.array([not point.why_not for point in self.points])
        across = np.append(0.0, np.where(printable, lengths, np.nan))
        return on_front(across, np.append(bare, values))[1:]

    def plot(self) -> "Figure":
        """Draw stiffness and first-failure load over the length of fibre, with the bound.

        With several load cases: of the worst case the share of its bound, beside the most of any
        paths; the stiffness in each case, beside what no paths exceed in that case alone, and what
        none exceed in all at once; and the multiple of the loads at which one of them fails.
        """
        stiffest, strongest = self.stiffest.tolist(), self.strongest.tolist()
        cases = [point.cases for point in self.points if point.cases is not None]
        if cases:
            values, bounds, together = stiffness_panels(cases, self.cases_bounds)
        else:
            values = {_STIFFNESS: [point.ratio for point in self.points]}
            bounds, together = {_STIFFNESS: [(0.0, 1.0), *self.bounds]}, {}
        panels = {label: self._curves(some, stiffest) for label, some in values.items()}
        scale, label = self.points[0].measure.drawn
        failures = [scale * point.measure.failure for point in self.points]
        panels[label] = self._curves(failures, strongest)
        return amount_curves(
            panels,
            _in_metres(bounds),
            (*(1.0 for _ in values), scale * self.bare),
            f"{self.case}, {self.strategy}",
            _in_metres(together),
        )

    def _curves(
        self, values: Sequence[float], best: Sequence[bool]
    ) -> dict[str, list[AmountPoint]]:
        curves: dict[str, list[AmountPoint]] = {}
        for plan, value, marked in zip(self.points, values, best, strict=True):
            point = AmountPoint(1e-3 * plan.length, value, marked, not plan.why_not)
            curves.setdefault(plan.kind, []).append(point)
        return curves

    def plot_trade(self) -> "Figure":
        """Draw first-failure load over stiffness, a curve a length of fibre.

        Raises
        ------
        InputError
            When no two plans of one length differ in how much strength counted.
        """
        curves: dict[tuple[int, float], list[FrontPoint]] = {}
        for point in self.points:
            curves.setdefault((point.layers, point.asked), []).append(point)
        several = [some for some in curves.values() if len(some) > 1]
        if not several:
            raise InputError(
                "a trade needs plans of one length for several strengths; got none: give --strength"
            )
        counts = {point.layers for some in several for point in some}
        alike = len(counts) == 1
        on = f", {_layers(*counts)}" if alike else ""
        named = {
            f"{1e-3 * some[0].length:.3g} m" + ("" if alike else f", {_layers(some[0].layers)}"): [
                point.traded for point in some
            ]
            for some in several
        }
        heading = f"{self.case}, {self.strategy}{on}: what strength costs"
        _, failure = self.points[0].measure.drawn
        return trade_curves(named, heading, WORST if self.cases else _STIFFNESS, failure)

    def to_frame(self) -> "pd.DataFrame":
        """One row a plan."""
        import pandas as pd

        rows = [
            {
                "layers": point.layers,
                "strength": point.strength,
                "fibre": point.length,
                "fibre_per_layer": point.asked,
                **point.measure.columns(),
                "fails_in": point.fails_in,
                "printable": not point.why_not,
                "why_not": point.why_not,
                "stiffest": stiffest,
                "strongest": strongest,
            }
            for point, stiffest, strongest in zip(
                self.points, self.stiffest.tolist(), self.strongest.tolist(), strict=True
            )
        ]
        return pd.DataFrame(rows)


def _in_metres(
    curves: Mapping[str, Sequence[tuple[float, float]]],
) -> dict[str, list[tuple[float, float]]]:
    return {label: [(1e-3 * x, y) for x, y in curve] for label, curve in curves.items()}
