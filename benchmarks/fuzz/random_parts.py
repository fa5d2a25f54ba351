"""Plan and print random parts: boxes, notches, holes and lugs, on every machine, solid and sparse.

Run ``python -m benchmarks.fuzz.random_parts [COUNT] [SEED]``. Each part has sides that suit no line
width, or suit it exactly, is turned by a random angle, and is planned by a random strategy. It ends
with G-code whose plastic and fibre fill the part, or in one line; anything else is printed, with
what makes the part again.
"""

import random
import resource
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.fuzz.__main__ import verdict
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Box, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import machine_from, machine_names, machine_table
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import BedLayout
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named as strategies

__all__ = ["print_part", "random_part"]

_LAW = isotropic(3500.0, 0.35, tensile_strength=50.0, interlayer_tensile=18.0)
_SHORT = {"stream_function": {"evaluations": 5, "phases": 1}}
"""Parameters of strategies that take long."""
_SECONDS = 240.0
_FILLED = (0.93, 1.04)
"""Least and largest volume of solid prints over that of the part; narrow walls are left open."""


def random_part(chance: random.Random) -> dict[str, Any]:
    """Choose a part, its plastic, machine and strategy, by name and number."""
    unit = chance.choice([0.1, 0.25, 0.4, 0.5, 0.8, 1.0])
    width, depth = (
        round(unit * chance.randint(round(16 / unit), round(70 / unit)), 6) for _ in "xy"
    )
    return {
        "width": width,
        "depth": depth,
        "height": chance.choice([1.2, 2.0, 3.3, 4.0]),
        "notch": chance.choice([0.0, 0.0, 0.3, 0.55]),
        "hole": chance.choice([0.0, 0.0, 0.12, 0.3]),
        "lug": chance.choice([0.0, 0.0, 0.4]),
        "angle": chance.choice([0.0, 0.0, 30.0, 37.0, 45.0, 90.0]),
        "spin": chance.choice([0.0, 0.0, 37.0]),
        "layers": chance.randint(1, 3),
        "machine": chance.choice(machine_names()),
        "strategy": chance.choice(sorted(strategies())),
        "infill": chance.choice(["solid", "solid", "gyroid", "grid", "lines"]),
        "walls": chance.randint(1, 3),
        "copies": chance.choice([1, 1, 2]),
    }


def print_part(part: dict[str, Any], folder: Path) -> None:
    """Plan, print and test a part, write all results, and look at the volume of the print.

    Raises
    ------
    InputError
        For what the project refuses.
    AssertionError
        For a solid print that is fuller or emptier than `_FILLED`.
    """
    outline = _outline(part)
    mesh = extrude(outline, part["height"], 4.0)
    ends = {"held": (-1.0, 0.2), "pulled": (0.8, 2.0)}
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    rules = {}
    for name, (first, last) in ends.items():
        x = low[0] + np.array([first, last]) * (high[0] - low[0])
        rules[name] = Box((x[0], low[1] - 1.0, low[2] - 1.0), (x[1], high[1] + 1.0, high[2] + 1.0))
    mesh = patches_from_rules(mesh, rules)
    loads = {"pull": (Force("pulled", (100.0, 40.0, 0.0)),)}
    sparse = part["infill"] != "solid"
    plastic = Plastic(part["infill"], 0.2, part["walls"], 2) if sparse else Plastic()
    case = Case(
        "random",
        "Random",
        Problem(mesh, _LAW, (Support("held"),), loads, order=1),
        slicing=Planar(count=part["layers"]),
        machine=machine_from(machine_table(part["machine"])),
        plastic=plastic,
        bed=BedLayout(spin=part["spin"], copies=(part["copies"],)),
    )
    name = part["strategy"]
    done = compare(case, [create(name, _SHORT.get(name, {}))], natural=True, print_plans=True)
    (run,) = done.runs
    if run.failure or run.print_plan is None:
        raise InputError(run.failure or run.unprinted)
    write_results(done, folder, pictures=False)
    share = run.printed_volume
    if not sparse:
        assert _FILLED[0] <= share <= _FILLED[1], f"the print fills {share:.1%} of the part"


def _outline(part: dict[str, Any]) -> shapely.Polygon:
    """Box with a notch, a hole and a lug, turned."""
    width, depth = part["width"], part["depth"]
    outline = shapely.box(0.0, 0.0, width, depth)
    if notch := part["notch"]:
        outline = outline.difference(
            shapely.box(notch * width, notch * depth, (notch + 0.3) * width, depth)
        )
    if lug := part["lug"]:
        outline = outline.union(
            shapely.box(lug * width, -0.3 * depth, (lug + 0.3) * width, depth / 4)
        )
    if hole := part["hole"]:
        disc = shapely.Point(0.25 * width, 0.25 * depth).buffer(hole * min(width, depth))
        outline = outline.difference(disc)
    parts = shapely.get_parts(outline)
    largest = parts[int(np.argmax(shapely.area(parts)))]
    return shapely.affinity.rotate(largest, part["angle"], origin=(0.0, 0.0))


def main(count: int = 100, seed: str = "1") -> int:
    """Try `count` parts; return how many are not met as they should be."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    tally: Counter[str] = Counter()
    for k in range(count):
        part = random_part(random.Random(f"{seed} {k}"))
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as name:
            met = verdict(Path(name), partial(print_part, part), _SECONDS)
        wrong = met not in ("read", "refused")
        tally["WRONG" if wrong else met] += 1
        if wrong:
            print(f"{k}, {time.perf_counter() - start:.0f} s: {met}\n    {part}", flush=True)
    print(dict(tally))
    return tally["WRONG"]


if __name__ == "__main__":
    count, seed, *_ = *sys.argv[1:], *("100", "1")[len(sys.argv) - 1 :]
    sys.exit(bool(main(int(count), seed)))
