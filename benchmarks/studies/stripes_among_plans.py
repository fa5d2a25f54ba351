"""What `stripes` among their plain plans is worth to `pruned` and `stream_function`.

    python -m benchmarks.studies.stripes_among_plans [star|gear|ring|holes ...]

Flat parts with three layers, held on one side and loaded with 100 N across on the other, at equal
length of fibre: stiffness ratio, fibres in tension only, and processor time, without stripes among
the plans that a design is tested against and with them.
"""

import json
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np

import ccfem
from benchmarks.studies.table import print_table
from ccfem.cases.part_file import read_part
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware import plain_plans

_FULL = np.linspace(0.0, 2.0 * np.pi, 61)[:-1]
_TEETH = np.concatenate(
    [2.0 * np.pi * (k + 1.2 * np.array([-0.2, -0.1, 0.1, 0.2])) / 12 for k in range(12)]
)


def _polar(angle: np.ndarray, radius: np.ndarray | float) -> list[list[float]]:
    return (np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.reshape(radius, (-1, 1))).tolist()


_POINTS = 0.2 * np.pi * np.arange(10)
_GRID = [([15.0 + 30.0 * i, 12.0 + 18.0 * j], 5.0) for i in range(4) for j in range(3)]
PARTS = {
    "star": (
        _polar(_POINTS, np.tile([45.0, 20.0], 5)),
        [([0.0, 0.0], 6.0)],
        (-20.0, 40.0),
        10,
        600,
    ),
    "gear": (
        _polar(_TEETH, np.tile([30.0, 38.0, 38.0, 30.0], 12)),
        [([0.0, 0.0], 8.0)],
        (None, 33.0),
        8,
        700,
    ),
    "ring": (_polar(_FULL, 40.0), [([12.0, 0.0], 20.0)], (-35.0, 36.0), 8, 900),
    "holes": ([[0, 0], [120, 0], [120, 60], [0, 60]], _GRID, (1.0, 119.0), 6, 1500),
}
"""Outline, holes, ends of what is held and begin of what is loaded along x, height, mm of fibre."""


def part_of(name: str) -> ccfem.Case:
    """Make a part of `PARTS`; without an end its first hole is held."""
    outline, holes, (end, begin), height, _ = PARTS[name]
    held = (
        f"lower = [-99, -99, -1]\nupper = [{end}, 99, 20]"
        if end is not None
        else ("lower = [-9, -9, -1]\nupper = [9, 9, 20]")
    )
    bored = ", ".join(f"{{centre = {json.dumps(at)}, radius = {radius}}}" for at, radius in holes)
    text = f"""
material = "pla"
[planform]
outline = {json.dumps(outline)}
height = {height}
edge_length = 5
holes = [{bored}]
[patches.held]
rule = "box"
{held}
[patches.loaded]
rule = "box"
lower = [{begin}, -99, -1]
upper = [199, 99, 20]
[[supports]]
patch = "held"
[[loads.across]]
kind = "force"
patch = "loaded"
vector = [0, -100, 0]
"""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        return read_part(file)


def row(name: str, strategy: str, stripes: bool) -> tuple[float, float]:
    """Stiffness ratio of a plan, and processor time, s, of the comparison that makes it."""

    def without(one: object, *about: object) -> Toolpaths:
        is_stripes = type(one).__name__ == "Stripes"
        return Toolpaths.empty() if is_stripes else plan(one, *about)  # type: ignore[arg-type]

    start, length = time.process_time(), float(PARTS[name][-1])
    with patch.object(plain_plans, "plan", plan if stripes else without):
        (run,) = ccfem.compare(
            part_of(name), [strategy], layers=3, fibre_per_layer=length, curve=False
        ).runs
    assert run.tested is not None
    return run.tested.bracket.tension.ratio, time.process_time() - start


def rows(name: str, _: object) -> list[str]:
    """Rows of the table for one part."""
    lines = []
    for strategy in ("pruned", "stream_function"):
        (bare, before), (ratio, seconds) = (row(name, strategy, given) for given in (False, True))
        lines.append(
            f"| {name} | {PARTS[name][-1]} | {strategy} | {bare:.3f} | {ratio:.3f} | "
            f"{before:.1f} | {seconds:.1f} |"
        )
    return lines


if __name__ == "__main__":
    heads = "part | mm a layer | strategy | without stripes | with them | s without | s with"
    print_table(sys.argv[1:], heads, PARTS, rows)
