"""CPU time of a comparison on the Shell of Chen et al. 2021, on quadratic cells, phase by phase.

    CCFEM_CHEN2021=folder python -m benchmarks.speed.shell [STRATEGY ...]

The authors' mesh of 112 k cells becomes one of 552,588 unknowns by ``order = "auto"``. The rows are
CPU seconds of each phase, of all strategies together, then clock; the last ones are the stiffness
ratios, and the updates and iterations of their tests in tension, with some compression and bonded.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import ccfem
from ccfem.comparison import stages
from ccfem.papers.chen_2021.loop import authors_folder

PART = """
mesh = "{mesh}"
build = "y"
layers = 12
[material]
name = "PLA"
modulus = 3500.0
poisson = 0.35
[patches.support]
rule = "cylinder"
point = [-39.893, 5.0, -50.0]
axis = "y"
radius = 6.0
tolerance = 0.1
half = "-z"
[patches.load]
rule = "cylinder"
point = [-39.893, 5.0, 50.0]
axis = "y"
radius = 6.0
tolerance = 0.1
half = "z"
[[supports]]
patch = "support"
[[loads.pull]]
kind = "force"
patch = "load"
vector = [0, 0, 1000]
"""


def main(strategies: list[str]) -> None:
    """Compare, and print the table."""
    # Phases count the processor, not the clock, so that work beside them matters less.
    vars(stages)["time"] = SimpleNamespace(perf_counter=time.process_time)
    begin, before = time.perf_counter(), os.times()
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "shell.toml"
        part.write_text(PART.format(mesh=authors_folder() / "Shell" / "Shell.tet"))
        compared = ccfem.compare(part, strategies) if strategies else ccfem.compare(part)
    clock, after = time.perf_counter() - begin, os.times()
    phases = Counter(compared.seconds)
    for run in compared.runs:
        phases.update(run.seconds)
    for phase, seconds in phases.items():
        print(f"{phase:28} {seconds:7.1f}")
    cpu = sum(after[:4]) - sum(before[:4])
    print(f"{'CPU s in all':28} {cpu:7.1f}\n{'clock, s':28} {clock:7.1f}")
    for run in compared.runs:
        if run.tested is None:
            print(f"{run.name}: {run.failure or run.untested}")
            continue
        both = run.tested.bracket
        tests = (both.tension, both.partial, both.bonded)
        ratios = " ".join(f"{test.ratio:.6f}" for test in tests)
        steps = " ".join(f"{t.updates}/{t.solution.record.iterations}" for t in tests)
        print(f"{run.name:16} {1e-3 * run.length:7.2f} m  ratios {ratios}  iterations {steps}")


if __name__ == "__main__":
    main(sys.argv[1:])
