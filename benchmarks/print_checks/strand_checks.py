"""The rules for every strand (`strand_rules`), for the strands of a file as a printer lays them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.print_checks.job import Job
from benchmarks.print_checks.motion import arc, beneath
from benchmarks.print_checks.printer import Run, Step
from benchmarks.print_checks.strand_rules import Measured, Rules, broken, measure

__all__ = ["STRAND_RULES", "cut_of", "measured", "points_of", "rules_of", "strands_of"]


def rules_of(machine: Any) -> Rules:
    """Rules with the values of a machine."""
    return Rules(
        width=machine.fibre_width,
        radius=machine.minimum_radius,
        length=machine.minimum_length,
        tail=machine.tail,
        held=machine.process.start_length,
    )


def strands_of(run: Run) -> list[list[Step]]:
    """Find the steps of each strand of the part: what tool 1 lays without a travel between."""
    strands: list[list[Step]] = []
    apart = True
    for step in run.steps:
        if step.tool != 1 or step.rapid:
            apart = True
        elif step.lays and not step.strand.startswith("beside"):
            if apart:
                strands.append([])
            strands[-1].append(step)
            apart = False
    return strands


def points_of(steps: Sequence[Step]) -> np.ndarray:
    """Places (n, 3) that the nozzle goes through."""
    return np.array([steps[0].start, *(step.end for step in steps)])


def cut_of(steps: Sequence[Step]) -> float:
    """Length that lies when a strand is cut; NaN where it is not cut."""
    along = arc(list(steps))
    return next((float(along[k]) for k, step in enumerate(steps) if step.cut), np.nan)


def measured(job: Any, run: Run) -> list[Measured]:
    """Strands of a run, measured once; what holds them is what the file lays below."""
    if run.measured is None:
        strands = strands_of(run)
        half = np.array([0.0, 0.0, 0.5 * job.machine.strand_height])
        lines = [points_of(steps) - half for steps in strands]
        result = measure(lines, rules_of(job.machine), job.section)
        below = {int(steps[0]): rest for steps, *rest in beneath(job, run)}
        for steps, strand in zip(strands, result, strict=True):
            _, way, held = below[steps[0].number]
            gaps = np.append(0.0, np.cumsum(way[:-1]))[~held]
            cut = cut_of(steps)
            strand.after_start = float(min(gaps, default=strand.length))
            strand.before_cut = cut - float(max(gaps[gaps < cut], default=0.0))
        run.measured = result
    return run.measured


def _check(rule: str, text: str) -> Any:
    """Check of one rule: a line a strand that breaks it."""

    def check(job: Job, run: Run) -> list[str]:
        rules = rules_of(job.machine)
        strands = ((k, broken(strand, rules)) for k, strand in enumerate(measured(job, run)))
        return [f"strand {k} {wrong[rule]}" for k, wrong in strands if rule in wrong]

    check.__name__, check.__doc__ = rule, text
    return check


STRAND_RULES = (
    _check("folds", "No strand turns more than the machine's radius allows."),
    _check("run", "Every strand has a run without a fold, as long as the cutter's length."),
    _check("outside", "A strand lies in the part with its width."),
    _check("crossings", "Strands of a layer do not cross."),
    _check("over", "Strands of a layer do not lie over each other."),
    _check("cut", "A strand is held by enough length before it is cut."),
    _check("start", "A strand is held along its start."),
)
"""Checks of the strands of a file, each of which says what is wrong, a line a strand."""
