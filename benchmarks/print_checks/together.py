"""Several parts in one file: what a printer did of each, as if it had been printed alone.

Run ``python -m benchmarks.print_checks.together [PART[:COPIES],...] [MACHINE,...] [--infill gyroid]
[--pictures FOLDER]``. A row a machine: parts in the file, changes of tools, volume of matrix and
fibre over the room for it in each part (with infill: in what is solid and in what is sparse), time
of the file, and of its moves over that of pyGCodeDecode where it is installed. Below the table
stands all that the checks of `benchmarks.print_checks` find, of the file and of every part in it.
"""

import argparse
import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import shapely
from shapely.affinity import translate

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.estimators import estimate
from benchmarks.print_checks.filling import amount, feeding, fullness, places, shapes, volume
from benchmarks.print_checks.infill import part_of, regions_of, volumes
from benchmarks.print_checks.job import Job, Lines
from benchmarks.print_checks.motion import air, support
from benchmarks.print_checks.parts import Part, job_of
from benchmarks.print_checks.printer import Run
from ccfem.machine import machine_names
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import Standing
from ccfem.printing.together import arranged

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
        job.done = seen(whole.done, standing, _shift(standing, alone))
        jobs.append(job)
    return jobs


def findings(whole: Job, alone: Mapping[str, Job], left_out: Sequence[str] = ()) -> list[str]:
    """All that is wrong with a file and with the parts in it, a line a finding.

    Parameters
    ----------
    left_out : sequence of str
        Checks of parts that do not apply.
    """
    wrong = [
        f"{check.__name__}: {line}"
        for check in CHECKS
        if check not in OF_A_PART
        for line in check(whole, whole.done)
    ]
    jobs = jobs_of(whole, alone)
    for standing, job in zip(whole.plan.standing, jobs, strict=True):
        for check in OF_A_PART:
            if check.__name__ in left_out:
                continue
            said = f"{standing.name} at {standing.low}, {check.__name__}"
            wrong += [f"{said}: {line}" for line in check(job, job.done)]
    return wrong


def file_of(
    parts: Sequence[Part], copies: Sequence[int], machine: str
) -> tuple[Job, dict[str, Job]]:
    """One file of several parts, and each of them alone."""
    alone = {part.name: job_of(part, machine)[0] for part in parts}
    first = next(iter(alone.values())).machine
    plans, layouts = [job.plan for job in alone.values()], [BedLayout(copies=(k,)) for k in copies]
    plan = arranged(plans, layouts, first, [*alone])
    text = gcode(plan, first)

    def section(z: float) -> shapely.Geometry:
        return shapely.union_all(
            [
                translate(alone[standing.name].section(z), *-_shift(standing, alone))
                for standing in plan.standing
            ]
        )

    return Job(machine, first, plan, text, [], cache(section), lambda _: 0.0, 0.0), alone


def _shift(standing: Standing, alone: Mapping[str, Job]) -> np.ndarray:
    """Shift (2,), mm, of a part in a file to where it is planned alone."""
    return alone[standing.name].plan.paths.points[:, :2].min(axis=0) - standing.low


def row(whole: Job, alone: Mapping[str, Job], plastic: Plastic) -> list[str]:
    """Print the row of a file; what is wrong with it but not with a part alone, line by line."""
    full = []
    for standing, job in zip(whole.plan.standing, jobs_of(whole, alone), strict=True):
        if plastic.solid:
            shares = [fullness(job, job.done)[0]]
        else:
            shares = [*volumes(job, regions_of(job, plastic), plastic.density)]
        full.append(f"{standing.name} {'/'.join(f'{share:.1%}' for share in shares)}")
    seconds = float(whole.done.head["TIME"])
    heating = float(whole.done.head[_HEATING].removesuffix(" s"))
    try:
        ratio = f"{(seconds - heating) / estimate(whole.text).seconds:.3f}"
    except ImportError:
        ratio = "-"
    print(
        f"{whole.name:17} {len(full):5d} {len(whole.done.changes):7d} {seconds / 60:6.0f} "
        f"{ratio:>6}  {', '.join(full)}",
        flush=True,
    )
    left_out = () if plastic.solid else ("volume", "air")
    known = [
        f"{check.__name__}: {line}"
        for job in alone.values()
        for check in OF_A_PART
        for line in check(job, job.done)
    ]
    # Strands have other numbers in a file of several parts.
    same = tuple(_STRAND.sub("strand", line) for line in known)
    wrong = findings(whole, alone, left_out)
    return [line for line in wrong if not _STRAND.sub("strand", line).endswith(same)]


_STRAND = re.compile(r"strand \w+")
_HEATING = "of it waiting for tools to heat, first heating left out"


def draw(whole: Job, file: Path) -> None:
    """Draw all that is laid, seen from above: the lowest layer, and fibre over contours."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    lines, figure = Lines.of(whole.done), Figure(figsize=(20, 10), layout="constrained")
    strokes = np.stack([lines.start, lines.end], axis=1)[:, :, :2]
    low = lines.end[:, 2].round(3) == lines.end[lines.lays][:, 2].min().round(3)
    outer = lines.kind == "External perimeter"
    for axis, shown in zip(figure.subplots(1, 2), (low, outer | (lines.tool == 1)), strict=True):
        for colour, mine in (
            ("#9db4cc", lines.in_part & (lines.tool == 0)),
            ("#d98c3f", lines.kind == "Support material"),
            ("#5a9a5a", lines.kind == "Wipe tower"),
            ("#b5b5b5", lines.kind == "Skirt/Brim"),
            ("#0d2f5c", lines.tool == 1),
        ):
            chosen = strokes[lines.lays & shown & mine]
            axis.add_collection(LineCollection(list(chosen), colors=colour, linewidths=0.6))
        axis.set_aspect("equal")
        axis.autoscale_view()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=60)


def main() -> int:
    """Print the table; the number of findings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="?", default="loop:2,box")
    parser.add_argument("machines", nargs="?", default=",".join(machine_names()))
    parser.add_argument("--infill", default="solid")
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args()
    plastic = Plastic() if given.infill == "solid" else Plastic(given.infill, 0.2, 2, 3)
    named = [text.partition(":") for text in given.parts.split(",")]
    parts = [part_of(name, plastic) for name, *_ in named]
    copies = [int(count or 1) for *_, count in named]
    print("machine           parts changes    min  moves  full")
    said = []
    for machine in given.machines.split(","):
        whole, alone = file_of(parts, copies, machine)
        said += [f"{machine}: {line}" for line in row(whole, alone, plastic)]
        if given.pictures is not None:
            draw(whole, given.pictures / f"together_{machine}_{given.infill}.png")
    print("\n".join(said))
    return len(said)


if __name__ == "__main__":
    raise SystemExit(min(main(), 1))
