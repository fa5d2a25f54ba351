"""The result of a study: one row a run, failed ones included."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ccfem.base.arrays import freeze
from ccfem.comparison.front import FRONTS, cost_of, on_front
from ccfem.comparison.plot.values import image
from ccfem.comparison.studies.jobs import Job, Outcome

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NOT_RUN = "not run yet: start the study again"

_OWNERS = ("part", "load_case", "slicing", "study", "strategy")
_SAID = ("printable", "why_not", "failure", "untested", "note", "fails_in", "empty_layers")
GAIN = "stiffness"
"""What fronts are of."""
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
    outcomes: Mapping[str, Outcome]
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

    def outcome(self, job: Job) -> Outcome:
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
            row = {name: outcome.get(name) for name in _SAID}
            row |= {"printable": bool(row["printable"])}
            values = {k: float(v) for k, v in outcome.get("values", {}).items() if k not in row}
            rows.append({"run": job.key[:12], **_row(job, labels), **row, **values})
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
        cost_of(over)
        return self.frame[self.frame[f"front_{over}"]]

    def plot(self, over: str = "fibre_length") -> "Figure":
        """Draw stiffness over another index, a panel for each part and load case.

        Parameters
        ----------
        over : {"fibre_length", "print_time_nearest", "first_failure_load"}
        """
        from ccfem.comparison.plot.curves import FrontPoint, front_figure

        panels: dict[str, list[FrontPoint]] = {}
        frame, cost = self.frame, cost_of(over)
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
                        cost.factor * float(row[over]),
                        float(row[GAIN]),
                        bool(row[f"front_{over}"]),
                        bool(row["printable"]),
                    )
                )
        return front_figure(panels, cost.title, "stiffness, N/mm")

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


def with_fronts(table: "pd.DataFrame") -> "pd.DataFrame":
    """Table with a column for each front: whether a run is on it.

    Fronts are those of the printable runs of one part under one load case.
    """
    marked = table.copy()
    for cost, (_, _, better) in FRONTS.items():
        name = f"front_{cost}"
        marked[name] = False
        if GAIN not in marked or cost not in marked:
            continue
        printable = marked[marked["printable"].astype(bool)]
        shape = [column for column in marked.columns if column.startswith("part.")]
        for _, group in printable.groupby(["part", "load_case", *shape], dropna=False):
            chosen = on_front(group[cost].to_numpy(), group[GAIN].to_numpy(), better)
            marked.loc[group.index[chosen], name] = True
    return marked


# The table of a study in HTML.


_COLUMNS = {
    "printable": "printable",
    "stiffness": "stiffness, N/mm",
    "stiffness_ratio_tension": "stiffness ratio",
    "first_failure_load": "first failure, N",
    "fibre_length": "fibre, mm",
    "print_time_nearest": "laying fibre, s",
    "efficiency": "efficiency",
}


def shown_table(frame: "pd.DataFrame") -> str:
    """HTML table of the columns that say most; why a run failed stands in place of its numbers."""
    labels = [
        name
        for name in frame.columns
        if name in ("part", "load_case", "slicing", "strategy") or "." in name
    ]
    labels = [name for name in labels if frame[name].nunique(dropna=False) > 1] or ["strategy"]
    columns = [name for name in _COLUMNS if name in frame]
    titles = [*(name.removeprefix("strategy.") for name in labels), *(_COLUMNS[c] for c in columns)]
    rows = ["".join(f"<th>{escape(title)}</th>" for title in titles)]
    for row in frame.to_dict("records"):
        cells = "".join(f"<td>{escape(_text(row[name]))}</td>" for name in labels)
        if row["failure"]:
            text = escape(f"failed: {row['failure']}")
            cells += f'<td class="failed" colspan="{max(len(columns), 1)}">{text}</td>'
        else:
            cells += "".join(f"<td>{escape(_text(row[name]))}</td>" for name in columns)
        rows.append(cells)
    return "<table>" + "".join(f"<tr>{row}</tr>" for row in rows) + "</table>"


def _text(value: Any) -> str:
    if value is None or value != value:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
