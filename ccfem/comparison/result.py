"""The result of a request: one table of runs, and what is said and drawn of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import freeze
from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.comparison.curve import Curve, one_length_suits
from ccfem.comparison.front import cost_of, on_front
from ccfem.comparison.headline import headline_values
from ccfem.comparison.plot.scenes import View, show
from ccfem.comparison.plot.values import image
from ccfem.comparison.ranking import ranking
from ccfem.comparison.remarks import (
    by_importance,
    cases_remarks,
    cases_verdict,
    open_remarks,
    remarks,
)
from ccfem.comparison.request import InAll, Request, Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.table import Table, frame, headline_table
from ccfem.comparison.verdict import verdict
from ccfem.fem.elasticity.stress_field import GivenStress, PartStress, StressField, WeightedCases
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import flat_view, in_charts
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import stress_on
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# What a comparison shows of itself: the paths of a layer, fronts, and a page for notebooks.


def shown_layer(runs: Sequence[Run], layers: Sequence[Layer]) -> int:
    """Index of the layer that shows most: the middle one of those with fibre of any run."""
    indices = sorted({int(k) for run in runs for k in np.unique(run.toolpaths.layer)})
    if indices:
        return indices[len(indices) // 2]
    if not layers:
        raise InputError("there is no layer to draw: slice the part into at least one")
    return layers[len(layers) // 2].index


def layer_view(
    runs: Sequence[Run], layers: Sequence[Layer], stress: PartStress, machine: Machine, index: int
) -> "Figure":
    """Draw the paths of all runs on one layer, side by side, on the tension there.

    Raises
    ------
    InputError
        Where there is no such layer, and where no run has paths.
    """
    from ccfem.comparison.plot.paths import compare_layer

    by_index = {layer.index: layer for layer in layers}
    if index not in by_index:
        raise InputError(
            f"there is no layer {index}; layers are {min(by_index)} to {max(by_index)}: choose one"
        )
    if not runs:
        raise InputError("no strategy could plan this part: see why in .frame['failure']")
    flat = flat_view(by_index[index])
    runs = [replace(run, toolpaths=in_charts(run.toolpaths, layers)) for run in runs]
    captions = {}
    for run in runs:
        there = run.toolpaths.on_layer(index)
        captions[run.name] = f"{there.lengths.sum():.0f} mm in {len(there)} paths"
    paths = {run.name: run.toolpaths for run in runs}
    return compare_layer(flat, stress_on(flat, stress), paths, machine.fibre_width, captions)


def front_picture(runs: Sequence[Run], over: str) -> "Figure":
    """Draw stiffness over another index, a point a run; the front of what is printable joined.

    Raises
    ------
    InputError
        For an unknown index, and runs without a virtual test.
    """
    from ccfem.comparison.plot.curves import FrontPoint, front_figure

    cost = cost_of(over)
    values = [headline_values(run) for run in runs]
    known = [
        (run, row)
        for run, row in zip(runs, values, strict=True)
        if "stiffness" in row and over in row
    ]
    if not known:
        raise InputError(f"no run has stiffness and {over}: compare with the virtual test")
    across = cost.factor * np.array([row[over] for _, row in known])
    up = np.array([row["stiffness"] for _, row in known])
    printable = np.array([run.printable for run, _ in known])
    best = on_front(np.where(printable, across, np.nan), up, cost.better)
    names = [run.name for run, _ in known]
    points = map(
        FrontPoint, names, across.tolist(), up.tolist(), best.tolist(), printable.tolist(), names
    )
    return front_figure({"": [*points]}, cost.title, "stiffness, N/mm")


def paragraphs(remarks: Sequence[str]) -> str:
    """Remarks as HTML, a paragraph each."""
    return "".join(f"<p>{escape(line)}</p>" for line in remarks)


@dataclass(frozen=True)
class Comparison:
    """Runs of strategies on one part, cut into layers in one way or several.

    Attributes
    ----------
    request : Request
        What was asked for.
    cases : WeightedCases
        The load cases that paths are planned for, solved: one, or several.
    stacks : mapping of slicing to tuple of Layer
        In the order they were asked for; the name of a single one that was not named is empty.
    runs : tuple of Run
        In the order they were asked for, failed ones included.
    wanted : float, mm, InAll or None
        Length per layer, or in all, that every run was held to; None if each laid its own.
    seconds : mapping of stage to float
        Of the stages that are done once; the others are in the runs.
    refused : mapping of slicing to str
        Slicings that could not cut the part, and why.
    given : GivenStress, optional
        Stress of another program, if paths are planned and evaluated on that.
    bounds : mapping of float to UpperBound
        Stiffness that no paths can exceed, by the length of fibre in all, mm: the largest of the
        runs, and others where several lengths are asked for. Empty without virtual tests.
    of_slicers : tuple of str
        Remarks of the slicers, one line each.
    bare : BreakingLoad, optional
        The load that breaks the part without fibre, if breaking loads were asked for.
    curve : Curve, optional
        The strategies at several lengths of fibre, if that was asked for, or if a strategy cannot
        lay the length of the others.
    """

    request: Request
    cases: WeightedCases
    stacks: Mapping[str, tuple[Layer, ...]]
    runs: tuple[Run, ...]
    wanted: Wanted
    seconds: Mapping[str, float]
    refused: Mapping[str, str]
    given: GivenStress | None = None
    bounds: Mapping[float, UpperBound] = field(default_factory=dict)
    curve: Curve | None = None
    of_slicers: tuple[str, ...] = ()
    bare: BreakingLoad | None = None

    def __post_init__(self) -> None:
        freeze(self, stacks=dict, runs=tuple, seconds=dict, refused=dict, bounds=dict)

    def __repr__(self) -> str:
        failed = len(self.runs) - len(self.succeeded)
        if self.over_slicings:
            count = len(self.request.strategies)
            about = (
                f"on {len(self.stacks)} slicings of {self.case.name!r}: {', '.join(self.stacks)}"
            )
        else:
            count = len(self.runs)
            about = f"on {self.case.name!r}: {len(self.layers)} layers"
        cells = f", {len(self.stress.mesh.cells)} cells"
        return f"Comparison of {count} strategies {about}{cells}" + (
            f", {failed} failed" if failed else ""
        )

    @property
    def table(self) -> Table:
        """The indices that matter first, the best run first."""
        return headline_table(self.ranking, self.wanted, self.over_slicings)

    def __str__(self) -> str:
        verdicts = " ".join(self.verdicts)
        return "\n".join([*self.table.first.lines("strategy"), *filter(None, [verdicts])])

    def _repr_html_(self) -> str:
        verdicts = " ".join(self.verdicts)
        page = self.table.first.html("strategy") + paragraphs(
            [*filter(None, [verdicts]), *self.remarks]
        )
        return page + image(self.plot()) if self.succeeded else page

    @property
    def case(self) -> Case:
        """The part."""
        return self.request.case

    @property
    def stress(self) -> StressField:
        """Solution of the load case that paths are planned and evaluated for, or the heaviest."""
        return self.cases.heaviest

    @property
    def planned_on(self) -> PartStress:
        """Stress that the paths are planned and evaluated on."""
        return self.stress if self.given is None else self.given

    @property
    def bound(self) -> UpperBound | None:
        """What no paths of the largest length can exceed; None without a bound."""
        return self.bounds[max(self.bounds)] if self.bounds else None

    @property
    def several_cases(self) -> bool:
        """Whether paths are planned for more than one load case."""
        return len(self.cases) > 1

    @property
    def over_slicings(self) -> bool:
        """Whether slicings are compared with each other."""
        return self.request.named

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Layers of the part; an error where several slicings are compared."""
        if len(self.stacks) > 1:
            raise InputError(
                f"a comparison over slicings has layers for each: {', '.join(self.stacks)}; take "
                ".slicings[NAME].layers"
            )
        return next(iter(self.stacks.values()))

    @property
    def fibre_per_layer(self) -> float | None:
        """Length per layer that every run was held to, mm; None where there is none for all."""
        return None if isinstance(self.wanted, InAll) else self.wanted

    @property
    def fibre(self) -> float | None:
        """Length in all layers that every run was held to, mm; None where there is none for all."""
        if isinstance(self.wanted, InAll):
            return self.wanted.length
        return None if self.wanted is None else self.wanted * len(self.layers)

    @cached_property
    def slicings(self) -> Mapping[str, "Comparison"]:
        """Comparison of the strategies on each slicing alone, by its name."""
        if not self.over_slicings:
            return {"": self}
        parts = {}
        for name, layers in self.stacks.items():
            slicing = {"": self.request.slicings[name]}
            request = replace(self.request, slicings=slicing, curve=False)
            runs = [
                replace(run, name=run.strategy_name, slicing="")
                for run in self.runs
                if run.slicing == name
            ]
            wanted = None if self.fibre is None else self.fibre / len(layers)
            parts[name] = replace(
                self,
                request=request,
                stacks={"": layers},
                runs=tuple(runs),
                wanted=wanted,
                refused={},
                seconds={},
                bounds={},
                of_slicers=(),
            )
        return parts

    @property
    def broken(self) -> dict[str, BreakingLoad]:
        """Breaking loads by name of the run, that of the part without fibre first."""
        bare = {} if self.bare is None else {"without fibre": self.bare}
        return bare | {run.name: run.broken for run in self.ranking if run.broken is not None}

    def plot(self) -> "Figure":
        """Draw the paths of all strategies on the middle one of the layers with fibre.

        Of several slicings that of the best run is drawn.
        """
        best = next(iter(self.ranking)).slicing if self.over_slicings else ""
        shown = self.slicings[best]
        return shown.plot_layer(shown_layer(shown.succeeded, shown.layers))

    def plot_layer(self, index: int) -> "Figure":
        """Draw the paths of all strategies on one layer, on the tension there.

        Parameters
        ----------
        index : int
            Of the layer (`Layer.index`): the first one is 0.
        """
        machine = self.case.machine
        return layer_view(self.succeeded, self.layers, self.planned_on, machine, index)

    def pareto(self, over: str | None = None) -> "Figure":
        """Draw stiffness over another index, and the front of the printable runs.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
            By default the length of fibre; over slicings, where all lay the same, the load at first
            failure.
        """
        default = "first_failure_load" if self.over_slicings else "fibre_length"
        return front_picture(self.succeeded, over or default)

    def show(self, run: str | None = None, picture: str | Path | None = None) -> View | None:
        """Show the paths of one run in the part, in a window, a notebook, or as a picture.

        Parameters
        ----------
        run : str, optional
            Such as ``"zigzag"``, or ``"zigzag on planar:z"``; by default the best one.
        picture : path, optional
            Write the view to a file (.png) instead.
        """
        runs = {ranked.name: ranked for ranked in self.ranking if len(ranked.toolpaths)}
        name = next(iter(runs), "") if run is None else run
        check_known("run with paths" if self.over_slicings else "strategy with paths", name, runs)
        layers = self.stacks[runs[name].slicing]
        return show((runs[name].toolpaths, *layers[:1]), picture)

    @property
    def succeeded(self) -> tuple[Run, ...]:
        """Runs that did not fail."""
        return tuple(run for run in self.runs if run.evaluation is not None)

    @property
    def ranking(self) -> tuple[Run, ...]:
        """Runs from the best to the worst, failed ones last."""
        return ranking(self.runs, self.wanted)

    @property
    def verdict(self) -> str:
        """One sentence on which run is best; empty where there is none to compare."""
        if self.several_cases:
            return cases_verdict(self.runs, self.wanted, self.bound)
        return verdict(self.runs, self.wanted)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """The verdict, and those along the curve."""
        along = () if self.curve is None else self.curve.verdicts
        return tuple(dict.fromkeys(verdict for verdict in (self.verdict, *along) if verdict))

    @property
    def remarks(self) -> list[str]:
        """Remarks to be shown with the numbers, one line each."""
        lines = [f"{name}: cannot cut the part: {why}" for name, why in self.refused.items()]
        lines += self.of_slicers
        if self.case.fibre is not None:
            where = "fibre" if self.over_slicings else f"fibre on {len(self.layers)} layers"
            lines.append(f"{where}: {self.case.fibre.about()}")
        if not self.case.plastic.solid:
            filled = self.stress.problem.filled
            lines.append(
                f"plastic: {self.case.plastic.about()}; {filled:.0%} of the volume is filled, with "
                "fibre and without: stiffness ratios are to that part"
            )
        if self.over_slicings:
            thick = (f"{name} {self._count(name)}" for name in self.stacks)
            lines.append(f"layers: {', '.join(thick)}")
        alone = None if self.several_cases else self.bound
        if self.bare is not None:
            lines.append(f"without fibre: {self.bare.said}")
        lines += remarks(self.runs, self.wanted, alone)
        if not self.over_slicings:
            lines += open_remarks(self.succeeded, self.layers, self.case.machine.fibre_width)
        if self._without_curve:
            lines.append(
                "one length of fibre does not suit all strategies, and a curve over the length "
                "would take minutes on this part: ccfem compare --curve follows it (curve=True)"
            )
        if self.several_cases:
            others = bool(self.case.alternative_supports)
            lines += cases_remarks(self.runs, self.wanted, self.cases, self.bound, others)
        if self.given is not None:
            assumed = f"; {self.given.assumed}" if self.given.assumed else ""
            lines.append(
                f"paths are planned and evaluated on the stress of another program{assumed}"
            )
        return lines

    @property
    def _without_curve(self) -> bool:
        """Whether a curve is missing that would be followed on a smaller part."""
        request = self.request
        if self.curve is not None or request.curve is False or request.named or self.several_cases:
            return False
        tested = any(run.tested is not None for run in self.runs)
        return tested and not one_length_suits(self.runs, self.wanted)

    @property
    def notes(self) -> list[str]:
        """Findings on mesh, part and solution, and the remarks, the most important first."""
        lines = [f"mesh: {line}" for line in self.case.findings]
        lines += [f"warning: {line}" for line in self.stress.findings]
        return by_importance([*lines, *self.remarks])

    def _count(self, slicing: str) -> str:
        """Say how many layers a slicing has, and how many of them hold fibre of any run."""
        runs = (run for run in self.succeeded if run.slicing == slicing)
        indices = {int(k) for run in runs for k in run.toolpaths.layer.tolist()}
        return f"{len(self.stacks[slicing])} ({len(indices)} with fibre)"

    @property
    def frame(self) -> "pd.DataFrame":
        """One row a run in order of rank: rank, strategy, printable, why_not and every index.

        Over several slicings a column slicing stands before the strategy.
        """
        table = frame(self.ranking)
        if self.over_slicings:
            table["strategy"] = [run.strategy_name for run in self.ranking]
            table.insert(1, "slicing", [run.slicing for run in self.ranking])
        return table
