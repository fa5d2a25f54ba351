"""The result of a study: one row a run, failed ones included."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ccfem.base.arrays import freeze
from ccfem.base.errors import InputError
from ccfem.comparison.plot.values import image
from ccfem.comparison.studies.jobs import Job
from ccfem.comparison.studies.study_fronts import COST, GAIN, with_fronts
from ccfem.comparison.studies.study_table import shown_table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NOT_RUN = "not run yet: start the study again"

_OWNERS = ("part", "load_case", "slicing", "study", "strategy")
_SAID = ("printable", "why_not", "failure", "untested", "note", "fails_in", "empty_layers")
_TITLES = {
    "fibre_length": "fibre, mm",
    "print_time_nearest": "time to lay the fibre, min",
    "first_failure_load": "first failure, N",
    GAIN: "stiffness, N/mm",
}
_SHOWN = 12
"""Rows that a notebook shows."""


@dataclass(frozen=True)
class StudyResult:
    """All runs of a study.

    Attributes
    ----------
    folder : Path
        Where its tables, its page and its runs are.
    jobs : tuple of Job
    outcomes : mapping of key to outcome
        Of the runs that were made.
    repeated : int
        Runs that were named more than once.
    computed : int
        Runs that were made this time; the others were there.
    """

    name: str
    folder: Path
    jobs: tuple[Job, ...]
    outcomes: Mapping[str, Mapping[str, Any]]
    repeated: int = 0
    computed: int = 0

    def __post_init__(self) -> None:
        freeze(self, jobs=tuple)

    def __repr__(self) -> str:
        return f"StudyResult of {self.about} in {self.folder}"

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.about}", *self.remarks]
        return "\n".join(lines)

    @property
    def about(self) -> str:
        """Runs in numbers."""
        failed = sum(bool(self.outcome(job)["failure"]) for job in self.jobs)
        parts = len({job.part for job in self.jobs})
        return (
            f"{len(self.jobs)} runs on {parts} part{'s' if parts > 1 else ''}, {self.computed} "
            f"computed now, {failed} failed"
        )

    def outcome(self, job: Job) -> Mapping[str, Any]:
        """Say what became of a run."""
        return self.outcomes.get(job.key, {"failure": NOT_RUN})

    @property
    def remarks(self) -> tuple[str, ...]:
        """What has to stand next to the numbers, a line each."""
        reasons: dict[str, list[str]] = {}
        for job in self.jobs:
            outcome = self.outcome(job)
            if outcome["failure"]:
                reasons.setdefault(f"failed: {outcome['failure']}", []).append(job.name)
            elif outcome.get("untested"):
                reasons.setdefault(f"not tested: {outcome['untested']}", []).append(job.name)
            for line in outcome.get("findings", ()):
                reasons.setdefault(f"warning: {line}", []).append(job.name)
        texts = [
            f"{names[0]}{f' and {len(names) - 1} more' if names[1:] else ''} {reason}"
            for reason, names in reasons.items()
        ]
        if self.repeated:
            texts.append(f"{self.repeated} runs were listed more than once: each is computed once")
        return tuple(texts)

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """One row a run, in the order of the study, failed ones included.

        Columns run (the beginning of its hash), part, load_case, slicing, strategy and the
        parameters that were given (``strategy.density``, ``part.element_size``); printable,
        why_not, failure, untested, note; every index; and for each front whether a run is on it.
        """
        import pandas as pd

        names = dict.fromkeys(name for job in self.jobs for name in job.labels)
        labels = [name for owner in _OWNERS for name in names if name.partition(".")[0] == owner]
        rows = []
        for job in self.jobs:
            outcome = self.outcome(job)
            said = {name: outcome.get(name) for name in _SAID}
            said |= {"printable": bool(said["printable"])}
            values = {k: float(v) for k, v in outcome.get("values", {}).items() if k not in said}
            rows.append({"run": job.key[:12], **_row(job, labels), **said, **values})
        return with_fronts(pd.DataFrame(rows))

    @property
    def seconds(self) -> "pd.DataFrame":
        """Seconds of each stage of each run."""
        import pandas as pd

        rows = [
            {"run": job.key[:12], "name": job.name, **self.outcome(job).get("seconds", {})}
            for job in self.jobs
        ]
        return pd.DataFrame(rows)

    def front(self, over: str = "fibre_length") -> "pd.DataFrame":
        """Rows of the runs that no other one dominates in stiffness over another index.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
        """
        return self.frame[self.frame[f"front_{_known(over)}"]]

    def plot(self, over: str = "fibre_length") -> "Figure":
        """Draw stiffness over another index, a panel for each part and load case.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
        """
        from ccfem.comparison.plot.fronts import FrontPoint, front_figure

        panels: dict[str, list[FrontPoint]] = {}
        frame, over = self.frame, _known(over)
        scale = 1.0 / 60.0 if over == "print_time_nearest" else 1.0
        geometry = [name for name in frame.columns if name.startswith("part.")]
        if GAIN in frame and over in frame:
            for row in frame[frame[GAIN].notna() & frame[over].notna()].to_dict("records"):
                settings = [
                    f"{k.partition('.')[2]} {row[k]}" for k in geometry if row[k] is not None
                ]
                heading = ", ".join([str(row["part"]), *settings, str(row["load_case"])])
                panels.setdefault(heading, []).append(
                    FrontPoint(
                        str(row["strategy"]),
                        scale * float(row[over]),
                        float(row[GAIN]),
                        bool(row[f"front_{over}"]),
                        bool(row["printable"]),
                    )
                )
        return front_figure(panels, _TITLES[over], _TITLES[GAIN])

    def _repr_html_(self) -> str:
        remarks = "".join(f"<p>{escape(line)}</p>" for line in self.remarks)
        more = len(self.jobs) - _SHOWN
        rest = f"<p>and {more} more in <code>.frame</code></p>" if more > 0 else ""
        table = shown_table(self.frame.head(_SHOWN))
        if self.frame["front_fibre_length"].any():
            rest += image(self.plot())
        return f"<p>{escape(self.name)}: {escape(self.about)}</p>{table}{rest}{remarks}"


def _row(job: Job, labels: list[str]) -> dict[str, Any]:
    return {name: job.labels.get(name) for name in labels}


def _known(over: str) -> str:
    if over not in COST:
        raise InputError(f"fronts are drawn over {', '.join(COST)}; got {over!r}: choose one")
    return over
