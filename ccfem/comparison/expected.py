"""Progress of a run, by the time that its steps are expected to take."""

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ccfem.base.progress import Progress, about
from ccfem.comparison.effort import (
    FILLED,
    Counts,
    counts,
    judging_stages,
    planning_stage,
    plans_to_lengths,
    stage_effort,
)
from ccfem.comparison.request import Natural, Request, Spread

_BREAKING = 10.0
"""Time of a breaking load over that of judging: a guess, so that the bar moves on."""

_SURE = 0.3
"""Seconds that are added to the time of a step and to the expected one, before their ratio counts:
short steps say little of the pace."""

_PRIOR = 1.0
"""Weight of the machine that was measured in the pace, beside the root of the expected seconds of
each step. Our choice, by `python -m benchmarks.speed.effort`."""

_LONG = 60.0
"""Seconds from which a run says at its start what it will take. Our choice."""

START = "start"
WRITING = ("writing results", "writing the report")


@dataclass
class Schedule:
    """Tells progress what is done next, and the share of the time of the whole run that has passed.

    The time to come is what is expected of the steps to come, at the pace of those that are done:
    the mean of the logarithms of how much longer than expected they took. One step that is badly
    predicted thus changes little for the others.
    """

    progress: Progress
    command: bool = False  # the run also starts the program, and writes files
    # s, by the first words of a step: the time expected in all, and that which passed so far in
    # those that were begun. What else is done counts nothing.
    steps: dict[str, float] = field(default_factory=dict)
    passed: dict[str, float] = field(default_factory=dict)
    _aside: set[str] = field(default_factory=set)  # steps that are done beside others

    def __post_init__(self) -> None:
        self._began = self._last = time.perf_counter()
        self._step, self._begun, self._wait = next(iter(self.passed), ""), False, 0.0

    def __call__(self, what: str, _: float = 0.0) -> None:
        """Say what is done next: what was said before is done."""
        now = time.perf_counter()
        self.passed[self._step] = self.passed.get(self._step, 0.0) + now - self._last
        begun = (step for step in self.steps if f"{what} ".startswith(f"{step} "))
        self._last, self._step = now, max(begun, key=len, default="")
        self.passed.setdefault(self._step, 0.0)
        spent, left = now - self._began, self.left()
        if left > _LONG and not self._begun:
            what = f"{what} ({about(spent + left)} in all)"
        self._begun = True
        self.progress(what, spent / (spent + left) if spent + left else 0.0)

    def left(self) -> float:
        """Seconds that are left."""
        weights = logarithms = 0.0
        for step, spent in self.passed.items():
            # What was waited for of a step that is done beside others says nothing of the pace.
            alone = step not in {self._step, *self._aside}
            if alone and (expected := self.steps.get(step)):
                weight = math.sqrt(expected)
                weights += weight
                logarithms += weight * math.log((spent + _SURE) / (expected + _SURE))
        pace = math.exp(logarithms / (weights + _PRIOR))
        begun = {*self.passed, *self._aside}
        to_come = sum(expected for step, expected in self.steps.items() if step not in begun)
        to_come += 0.0 if {*self.passed} & {*self._aside, *WRITING} else self._wait
        now = 0.0 if self._step in self._aside else self.steps.get(self._step, 0.0)
        return pace * to_come + max(pace * now - self.passed.get(self._step, 0.0), 0.0)

    def expect(self, steps: Mapping[str, float]) -> None:
        """Set the time that is expected of steps, also of those that turned out to be needed."""
        self.steps |= steps

    def beside(self, steps: Iterable[str]) -> None:
        """Take steps for done beside all others before the writing; these end no earlier."""
        self._aside |= {*steps} & {*self.steps}
        here = [step for step in self.steps if step not in {*self.passed, *self._aside, *WRITING}]
        longer = sum(self.steps[step] for step in self._aside)
        self._wait = max(longer - sum(self.steps[step] for step in here), 0.0)


def expected_steps(
    request: Request, known: Mapping[str, Counts], cases: int, command: bool = False
) -> dict[str, float]:
    """First words and seconds of the steps of a run.

    Parameters
    ----------
    known : mapping of slicing to Counts
    cases : int
        Load cases that are planned for.
    command : bool, default False
        With the start of the program, and the writing of files.
    """
    steps: dict[str, float] = {}
    lengths = request.amount.points if isinstance(request.amount, Spread) else 1
    plans = cases * lengths
    for slicing, part in known.items():
        steps["solving"] = stage_effort("solve", part)
        tested = request.strand is not None and FILLED * part.room <= request.longest_test
        judging = sum(
            stage_effort(stage, part) for stage in judging_stages(request.print_plans, tested)
        )
        for name in request.strategies:
            run = request.on_slicing(name, slicing)
            stage = planning_stage(name, isinstance(request.amount, Natural))
            planning = plans_to_lengths(name, lengths) * stage_effort(stage, part)
            steps[f"planning {run}"] = cases * planning
            steps[f"judging {run}"] = plans * judging
            if request.breaking_load:
                steps[f"breaking {run}"] = _BREAKING * judging
        if request.bound and tested and (lengths > 1 or not slicing):
            bounding = plans * stage_effort("bound", part)
            steps["bounding"] = max(bounding, steps.get("bounding", 0.0))
        if command:
            steps[START] = stage_effort("start", part)
            written = "write a print" if request.print_plans else "write"
            for step, stage in zip(WRITING, (written, "report"), strict=True):
                steps[step] = steps.get(step, 0.0) + stage_effort(stage, part)
    return steps


def steps_before_solving(request: Request, command: bool) -> dict[str, float]:
    """Expect the steps of a run, where its layers are known before the part is solved."""
    case = request.case
    layers = () if request.named else case.known_layers(request.only_slicer)
    if not layers:
        return {}
    known = Counts.of(case.problem.mesh, layers, case.machine)
    if case.problem.order == 2:
        known = counts(case, layers)[0]
    return expected_steps(request, {"": known}, 1, command)
