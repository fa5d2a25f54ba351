"""Several parts in one file: what a printer did of each, as if it had been printed alone."""

import copy
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.filling import amount, feeding, places, shapes, volume
from benchmarks.print_checks.job import Job
from benchmarks.print_checks.motion import air, support
from benchmarks.print_checks.printer import Run
from ccfem.printing.print_plan import Standing

__all__ = ["findings", "jobs_of", "seen"]

OF_A_PART = (volume, feeding, shapes, support, amount, places, air)
"""Checks that hold what is laid against a part; the others are of a whole file."""
_ROUNDING = 1e-3
"""Of coordinates in files, mm."""


def seen(run: Run, standing: Standing, shift: np.ndarray) -> Run:
    """Find what was laid in the box of one part, moved by a shift (2,), mm."""
    x, y = shift.tolist()
    low, high = np.array(standing.low) - _ROUNDING, np.array(standing.high) + _ROUNDING
    ends = np.array([(step.start[:2], step.end[:2]) for step in run.steps])
    inside = ((ends >= low) & (ends <= high)).all(axis=(1, 2))
    steps = [
        replace(
            run.steps[k],
            start=(run.steps[k].start[0] + x, run.steps[k].start[1] + y, run.steps[k].start[2]),
            end=(run.steps[k].end[0] + x, run.steps[k].end[1] + y, run.steps[k].end[2]),
        )
        for k in np.flatnonzero(inside).tolist()
    ]
    return Run(steps=steps, head=run.head)


def jobs_of(whole: Job, alone: Mapping[str, Job]) -> list[Job]:
    """Every part in a file, with what the printer did of it moved to where it is planned alone.

    Parameters
    ----------
    alone : mapping of str to Job
        Of each part by its name, in the middle of the bed.
    """
    jobs = []
    for standing in whole.plan.standing:
        job = copy.copy(alone[standing.name])
        shift = job.plan.paths.points[:, :2].min(axis=0) - standing.low
        job.done = seen(whole.done, standing, shift)
        jobs.append(job)
    return jobs


def findings(whole: Job, alone: Mapping[str, Job]) -> list[str]:
    """All that is wrong with a file and with the parts in it, a line a finding."""
    wrong = [
        f"{check.__name__}: {line}"
        for check in CHECKS
        if check not in OF_A_PART
        for line in check(whole, whole.done)
    ]
    jobs = jobs_of(whole, alone)
    for standing, job in zip(whole.plan.standing, jobs, strict=True):
        for check in OF_A_PART:
            said = f"{standing.name} at {standing.low}, {check.__name__}"
            wrong += [f"{said}: {line}" for line in check(job, job.done)]
    return wrong
