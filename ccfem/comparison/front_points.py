"""How stiff and how strong a part gets with how much fibre on how many layers, beside the bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ccfem.arrays import BoolArray, freeze
from ccfem.comparison.front import on_front
from ccfem.errors import InputError
from ccfem.planning.equal_fibre import TOLERANCE
from ccfem.plot.amount_curves import AmountPoint, TradePoint, amount_curves, trade_curves
from ccfem.toolpaths import Toolpaths

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["FibreFront", "FrontPoint"]

_STIFFNESS, _FAILURE = "times unreinforced stiffness", "first failure, kN"


def _layers(count: int) -> str:
    return f"{count} layers" if count > 1 else "1 layer"


@dataclass(frozen=True)
class FrontPoint:
    """One plan.

    Attributes
    ----------
    layers : int
        Number of layers.
    asked : float, mm
        Length per layer that the strategy was asked for: asked again, it lays the same.
    length : float, mm
        Of fibre in all layers.
    ratio : float
        Stiffness over that of the part without fibre, fibres in tension only.
    failure : float, N
        Load at which something fails first; NaN where that is not known.
    fails_in : str
        "matrix", "fibre" or "interlayer"; empty where that is not known.
    bound : float
        Ratio that no paths of this length exceed, on the largest number of layers of the front.
    why_not : str
        What keeps the paths from being printed as they are; empty where they can be.
    toolpaths : Toolpaths
    strength : float, default 0
        How much the load at first failure counted when it was planned.
    """

    layers: int
    asked: float
    length: float
    ratio: float
    failure: float
    fails_in: str
    bound: float
    why_not: str
    toolpaths: Toolpaths
    strength: float = 0.0

    @property
    def kind(self) -> str:
        """Name of the curve that it belongs to."""
        name = _layers(self.layers)
        return f"{name}, strength {self.strength:g}" if self.strength else name


@dataclass(frozen=True)
class FibreFront:
    """Stiffness and first failure over the length of fibre.

    Attributes
    ----------
    case : str
        Name of the part.
    strategy : str
    points : tuple of FrontPoint
        By number of layers, then by how much strength counts, then by length.
    refused : mapping of int to str
        Numbers of layers on which the strategy found no plan, with the reason.
    bare : float, N
        Load at which the part without fibre fails; NaN where that is not known.
    bounds : tuple of (float, float)
        Lengths, mm, and the ratios that no paths of that length exceed.
    """

    case: str
    strategy: str
    points: tuple[FrontPoint, ...]
    refused: Mapping[int, str]
    bare: float = float("nan")
    bounds: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        freeze(self, refused=dict)

    def __repr__(self) -> str:
        best = max(self.points, key=lambda each: each.ratio)
        return (
            f"FibreFront of '{self.case}' by {self.strategy}: {len(self.points)} plans, up to "
            f"{best.ratio:.3g} times as stiff with {best.length / 1000.0:.4g} m on {best.layers} "
            "layers"
        )

    @property
    def stiffest(self) -> BoolArray:
        """Printable plans that nothing with as little fibre, or none, exceeds in stiffness."""
        return self._front(1.0, [each.ratio for each in self.points])

    @property
    def strongest(self) -> BoolArray:
        """Printable plans that nothing with as little fibre, or none, exceeds in first failure."""
        return self._front(self.bare, [each.failure for each in self.points])

    def _front(self, bare: float, values: Sequence[float]) -> BoolArray:
        # Plans to one length differ by what the shortest strand leaves: these count as equal.
        laid = np.array([each.length for each in self.points])
        asked = np.array([each.asked * each.layers for each in self.points])
        lengths = np.where(np.abs(laid - asked) <= TOLERANCE * asked, asked, laid)
        printable = np.array([not each.why_not for each in self.points])
        across = np.append(0.0, np.where(printable, lengths, np.nan))
        return on_front(across, np.append(bare, values))[1:]

    def plot(self) -> "Figure":
        """Draw stiffness and first-failure load over the length of fibre, with the bound."""
        panels: dict[str, dict[str, list[AmountPoint]]] = {_STIFFNESS: {}, _FAILURE: {}}
        rows = zip(self.points, self.stiffest.tolist(), self.strongest.tolist(), strict=True)
        for each, stiffest, strongest in rows:
            length, printable = 1e-3 * each.length, not each.why_not
            found = (each.ratio, stiffest), (1e-3 * each.failure, strongest)
            for curves, (value, best) in zip(panels.values(), found, strict=True):
                curves.setdefault(each.kind, []).append(AmountPoint(length, value, best, printable))
        bound = [(1e-3 * length, ratio) for length, ratio in self.bounds]
        heading = f"{self.case}, {self.strategy}"
        return amount_curves(panels, [(0.0, 1.0), *bound], (1.0, 1e-3 * self.bare), heading)

    def plot_trade(self) -> "Figure":
        """Draw first-failure load over stiffness, a curve a length of fibre.

        Raises
        ------
        InputError
            When no two plans of one length differ in how much strength counted.
        """
        curves: dict[tuple[int, float], list[FrontPoint]] = {}
        for each in self.points:
            curves.setdefault((each.layers, each.asked), []).append(each)
        several = [some for some in curves.values() if len(some) > 1]
        if not several:
            raise InputError(
                "a trade needs plans of one length for several strengths; got none: give --strength"
            )
        counts = {each.layers for some in several for each in some}
        alike = len(counts) == 1
        on = f", {_layers(*counts)}" if alike else ""
        named = {
            f"{1e-3 * some[0].length:.3g} m" + ("" if alike else f", {_layers(some[0].layers)}"): [
                TradePoint(each.ratio, 1e-3 * each.failure, each.strength, not each.why_not)
                for each in some
            ]
            for some in several
        }
        return trade_curves(named, f"{self.case}, {self.strategy}{on}: what strength costs")

    def to_frame(self) -> "pd.DataFrame":
        """One row a plan."""
        import pandas as pd

        rows = [
            {
                "layers": each.layers,
                "strength": each.strength,
                "fibre": each.length,
                "fibre_per_layer": each.asked,
                "stiffness_ratio_tension": each.ratio,
                "bound": each.bound,
                "share_of_gain": (each.ratio - 1.0) / (each.bound - 1.0),
                "first_failure_load": each.failure,
                "fails_in": each.fails_in,
                "printable": not each.why_not,
                "why_not": each.why_not,
                "stiffest": stiffest,
                "strongest": strongest,
            }
            for each, stiffest, strongest in zip(
                self.points, self.stiffest.tolist(), self.strongest.tolist(), strict=True
            )
        ]
        return pd.DataFrame(rows)
