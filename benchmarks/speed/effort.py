"""Measure what `ccfem.comparison.effort` tells: time and memory of whole commands.

    python -m benchmarks.speed.effort [--measure [PART ...]] [--write]

``--measure`` runs the two commands on each part that ``effort.csv`` beside this file lacks, a
process each with CCFEM_THREADS=1, and adds their lines: delete the file to measure all of it anew.
Compile first, by a run of each command on any part. Then a table shows, of each part, what the fit
to all others tells of it; ``--write`` writes the fit to all, which the program then tells by.
"""

import argparse
import csv
import itertools
import json
import logging
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.optimize import nnls

from benchmarks.speed.size import plate
from ccfem.base.arrays import FloatArray
from ccfem.base.progress import silent
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.comparison.effort import (
    COEFFICIENTS,
    MOST,
    TERMS,
    Coefficients,
    Counts,
    counts,
    judging_stages,
    pace,
    planning_stage,
    stage_effort,
    stages,
)
from ccfem.comparison.expected import START, Schedule
from ccfem.comparison.request import STRATEGIES
from ccfem.slicing.slicers.planar import Planar

MEASURED = Path(__file__).with_suffix(".csv")
"""A line a part and command: counts, gigabytes, CPU seconds of each stage."""

COMMANDS: dict[str, list[str]] = {
    "compare": ["compare", "--no-curve"],
    "plan": ["plan", "--gcode"],
    "untested": ["plan", "--gcode", "--no-virtual-test", "--strategy", "isocurve"],
}

PARTS = (
    "open_hole element_size=4",
    "l_shape",
    "bar",
    "loop",
    "bar element_size=1",
    "two_angle_bracket",
    "bracket",
    "plate 60 40 12",
    "bridge",
    "open_hole element_size=1.5",
    "loop element_size=2.1",
    "loop element_size=6",
    "bar order=2",
)
"""Cases with their parameters, and plates of two sides in mm and so many layers."""

PLANNED = {"compare": STRATEGIES, "plan": ("stream_function",), "untested": ("isocurve",)}
"""Strategies of each command."""

LARGE = (
    "loop",
    "bar element_size=1",
    "bar element_size=0.7",
    "bar element_size=0.45",
    "plate 200 150 8",
    "plate 400 300 8",
    "plate 400 300 16",
    "plate 400 300 72",
    "plate 100 75 600 4.36",
)
"""What is planned without a virtual test."""

_STAGES = {
    "solving": "solve",
    "planning": "plan",
    "judging": "judge",
    "bounding": "bound",
    "writing results": "write",
    "drawing": "report",
    "writing the report": "report",
}
"""Stage of a step of progress, by its first words."""


def part(said: str, folder: Path) -> tuple[list[str], Case]:
    """Make what a command gets for a part, and the part itself."""
    name, *values = said.split()
    if name == "plate":
        x, y, layers, *edge = map(float, values)
        file = folder / "plate.toml"
        file.write_text("order = 1\n" + plate(x, y, int(layers), *edge))
        case = replace(read(file), slicing=Planar(count=int(layers)))
        return [str(file), "--layers", str(int(layers))], case
    options = [word for value in values for word in ("--set-case", value)]
    given: dict[str, float] = {}
    for key, value in (one.split("=") for one in values):
        given[key] = int(value) if value.isdecimal() else float(value)
    return [name, *options], read(name, **given)


# Measuring.


class _Steps(logging.Handler):
    """Takes the CPU time of each step's begin, and what is said to be left then."""

    def __init__(self) -> None:
        super().__init__()
        self.begun: list[tuple[float, float, str]] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Take a step."""
        assert isinstance(record.args, tuple)
        spent, percent, what = record.args
        assert isinstance(spent, float)
        assert isinstance(percent, float)
        left = spent * (100.0 / max(percent, 1e-7) - 1.0)
        self.begun.append((time.process_time(), left, str(what)))


def watched(words: list[str], file: Path) -> None:
    """Run a command in this process, and write what its stages took to a file.

    The time left is told by the CPU time, so that other load does not count.
    """
    time.perf_counter = time.process_time
    from ccfem.cli import run
    from ccfem.cli.main import main as command

    run._STARTED = 0.0  # imports for the measurement are those of any run
    steps, logger = _Steps(), logging.getLogger("ccfem")
    logger.setLevel(logging.INFO)
    logger.addHandler(steps)
    quick = pace()
    sys.argv = ["ccfem", *words]
    try:
        command()
    except SystemExit as end:
        if end.code not in (0, 3):
            raise
    seconds: dict[str, float] = {}
    # The measurement itself, and imports for it, take a tenth of a second.
    begun = [(0.0, 0.0, ""), *steps.begun, (time.process_time(), 0.0, "")]
    for (start, _, what), (stop, *_) in itertools.pairwise(begun):
        stage = next((name for first, name in _STAGES.items() if what.startswith(first)), "start")
        stage = f"plan {what.split()[1]}" if stage == "plan" else stage
        seconds[stage] = seconds.get(stage, 0.0) + stop - start
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    taken = {"seconds": seconds, "memory": used, "pace": quick, "steps": begun}
    file.write_text(json.dumps(taken))


def watch(words: list[str], folder: Path) -> dict[str, Any]:
    """Run a command in a process of its own, on one processor, and return what `watched` writes."""
    taken = folder / "taken.json"
    line = [str(taken), *words, "--out", str(folder / "out")]
    child = [sys.executable, "-m", "benchmarks.speed.effort", "--watched", *line]
    environment = {**os.environ, "CCFEM_THREADS": "1"}
    done = subprocess.run(child, capture_output=True, text=True, env=environment, check=False)
    if not taken.exists():
        raise SystemExit(done.stderr)
    result: dict[str, Any] = json.loads(taken.read_text())
    return result


def measure(said: str, command: str) -> dict[str, str]:
    """Line of a part and a command."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        words, case = part(said, folder)
        verb, *options = COMMANDS[command]
        result = watch([verb, *words, *options], folder)
        (known,) = counts(case, case.known_layers())
    row = {"part": said, "command": command, "cells": f"{known.cells:.0f}"}
    row |= {name: f"{value:.6g}" for name, value in vars(known).items() if name not in row}
    del row["run"]
    row |= {"GB": f"{result['memory']:.3f}", "pace": f"{result['pace']:.4f}"}
    spent = result["seconds"].items()
    row["seconds"] = " ".join(f"{stage.replace(' ', ':')}={taken:.2f}" for stage, taken in spent)
    return row


def measure_missing(parts: tuple[str, ...]) -> None:
    """Measure parts that were not yet, and add their lines."""
    known = {(row["part"], row["command"]) for row in lines()}
    wanted = [(said, command) for said in parts for command in ("compare", "plan")]
    wanted += [(said, "untested") for said in LARGE]
    for said, command in wanted:
        if (said, command) in known:
            continue
        row = measure(said, command)
        with MEASURED.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, row, lineterminator="\n")
            if not file.tell():
                writer.writeheader()
            writer.writerow(row)
        print(*row.values(), flush=True)


def lines() -> list[dict[str, str]]:
    """All that was measured."""
    if not MEASURED.exists():
        return []
    with MEASURED.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


# Fitting.


Samples = dict[str, list[tuple[str, Counts, float]]]
"""For each stage the part, its counts, and what was measured."""


def known_of(row: dict[str, str]) -> Counts:
    """Read the counts in a line."""
    return Counts(**{one.name: float(row[one.name]) for one in fields(Counts) if one.name in row})


@cache
def usual_pace() -> float:
    """Pace of the machine that all lines are put to: the median of those that they ran at."""
    return float(np.median([float(row["pace"]) for row in lines()]))


def seconds_of(row: dict[str, str]) -> dict[str, float]:
    """Read the CPU seconds of each stage in a line, at the usual pace: other load slows all."""
    pairs = (word.split("=") for word in row["seconds"].split())
    faster = usual_pace() / float(row["pace"])
    return {stage.replace(":", " "): faster * float(taken) for stage, taken in pairs}


def samples_of(rows: list[dict[str, str]]) -> Samples:
    """Sort what was measured by stage."""
    samples: Samples = {stage: [] for stage in TERMS}
    judged: dict[str, float] = {}
    for row in rows:
        said, known, taken = row["part"], known_of(row), seconds_of(row)
        samples[f"memory of {row['command']}"].append((said, known, float(row["GB"])))
        if row["command"] == "compare":
            taken["plan"] = taken.pop("plan isocurve")
            taken["plan stream_function to a length"] = taken.pop("plan stream_function")
            judged[said] = taken["judge"] = taken["judge"] / len(STRATEGIES)
            taken["plan zigzag"] = 0.5 * (taken["plan zigzag"] + taken.pop("plan contour_zigzag"))
        elif row["command"] == "untested":
            taken["judge untested"] = taken.pop("judge")
            taken["plan"], taken["write a print"] = taken.pop("plan isocurve"), taken.pop("write")
        else:
            taken["print"] = max(taken.pop("judge") - judged[said], 0.05)
            taken["write a print"] = taken.pop("write")
        for stage, spent in taken.items():
            samples[stage].append((said, known, spent))
    return samples


def fitted(samples: Samples, without: str = "") -> Coefficients:
    """Fit coefficients, none negative, to all parts but one, so that factors off are small."""
    found = {}
    for stage, terms in TERMS.items():
        some = [(known, value) for said, known, value in samples[stage] if said != without]
        table = np.array([[getattr(known, term) for term in terms] for known, _ in some])
        values, size = np.array([value for _, value in some]), table.max(axis=0)
        told = values
        for _ in range(_ROUNDS):
            # (told - value)^2 / (told value) is the square of the logarithm of a small factor.
            weight = 1.0 / np.sqrt(np.maximum(told, _LEAST * values) * values)
            found[stage] = nnls(table / size * weight[:, None], values * weight)[0] / size
            told = table @ found[stage]
    return {stage: _rounded(values) for stage, values in found.items()}


_ROUNDS = 10
_LEAST = 0.1
"""Share of a value that counts at least as told, in the weights."""


def _rounded(values: FloatArray) -> list[float]:
    return [float(f"{value:.3g}") for value in values]


def show(rows: list[dict[str, str]], samples: Samples) -> dict[str, list[float]]:
    """Print what the fits to the other parts tell of each.

    Returns
    -------
    dict of command to list of float
        Runs that were told within a factor of 1.5, all runs, and the factor that all are within.
    """
    print(f"{'':28} {'':8} {'s':>7} {'told':>7} {'ratio':>6} {'GB':>6} {'told':>6} {'ratio':>6}")
    ratios: dict[str, list[float]] = {command: [] for command in COMMANDS}
    for row in rows:
        known, others = known_of(row), fitted(samples, row["part"])
        planned = PLANNED[row["command"]]
        steps = stages(planned, row["command"] != "compare", row["command"] != "untested")
        told = sum(stage_effort(stage, known, others) for stage in steps)
        memory = stage_effort(f"memory of {row['command']}", known, others)
        taken, used = sum(seconds_of(row).values()), float(row["GB"])
        ratios[row["command"]].append(told / taken)
        print(
            f"{row['part']:28} {row['command']:8} {taken:7.1f} {told:7.1f} {told / taken:6.2f} "
            f"{used:6.2f} {memory:6.2f} {memory / used:6.2f}"
        )
    within = {}
    for command, some in ratios.items():
        off = np.exp(np.abs(np.log(some)))
        within[command] = [int((off <= 1.5).sum()), len(off), float(f"{off.max():.2f}")]
        near, of, most = within[command]
        print(f"{command}: {near} of {of} within a factor of 1.5, all within {most:g}")
    return within


def expected(row: dict[str, str], coefficients: Coefficients) -> dict[str, float]:
    """Seconds that are expected of each stage in a line."""
    command, known = row["command"], known_of(row)
    prints, tested = command != "compare", command != "untested"
    planned = PLANNED[command]
    of = {"write": ["write a print" if prints else "write"]}
    of |= {f"plan {name}": [planning_stage(name, prints)] for name in planned}
    of |= {"judge": judging_stages(prints, tested) * len(planned)}
    return {
        stage: sum(stage_effort(one, known, coefficients) for one in of.get(stage, [stage]))
        for stage in seconds_of(row)
    }


def replay(row: dict[str, str], coefficients: Coefficients) -> Iterator[tuple[str, float, float]]:
    """Yield each later stage in a line, the seconds left that are told as it begins, and the true.

    At the pace that it was measured at, from the first tenth on, while some seconds are left.
    """
    slower = float(row["pace"]) / usual_pace()
    taken = {stage: slower * spent for stage, spent in seconds_of(row).items()}
    whole = sum(taken.values())
    with patch("time.perf_counter") as clock:
        clock.return_value = now = 0.0
        schedule = Schedule(silent, steps=expected(row, coefficients), passed={START: 0.0})
        for stage, spent in taken.items():
            clock.return_value = now
            schedule(stage)
            if now >= 0.1 * whole and whole - now > WORTH:
                yield stage, schedule.left(), whole - now
            now += spent


WORTH = 2.0
"""Seconds left from which it counts how true they are told."""


def show_left(rows: list[dict[str, str]], samples: Samples) -> None:
    """Print where the fits to the other parts tell times left that are off by more than 1.5."""
    off = []
    for row in rows:
        for stage, left, true in replay(row, fitted(samples, row["part"])):
            off.append(np.exp(np.abs(np.log(left / true))))
            if off[-1] > 1.5:
                print(f"{row['part']} {row['command']}, {stage}: {left:.1f} of {true:.1f} s left")
    within = sum(factor <= 1.5 for factor in off)
    print(f"time left: {within} of {len(off)} within a factor of 1.5, all within {max(off):.2f}")


def main() -> None:
    """Measure what is missing, if wanted, and print the fit."""
    if sys.argv[1:2] == ["--watched"]:
        watched(sys.argv[3:], Path(sys.argv[2]))
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--measure", nargs="*", metavar="PART")
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    if asked.measure is not None:
        measure_missing(tuple(asked.measure) or PARTS)
    rows = lines()
    samples = samples_of(rows)
    within = show(rows, samples)
    show_left(rows, samples)
    if asked.write:
        text = [f'"{stage}" = {values}' for stage, values in fitted(samples).items()]
        text += [f"pace = {usual_pace():.4f}", "[within]"]
        text += [f"{command} = {values}" for command, values in within.items()]
        text += ["[most]"]
        for command in within:
            known = [known_of(row) for row in rows if row["command"] == command]
            text += [f"{command} = {[max(getattr(one, name) for one in known) for name in MOST]}"]
        head = "# Written by python -m benchmarks.speed.effort --write"
        COEFFICIENTS.write_text("\n".join([head, *text, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
