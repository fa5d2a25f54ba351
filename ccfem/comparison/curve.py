"""Stiffness over the length of fibre, for comparisons in which no single length suits all."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import freeze
from ccfem.base.parallel import in_processes
from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import off_length
from ccfem.comparison.request import Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import Part, Tell, attempted, evaluated, planned_to_lengths
from ccfem.comparison.verdict import verdict
from ccfem.judging.evaluation.strand_rules import StrandVerdict
from ccfem.paths.planning.equal_fibre import extremes
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.planning.strategy import LengthStrategy, Planned

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = (
    "fibre_per_layer",
    "stiffness",
    "stiffness_ratio_tension",
    "stiffness_ratio_partial",
    "stiffness_ratio_bonded",
    "first_failure_load",
    "efficiency",
)


def one_length_suits(runs: Sequence[Run], wanted: Wanted) -> bool:
    """Whether no strategy lays a length other than the wanted one, since it cannot lay that."""
    return not any(
        off_length(run, wanted) and not isinstance(run.strategy, GivenPaths)
        for run in runs
        if not run.failure
    )


@dataclass(frozen=True)
class Curve:
    """Runs of every strategy at several lengths of fibre.

    Attributes
    ----------
    lengths : tuple of float, mm per layer
        Lengths that all strategies are held to; empty if there is no length that all reach.
    points : mapping of strategy name to tuple of (float, Run)
        Wanted length, mm per layer, and the run, from the least fibre to the most.
    """

    lengths: tuple[float, ...]
    points: Mapping[str, tuple[tuple[float, Run], ...]]

    def __post_init__(self) -> None:
        freeze(self, points=dict)

    @property
    def runs(self) -> dict[str, tuple[Run, ...]]:
        """Runs of each strategy that laid fibre and were tested."""
        return {
            name: tuple(run for _, run in points if run.tested is not None)
            for name, points in self.points.items()
        }

    def at(self, length: float) -> tuple[Run, ...]:
        """Return the run of each strategy that lays a length, mm per layer."""
        closest = []
        for points in self.points.values():
            runs = [run for wanted, run in points if wanted == length]
            closest += [run for run in runs if not off_length(run, length)][:1]
        return tuple(closest)

    @property
    def common(self) -> tuple[float, ...]:
        """Lengths, mm per layer, that all strategies reach."""
        return tuple(x for x in self.lengths if len(self.at(x)) == len(self.points))

    @property
    def verdicts(self) -> tuple[str, ...]:
        """One sentence for each length that all reach, or why there is none."""
        if len(self.points) < 2:
            return ()
        if not self.common:
            spans = ", ".join(
                f"{name} {runs[0].length_per_layer:.0f} to {runs[-1].length_per_layer:.0f}"
                for name, runs in self.runs.items()
                if runs
            )
            return (f"No length of fibre is one that all reach: {spans} mm a layer.",)
        verdicts = [verdict(self.at(length), length) for length in self.common]
        if not any(verdicts):
            return ("Along the curve no two strategies can be printed as planned.",)
        return tuple(sentence for sentence in verdicts if sentence)

    @property
    def frame(self) -> "pd.DataFrame":
        """One row a point: strategy, wanted length, whether all reach it, and the results."""
        import pandas as pd

        rows = []
        for name, points in self.points.items():
            for wanted, run in points:
                values = headline_values(run)
                rows.append(
                    {
                        "strategy": name,
                        "wanted_per_layer": wanted,
                        "reached": not off_length(run, wanted) and run.evaluation is not None,
                        "reached_by_all": wanted in self.common,
                        "printable": run.printable,
                        "why_not": run.why_not,
                        "failure": run.failure,
                        "empty_layers": run.empty_layers,
                        **{column: values.get(column, np.nan) for column in _COLUMNS},
                    }
                )
        return pd.DataFrame(rows)


# Stages of the curve: lengths, plans, tests.


_COMMON = 3
"""Number of lengths that all strategies are held to."""
_APART = 0.1
"""Least relative step between the lengths of a curve."""


@dataclass(frozen=True)
class _Reach:
    """Least and most that one strategy lays, mm per layer, with plans that show it."""

    run: Run
    least: float
    most: float
    known: tuple[Planned, ...] = ()


def along_curve(
    runs: Sequence[Run],
    part: Part,
    wanted: float | None,
    tested: Callable[[Run, Part], Run],
    tell: Tell,
) -> Curve:
    """Plan and test every strategy at three to five lengths of fibre.

    Three lengths are ones that all reach, from the largest of the least to the smallest of the most
    lengths. The other two are a strategy's own least and most. If the ranges do not overlap, each
    strategy has three lengths of its own. Given paths are one point each.

    Parameters
    ----------
    runs : sequence of Run
        With the strategies as they were asked for, and their lengths.
    wanted : float, mm, or None
        Length per layer of the comparison; one of the three if possible.
    tested : callable
        Tests a run of the part virtually.
    """
    reaches = [reach for reach in (_reach(run, part, tell) for run in runs) if reach is not None]
    free = [reach for reach in reaches if not isinstance(reach.run.strategy, GivenPaths)]
    lengths = _common(free, [one.least for one in reaches if one not in free], wanted)
    points: dict[str, tuple[tuple[float, Run], ...]] = {}

    def judged(run: Run) -> Run:
        return tested(evaluated(run, part), part)

    for reach in reaches:
        asked = _asked(reach, lengths)
        tell(f"planning {reach.run.name} along the curve")
        planned = _planned(reach, asked, part)
        done = in_processes(judged, planned, shared=[part, tested])
        points[reach.run.name] = tuple(zip(asked, done, strict=True))
    return Curve(lengths, points)


def _reach(run: Run, part: Part, tell: Tell) -> _Reach | None:
    """Find what a strategy lays at the least and at the most; None where it fails."""
    strategy: Any = run.strategy
    if run.failure:
        return None
    if isinstance(strategy, GivenPaths):
        return _Reach(run, run.length_per_layer, run.length_per_layer)
    if isinstance(strategy, LengthStrategy):
        amount = strategy.amount
        kinds: list[Any] = [
            replace(strategy, **{amount.parameter: value})  # type: ignore[type-var]
            for value in (amount.least, amount.most)
        ]
        least, most = (kind.natural_length(part.layers, part.machine) for kind in kinds)
        return _Reach(run, least, most)
    tell(f"planning the least and the most of {run.name}")
    ends: list[tuple[Planned, Planned]] = []

    def work() -> Run:
        ends.append(extremes(strategy, part.layers, part.stress, part.machine))
        return run

    if attempted(run, work).failure or not ends[0][1].length_per_layer > 0.0:
        return None
    least, most = (extreme.length_per_layer for extreme in ends[0])
    return _Reach(run, least, most, ends[0])


def _common(
    reaches: Sequence[_Reach], given: Sequence[float], wanted: float | None
) -> tuple[float, ...]:
    """Lengths that all reach: the ends of the reach of all, and one between."""
    if not reaches:
        return tuple(sorted(set(given)))
    low, high = max(reach.least for reach in reaches), min(reach.most for reach in reaches)
    if low > high:
        return ()
    if high < (1.0 + _APART) * low:
        return (low,)
    inner = [x for x in (*given, wanted) if x is not None and low < x < high]
    inner = [x for x in inner if x > (1.0 + _APART) * low and high > (1.0 + _APART) * x]
    if inner:
        return (low, inner[0], high)
    return tuple(float(x) for x in np.linspace(low, high, _COMMON))


def _asked(reach: _Reach, lengths: Sequence[float]) -> list[float]:
    """Lengths that one strategy is planned to, from the least to the most."""
    if reach.least == reach.most:
        near = [x for x in lengths if abs(reach.least / x - 1.0) <= 0.01]
        return near[:1] or [reach.least]
    if not lengths:
        return [float(x) for x in np.linspace(reach.least, reach.most, _COMMON)]
    asked = list(lengths)
    if reach.least < asked[0] / (1.0 + _APART):
        asked.insert(0, reach.least)
    if reach.most > asked[-1] * (1.0 + _APART):
        asked.append(reach.most)
    if len(asked) < _COMMON:  # there is one common length: others at both sides of it
        ends = sorted({reach.least, *asked, reach.most})
        asked = sorted({*asked, *(0.5 * (a + b) for a, b in itertools.pairwise(ends))})
    return asked


def _planned(reach: _Reach, asked: Sequence[float], part: Part) -> list[Run]:
    """Plan one strategy to several lengths; a failure is in all of the runs."""
    bare = replace(
        reach.run,
        evaluation=None,
        strand_verdict=StrandVerdict(),
        tested=None,
        print_plan=None,
        moves=None,
        print_totals=None,
        why_not="",
        note="",
    )
    if isinstance(reach.run.strategy, GivenPaths):
        return [bare for _ in asked]
    return planned_to_lengths(bare, part, asked, reach.known)
