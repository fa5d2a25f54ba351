"""The result of a comparison: what each strategy did on the same part."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ccfem.arrays import freeze
from ccfem.cases.case import Case
from ccfem.checks import check_known
from ccfem.comparison.curve import Curve
from ccfem.comparison.ranking import ranking
from ccfem.comparison.remarks import open_remarks, remarks
from ccfem.comparison.runs import Run
from ccfem.comparison.said_of_cases import cases_remarks, cases_verdict
from ccfem.comparison.summary import summary_html, summary_text
from ccfem.comparison.table import frame
from ccfem.comparison.verdict import verdict
from ccfem.comparison.views import front_picture, layer_view, shown_layer, told
from ccfem.elasticity.part_stress import GivenStress, PartStress
from ccfem.elasticity.stress_field import StressField
from ccfem.elasticity.weighted_cases import WeightedCases
from ccfem.fibre_aware.upper_bound import UpperBound
from ccfem.layers import Layer
from ccfem.plot.scenes import View, show
from ccfem.plot.values import image

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["Comparison"]


@dataclass(frozen=True)
class Comparison:
    """Runs of several strategies on the same part.

    Attributes
    ----------
    case : Case
    stress : StressField
        Of the load case that the paths are planned and evaluated for.
    layers : tuple of Layer
    runs : tuple of Run
        In the order they were asked for, failed ones included.
    fibre_per_layer : float, mm, or None
        Length that every strategy was held to; None if each laid its own.
    seconds : mapping of stage to float
        Solve and slice; the stages of each strategy are in its run.
    given : GivenStress, optional
        Stress of another program, if paths are planned and evaluated on that.
    bound : UpperBound or None
        Stiffness that no paths can exceed at the largest length of any run; None without virtual
        tests.
    cases : WeightedCases, optional
        If paths are planned for several load cases. `stress` is then that of the case of largest
        weight, the first of several.
    cases_bound : UpperBound, optional
        What no paths can exceed in all load cases together.
    curve : Curve, optional
        The strategies at several lengths of fibre, if that was asked for, or if a strategy cannot
        lay the length of the others.
    """

    case: Case
    stress: StressField
    layers: tuple[Layer, ...]
    runs: tuple[Run, ...]
    fibre_per_layer: float | None
    seconds: Mapping[str, float]
    bound: UpperBound | None = None
    given: GivenStress | None = None
    curve: Curve | None = None
    cases: WeightedCases | None = None
    cases_bound: UpperBound | None = None

    @property
    def planned_on(self) -> PartStress:
        """Stress that the paths are planned and evaluated on."""
        return self.stress if self.given is None else self.given

    def __post_init__(self) -> None:
        freeze(self, seconds=dict)

    def __repr__(self) -> str:
        failed = len(self.runs) - len(self.succeeded)
        return (
            f"Comparison of {len(self.runs)} strategies on {self.case.name!r}: "
            f"{len(self.layers)} layers, {len(self.stress.mesh.cells)} cells"
            + (f", {failed} failed" if failed else "")
        )

    def __str__(self) -> str:
        return summary_text(self.ranking, " ".join(self.verdicts))

    def _repr_html_(self) -> str:
        page = summary_html(self.ranking, " ".join(self.verdicts)) + told(self.remarks)
        return page + image(self.plot()) if self.succeeded else page

    def plot(self) -> "Figure":
        """Draw the paths of all strategies on the middle one of the layers with fibre."""
        return self.plot_layer(shown_layer(self.succeeded, self.layers))

    def plot_layer(self, index: int) -> "Figure":
        """Draw the paths of all strategies on one layer, on the tension there.

        Parameters
        ----------
        index : int
            Of the layer (`Layer.index`): the first one is 0.
        """
        machine = self.case.machine
        return layer_view(self.succeeded, self.layers, self.planned_on, machine, index)

    def pareto(self, over: str = "fibre_length") -> "Figure":
        """Draw stiffness over another index, and the front of the printable runs.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
        """
        return front_picture(self.succeeded, over)

    def show(self, strategy: str | None = None, picture: str | Path | None = None) -> View | None:
        """Show the paths of one strategy in the part, in a window, a notebook, or as a picture.

        Parameters
        ----------
        strategy : str, optional
            By default the best one.
        picture : path, optional
            Write the view to a file (.png) instead.
        """
        runs = {run.name: run for run in self.ranking if len(run.toolpaths)}
        name = next(iter(runs), "") if strategy is None else strategy
        check_known("strategy with paths", name, runs)
        return show((runs[name].toolpaths, *self.layers[:1]), picture)

    @property
    def succeeded(self) -> tuple[Run, ...]:
        """Runs that did not fail."""
        return tuple(run for run in self.runs if run.evaluation is not None)

    @property
    def ranking(self) -> tuple[Run, ...]:
        """Runs from the best to the worst, failed ones last."""
        return ranking(self.runs, self.fibre_per_layer)

    @property
    def verdict(self) -> str:
        """One sentence on which strategy is best; empty where there is none to compare."""
        if self.cases is not None:
            return cases_verdict(self.runs, self.fibre_per_layer, self.cases_bound)
        return verdict(self.runs, self.fibre_per_layer)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """The verdict, and those along the curve."""
        along = () if self.curve is None else self.curve.verdicts
        return tuple(dict.fromkeys(said for said in (self.verdict, *along) if said))

    @property
    def remarks(self) -> list[str]:
        """Remarks to be shown with the numbers, one line each."""
        found = remarks(self.runs, self.fibre_per_layer, self.bound)
        found += open_remarks(self.succeeded, self.layers, self.case.machine.fibre_width)
        if self.case.fibre is not None:
            found.insert(0, f"fibre on {len(self.layers)} layers: {self.case.fibre.about()}")
        if self.cases is not None:
            about, case = (self.runs, self.fibre_per_layer, self.cases), self.stress.case
            others = bool(self.case.alternative_supports)
            found += cases_remarks(*about, case, self.cases_bound, others)
        if self.given is not None:
            found.append("paths are planned and evaluated on the stress of another program")
        return found

    @property
    def frame(self) -> "pd.DataFrame":
        """One row a strategy in order of rank: rank, printable, why_not and every index."""
        return frame(self.ranking)
