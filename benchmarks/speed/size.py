"""Time and memory of a print, from part file to G-code, over the number of its layers.

    python -m benchmarks.speed.size [LAYERS ...] [--size 400x300] [--cells 1.5e6] [--strategy NAME]

Each row is a process of its own that runs ``ccfem plan --gcode`` on a plate with three holes whose
layers are 0.25 mm apart, in about so many linear cells: clock, processor time and peak memory of
its largest process, and what it wrote. Without a number of cells their edges are a 27th of
the shorter side. The last lines are the exponents over the layers, by least squares of the
logarithms, and what each further layer costs.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

_PITCH = 0.25
_PLATE = """
material = "pla"
[planform]
outline = [[0, 0], [{x}, 0], [{x}, {y}], [0, {y}]]
height = {height}
edge_length = {edge}
holes = [
  {{ centre = [{a}, {a}], radius = {r} }},
  {{ centre = [{b}, {c}], radius = {r} }},
  {{ centre = [{m}, {n}], radius = {d} }},
]
[patches.left]
rule = "plane"
normal = "x"
offset = "min"
[patches.right]
rule = "plane"
normal = "x"
offset = "max"
[[supports]]
patch = "left"
[[loads.pull]]
kind = "force"
patch = "right"
vector = [2000, 500, 0]
[fibre]
covered = true
[machine.gcode]
bed = [600, 600, 600]
"""


_CELLS = 12.0 / 3.0**0.5
"""Cells times the cube of their edge length, over the volume: a regular prism is three of them."""


def edge_length(x: float, y: float, layers: int, cells: float) -> float:
    """Edge length, mm, of so many cells in a plate with so many layers."""
    return float((_CELLS * x * y * layers * _PITCH / cells) ** (1.0 / 3.0))


def plate(x: float, y: float, layers: int, edge: float | None = None) -> str:
    """Part file of a plate with so many layers, in cells of an edge length, mm."""
    small = min(x, y)
    near, edge = 0.2 * small, edge or 0.037 * small
    return _PLATE.format(
        x=x, y=y, height=layers * _PITCH, edge=edge, a=near, b=x - near, c=y - near,
        r=0.05 * small, m=0.5 * x, n=0.5 * y, d=0.13 * small,
    )  # fmt: skip


def measured(part: Path, layers: int, strategy: str, out: Path) -> dict[str, float]:
    """Run a plan in a process, and measure it."""
    command = [sys.executable, "-m", "ccfem", "plan", str(part), "--strategy", strategy, "--gcode",
               "--layers", str(layers), "--no-virtual-test", "--out", str(out)]  # fmt: skip
    begin = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert child.stderr is not None
    said = child.stderr.read()
    _, status, used = os.wait4(child.pid, 0)
    clock = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        raise SystemExit(said)
    # Of processes of its own, the largest one counts, as for `getrusage`.
    return {
        "layers": layers,
        "clock, s": clock,
        "processor, s": used.ru_utime + used.ru_stime,
        "memory, GB": used.ru_maxrss / 1e6,
        "written, MB": sum(file.stat().st_size for file in out.rglob("*")) / 1e6,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("layers", type=int, nargs="*", default=[16, 32, 64])
    parser.add_argument("--size", default="400x300", help="of the plate, mm")
    parser.add_argument("--cells", type=float, help="of the mesh, about")
    parser.add_argument("--strategy", default="isocurve")
    asked = parser.parse_args()
    x, y = map(float, asked.size.split("x"))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for layers in asked.layers:
            part = Path(folder) / f"plate_{layers}.toml"
            text = plate(x, y, layers)
            if asked.cells:
                text = "order = 1\n" + plate(x, y, layers, edge_length(x, y, layers, asked.cells))
            part.write_text(text)
            rows.append(measured(part, layers, asked.strategy, Path(folder) / str(layers)))
            if len(rows) == 1:
                print("  ".join(f"{name:>12}" for name in rows[0]))
            print("  ".join(f"{value:12.4g}" for value in rows[-1].values()), flush=True)
    if len(rows) > 1:
        table = np.array([list(row.values()) for row in rows])
        over = np.log(table[:, 0])
        slopes = np.polyfit(over, np.log(table[:, 1:]), 1)[0]
        print("  ".join(["    exponent", *(f"{slope:12.2f}" for slope in slopes)]))
        more = (table[-1, 1:] - table[-2, 1:]) / (table[-1, 0] - table[-2, 0])
        print("  ".join(["     a layer", *(f"{value:12.3g}" for value in more)]))


if __name__ == "__main__":
    main()
