"""Print a small bar with every value of a machine over twelve decades: it ends well or in one line.

Run ``python -m benchmarks.fuzz.machine_values [COUNT]``: by default all of about 800 machines. Each
differs from the default one in one number, which is 1e-6, 1e-5 ... 1e5 (negative and 0 as well).
The fibre is planned, the print too, and the G-code is written.
"""

import os
import random
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.fuzz.__main__ import verdict
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine, machine_from
from ccfem.machine.ranges import RANGES
from ccfem.printing.export.gcode import gcode
from ccfem.slicing.slicers.planar import Planar

__all__ = ["print_bar", "tables"]

VALUES = (-1.0, 0.0, *(10.0**k for k in range(-6, 6)))
KEYS = {
    "machine": (),
    "speed_table": ("speeds",),
    "gcode_profile": ("gcode",),
    "process": ("process",),
    "kinematics": ("kinematics",),
    "limits": ("limits",),
    "spools": ("spools",),
    "costs": ("costs",),
}
"""Where a part file has each table."""
LENGTHS = {"speed": 3, "curvature": 2, "length": 2, "angle": 2, "offset": 3, "bed": 3, "centre": 3}
LENGTHS |= {"park": 2}
"""Of values that are several numbers."""


def tables() -> Iterator[tuple[str, dict[str, Any]]]:
    """Every machine that is tried, as a table of a part file, by a name."""
    for kind, ranges in RANGES.items():
        for name in ranges:
            for value in VALUES:
                number: Any = int(value) if name.endswith("_loops") else value
                count = LENGTHS.get(name, 0) if kind != "machine" else 0
                table: dict[str, Any] = {name: [number] * count if count else number}
                for key in KEYS[kind]:
                    table = {key: table}
                yield f"{kind}.{name} = {value:g}", table


def print_bar(table: dict[str, Any], size: tuple[float, float, float] = (60.0, 8.0, 4.0)) -> str:
    """Plan and print a bar that is pulled; the G-code."""
    machine: Machine = machine_from(table)
    mesh = box_mesh(size, (6, 2, 2))
    loads = {"pull": (Force("x_max", (100.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads)
    case = Case("bar", "Bar", problem, slicing=Planar(count=2), machine=machine)
    found = compare(case, ["zigzag"], natural=True, strand=None, print_plans=True)
    (run,) = found.runs
    if run.print_plan is None:
        raise InputError(run.unprinted or run.failure)
    return gcode(run.print_plan, machine)


def _print(table: dict[str, Any], _: Path) -> None:
    print_bar(table)


def main(count: int = 0) -> int:
    """Try `count` machines, or all; return how many are not met as they should be."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    print_bar({})  # whatever is compiled is there before a clock runs
    known = list(tables())
    chosen = random.Random("1").sample(known, count) if count else known
    tally: Counter[str] = Counter()
    longest, slowest = 0.0, ""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, table in chosen:
            before = time.perf_counter()
            found = verdict(Path(folder), partial(_print, table))
            seconds = time.perf_counter() - before
            if seconds > longest:
                longest, slowest = seconds, name
            tally[found if found in ("read", "refused") else "WRONG"] += 1
            if found not in ("read", "refused"):
                print(f"{name}: {found}", flush=True)
    print(dict(tally), f"longest {longest:.1f} s: {slowest}")
    return tally["WRONG"]


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:2]))))
