"""Put the table that ``ccfem compare loop`` prints into the README, and draw its pictures.

Run ``python benchmarks/readme.py`` whenever a default changes.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from ccfem.cases import create_case
from ccfem.comparison.plot.paths import layer_picture
from ccfem.fem.elasticity import solve
from ccfem.paths.planning import plan
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

ROOT = Path(__file__).resolve().parents[1]
PLACE = re.compile(
    r"(<!-- printed by: python benchmarks/readme.py -->\n```text\n).*?(```\n<!-- end -->)", re.S
)


def draw_bridge() -> None:
    """Draw the one path of `svt` on the optimised bridge: docs/bridge.png."""
    case = create_case("bridge")
    stress = solve(case.problem)["down"]
    layers = Planar(count=1).cut(case.problem.mesh, case.build)
    paths = plan(create("svt"), layers, stress, case.machine)
    layer = layers[0]
    figure = layer_picture(layer, stress_on(layer, stress), paths, case.machine.fibre_width)
    figure.savefig(ROOT / "docs" / "bridge.png", dpi=220)


def main() -> None:
    """Run the comparison and write README.md, docs/loop.png and docs/bridge.png."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "ccfem", "compare", "loop", "--pictures", "--out", folder]
        environment = {**os.environ, "COLUMNS": "100"}
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
        )
        lines = [line.rstrip() for line in done.stdout.splitlines()]
        shown = [line for line in lines[:-1] if line]  # the last one names the temporary folder
        shutil.copy(Path(folder) / "overview.png", ROOT / "docs" / "loop.png")
    readme = ROOT / "README.md"
    text = "\n".join(shown) + "\n"
    page, count = PLACE.subn(lambda found: found[1] + text + found[2], readme.read_text())
    if count != 1:
        raise SystemExit("README.md has no place for the table: put its two comments back")
    readme.write_text(page)
    draw_bridge()


if __name__ == "__main__":
    main()
