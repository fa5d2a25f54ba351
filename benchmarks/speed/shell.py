"""Time of a comparison on the Shell of Chen et al. 2021, on quadratic cells, phase by phase.

    CCFEM_CHEN2021=folder python -m benchmarks.speed.shell [STRATEGY ...]

The authors' mesh of 112 k cells becomes one of 552,588 unknowns by ``order = "auto"``. The rows are
the clock and the processor time, s, of what is done once and of the phases of each strategy; work
beside the phases counts in the last row alone. Then come the stiffness ratios, and the updates and
iterations of their tests in tension, with some compression and bonded.
"""

import os
import sys
import tempfile
import time
from collections.abc import Mapping
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
    # Phases count both the clock and the processor, which work beside them matters less to.
    vars(stages)["time"] = SimpleNamespace(perf_counter=_both)
    begin = _both()
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "shell.toml"
        part.write_text(PART.format(mesh=authors_folder() / "Shell" / "Shell.tet"))
        compared = ccfem.compare(part, strategies) if strategies else ccfem.compare(part)
    whole = _both() - begin
    print(f"{'':44} clock, s   CPU, s")
    _print_phases("once", compared.seconds)
    for run in compared.runs:
        _print_phases(run.name, run.seconds)
    _print_phases("in all", {"": whole})
    for run in compared.runs:
        if run.tested is None:
            print(f"{run.name}: {run.failure or run.untested}")
            continue
        both = run.tested.bracket
        tests = (both.tension, both.partial, both.bonded)
        ratios = " ".join(f"{test.ratio:.6f}" for test in tests)
        steps = " ".join(f"{t.updates}/{t.solution.record.iterations}" for t in tests)
        print(f"{run.name:16} {1e-3 * run.length:7.2f} m  ratios {ratios}  iterations {steps}")


def _both() -> complex:
    """Seconds of the clock, and of the processor as the imaginary part, ended children included."""
    return complex(time.perf_counter(), sum(os.times()[:4]))


def _print_phases(name: str, phases: Mapping[str, complex]) -> None:
    for phase, spent in phases.items():
        print(f"{name:16} {phase:28} {spent.real:7.1f}  {spent.imag:7.1f}")


if __name__ == "__main__":
    main(sys.argv[1:])
