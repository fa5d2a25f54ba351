"""Progress of a run, in shares of the time that its steps are expected to take."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from ccfem.base.progress import Progress
from ccfem.comparison.effort import (
    FILLED,
    Counts,
    cutting_effort,
    judging_stages,
    planning_stage,
    stage_effort,
)
from ccfem.comparison.request import Request, Spread

_BREAKING = 10.0
"""Time of a breaking load over that of judging: a guess, so that the bar moves on."""

_UNKNOWN = (0.9, 0.98)
"""Shares of a run that are behind when its results and its report are written, where its layers are
not known."""


@dataclass
class Schedule:
    """Tells progress what is done next, and the share of all expected time that is behind it."""

    progress: Progress
    # by words, s: first words of each step that is expected, and its time. What else is done counts
    # nothing.
    steps: dict[str, float]
    behind: float  # s: expected time of what is done already
    begun: set[str] = field(default_factory=set)  # steps of which the first words were said

    def __call__(self, what: str) -> None:
        """Say what is done next: what was said before is done."""
        done = self.behind + sum(self.steps[step] for step in self.begun)
        whole = self.behind + sum(self.steps.values())
        self.progress(what, done / whole if whole else 0.0)
        self.begun |= {step for step in self.steps if f"{what} ".startswith(f"{step} ")}

    def expect(self, steps: Mapping[str, float]) -> None:
        """Add steps that turned out to be needed."""
        self.steps |= steps


def expected_steps(request: Request, known: Mapping[str, Counts], cases: int) -> dict[str, float]:
    """First words and seconds of the steps between solving and writing.

    Parameters
    ----------
    cases : int
        Load cases that are planned for.
    """
    steps: dict[str, float] = {}
    plans = cases * (request.amount.points if isinstance(request.amount, Spread) else 1)
    for slicing, part in known.items():
        tested = request.strand is not None and FILLED * part.room <= request.longest_test
        judging = sum(
            stage_effort(stage, part) for stage in judging_stages(request.print_plans, tested)
        )
        for name in request.strategies:
            run = request.on_slicing(name, slicing)
            steps[f"planning {run}"] = plans * stage_effort(planning_stage(name), part)
            steps[f"judging {run}"] = plans * judging
            if request.breaking_load:
                steps[f"breaking {run}"] = _BREAKING * judging
        if request.bound and tested and not slicing:
            steps["bounding"] = plans * stage_effort("bound", part)
    return steps


def before_planning(part: Counts) -> float:
    """Seconds of cutting and solving a part."""
    return cutting_effort(part) + stage_effort("solve", part)


def shares_before_writing(request: Request) -> tuple[float, float]:
    """Shares of a run that are behind when its results, and when its report, are written."""
    layers = () if request.named else request.case.known_layers(request.only_slicer)
    if not layers:
        return _UNKNOWN
    part = Counts.of(request.case.problem.mesh, layers, request.case.machine)
    steps = expected_steps(request, {"": part}, 1)
    written = "write a print" if request.print_plans else "write"
    results = before_planning(part) + sum(steps.values())
    report = results + stage_effort(written, part)
    whole = report + stage_effort("report", part)
    return results / whole, report / whole
