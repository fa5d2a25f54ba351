"""The result of a comparison over several slicings: one table of slicings and strategies."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ccfem.arrays import freeze
from ccfem.cases.case import Case
from ccfem.checks import check_known
from ccfem.comparison.ranking import ranking
from ccfem.comparison.remarks import remarks
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import InAll, Run, Wanted
from ccfem.comparison.summary import SUMMARY_OF_SLICINGS, summary_html, summary_text
from ccfem.comparison.table import frame
from ccfem.comparison.verdict import verdict
from ccfem.comparison.views import front_picture
from ccfem.elasticity.stress_field import StressField
from ccfem.plot.scenes import View

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["SlicingComparison"]


@dataclass(frozen=True)
class SlicingComparison:
    """Runs of several strategies on the same part, cut into layers in several ways.

    Attributes
    ----------
    case : Case
    stress : StressField
        Of the load case that the paths are planned and evaluated for.
    slicings : mapping of name to Comparison
        In the order they were asked for.
    fibre : float, mm, or None
        Length in all layers together that every run was held to; None if each laid its own.
    refused : mapping of name to str
        Slicings that could not cut the part, and why.
    seconds : mapping of stage to float
        Of the stages that are done once.
    """

    case: Case
    stress: StressField
    slicings: Mapping[str, Comparison]
    fibre: float | None
    refused: Mapping[str, str]
    seconds: Mapping[str, float]

    def __post_init__(self) -> None:
        freeze(self, slicings=dict, refused=dict, seconds=dict)

    def __repr__(self) -> str:
        strategies = dict.fromkeys(run.name for each in self.slicings.values() for run in each.runs)
        return (
            f"SlicingComparison of {len(strategies)} strategies on {len(self.slicings)} slicings "
            f"of {self.case.name!r}: {', '.join(self.slicings)}"
        )

    def __str__(self) -> str:
        return summary_text(self.ranking, self.verdict, SUMMARY_OF_SLICINGS)

    def _repr_html_(self) -> str:
        return summary_html(self.ranking, self.verdict, SUMMARY_OF_SLICINGS)

    def pareto(self, over: str = "first_failure_load") -> "Figure":
        """Draw stiffness over another index, and the front of the printable runs.

        The paths of one slicing are drawn by its own comparison: ``.slicings[name].plot()``.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
        """
        return front_picture(self.succeeded, over)

    def show(self, run: str | None = None, picture: str | Path | None = None) -> View | None:
        """Show the paths of one run in the part, in a window, a notebook, or as a picture.

        Parameters
        ----------
        run : str, optional
            Such as ``"zigzag on planar:z"``; by default the best one.
        picture : path, optional
            Write the view to a file (.png) instead.
        """
        slicings = {
            f"{one.name} on {name}": (comparison, one.name)
            for name, comparison in self.slicings.items()
            for one in comparison.succeeded
            if len(one.toolpaths)
        }
        best = next((one.name for one in self.ranking if one.name in slicings), "")
        name = best if run is None else run
        check_known("run with paths", name, slicings)
        comparison, strategy = slicings[name]
        return comparison.show(strategy, picture)

    @property
    def wanted(self) -> Wanted:
        """Length that runs were held to, as used by ranking and verdict."""
        return None if self.fibre is None else InAll(self.fibre)

    @property
    def runs(self) -> tuple[Run, ...]:
        """All runs, named after strategy and slicing: "zigzag on planar:z"."""
        return tuple(
            replace(run, name=f"{run.name} on {name}")
            for name, comparison in self.slicings.items()
            for run in comparison.runs
        )

    @property
    def succeeded(self) -> tuple[Run, ...]:
        """Runs that did not fail."""
        return tuple(run for run in self.runs if run.evaluation is not None)

    @property
    def ranking(self) -> tuple[Run, ...]:
        """Runs over all slicings from the best to the worst, failed ones last."""
        return ranking(self.runs, self.wanted)

    @property
    def verdict(self) -> str:
        """One sentence on which strategy on which slicing is best."""
        return verdict(self.runs, self.wanted)

    @property
    def remarks(self) -> list[str]:
        """Remarks that must be shown with the numbers, one line each."""
        found = [f"{name}: cannot cut the part: {why}" for name, why in self.refused.items()]
        found += [
            f"{name}: {line}" for name, each in self.slicings.items() for line in each.of_slicer
        ]
        thick = ", ".join(f"{name} {_stack(each)}" for name, each in self.slicings.items())
        chosen = next(iter(self.slicings.values())).case.fibre
        if chosen is not None:
            found.append(f"fibre: {chosen.about()}")
        return [*found, f"layers: {thick}", *remarks(self.runs, self.wanted)]

    @property
    def frame(self) -> "pd.DataFrame":
        """One row a run in order of rank: rank, slicing, strategy, printable and every index."""
        order = {
            f"{run.name} on {name}": (name, run.name)
            for name, comparison in self.slicings.items()
            for run in comparison.runs
        }
        found = frame(self.ranking)
        names = [order[name] for name in found["strategy"]]
        found["strategy"] = [strategy for _, strategy in names]
        found.insert(1, "slicing", [slicing for slicing, _ in names])
        return found


def _stack(comparison: Comparison) -> str:
    """Say how many layers there are, and how many of them hold fibre of any run."""
    laid = {int(k) for run in comparison.succeeded for k in run.toolpaths.layer.tolist()}
    return f"{len(comparison.layers)} ({len(laid)} with fibre)"
