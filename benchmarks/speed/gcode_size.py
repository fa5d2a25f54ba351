"""Bytes of G-code: plain, with arcs, compact, and both; and what each further layer adds.

    python -m benchmarks.speed.gcode_size [PART:LAYERS[:MORE] ...]

Parts are cases, or `plate`, the plate of 400 x 300 mm of `benchmarks.speed.size`, planned by
isocurve. Each cell has the MB of a file, and its share of the plain one. With MORE layers a second
row of the part follows, then what a layer adds, and with that the file of 240 layers. The last
column is the time that the file with both says, over that of the plain one.
"""

import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks.speed.size import plate
from ccfem.cases import Case, create_case
from ccfem.cases.part_file import read_part
from ccfem.fem.elasticity import solve
from ccfem.machine import updated
from ccfem.paths.planning import plan
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

PARTS = ("loop:12", "open_hole:4", "plate:8:16")
LAYERS = 240
FILES: dict[str, dict[str, object]] = {
    "plain": {},
    "arcs": {"arcs": True},
    "compact": {"compact": True},
    "both": {"arcs": True, "compact": True},
    "both, 0.05": {"arcs": True, "compact": True, "arc_tolerance": 0.05},
}


def _case(name: str, layers: int) -> Case:
    """Part with so many layers of fibre."""
    if name != "plate":
        return replace(create_case(name), slicing=Planar(count=layers))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plate.toml"
        file.write_text(plate(400.0, 300.0, layers), encoding="utf-8")
        return replace(read_part(file), slicing=Planar(count=layers))


def sizes(name: str, layers: int) -> dict[str, int]:
    """Print a row of a part: bytes of each kind of file."""
    case = _case(name, layers)
    stress = solve(case.problem)[case.problem.cases[0]]
    cut = case.fibre_layers(stress)
    paths = plan(create("isocurve"), cut, stress, case.machine)
    found: dict[str, int] = {}
    seconds: dict[str, float] = {}
    for kind, values in FILES.items():
        machine = updated(case.machine, {"gcode": values}) if values else case.machine
        text = gcode(plan_print(paths, cut, case.problem.mesh, machine), machine)
        found[kind] = len(text.encode())
        seconds[kind] = float(re.findall(r"^;TIME:([\d.]+)", text, re.M)[0])
    cells = "".join(f"{size / 1e6:7.3f} ({size / found['plain']:.2f})" for size in found.values())
    print(f"{name:10} {layers:6d} {cells} {seconds['both'] / seconds['plain']:6.3f}", flush=True)
    return found


def main(parts: list[str]) -> None:
    """Print the table."""
    print(f"{'part':10} {'layers':>6} {''.join(f'{kind:>14}' for kind in FILES)}   time")
    for part in parts or PARTS:
        name, *counts = part.split(":")
        rows = [sizes(name, int(count)) for count in counts]
        if len(rows) > 1:
            more = int(counts[1]) - int(counts[0])
            each = {kind: (rows[1][kind] - rows[0][kind]) / more for kind in FILES}
            print(f"a layer more, kB: {', '.join(f'{k} {v / 1e3:.0f}' for k, v in each.items())}")
            whole = {k: rows[1][k] + (LAYERS - int(counts[1])) * v for k, v in each.items()}
            said = ", ".join(f"{kind} {size / 1e6:.1f}" for kind, size in whole.items())
            print(f"{LAYERS} layers, MB: {said}")


if __name__ == "__main__":
    main(sys.argv[1:])
