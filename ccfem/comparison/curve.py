"""Stiffness over the length of fibre, for comparisons in which no single length suits all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import freeze
from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import off_length
from ccfem.comparison.request import Wanted
from ccfem.comparison.runs import Run
from ccfem.comparison.verdict import verdict
from ccfem.paths.planning.given_paths import GivenPaths

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
        if run.evaluation is not None
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
