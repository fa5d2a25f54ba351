"""Time of the whole line, mesh to fibre paths, stage by stage, and its peak memory.

    python -m benchmarks.speed.line [--cold]

On the case `loop` at two element sizes (about 30 k and 112 k tetrahedra) and, where the environment
variable CCFEM_CHEN2021 names the authors' folder, on their own Loop, beside the 130.9 s that paper
000 (Table 1) states for the planning without the finite element solve. ``--cold`` instead times new
processes that run the line once. Each warm figure is the best of three runs.
"""

import argparse
import itertools
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable

PAPER_SECONDS = 130.862
"""Planning of Loop in Chen et al. 2021, Table 1, finite elements not included."""

_COLD = "from benchmarks.speed.line import {part}, timed; timed({part})"


def stored_loop() -> object:
    """Case `loop` as stored."""
    from ccfem.cases import create_case

    return create_case("loop")


def fine_loop() -> object:
    """Case `loop` meshed to about 112 k tetrahedra."""
    from ccfem.cases import create_case

    return create_case("loop", element_size=1.56)


def authors_loop() -> object:
    """Loop of Chen et al. 2021, on their mesh."""
    from ccfem.papers.chen_2021.loop import authors_loop

    return authors_loop()


def timed(load: Callable[[], object]) -> dict[str, float]:
    """Seconds of each stage of one run, and of the whole."""
    from ccfem.cases.case import Case
    from ccfem.fem.elasticity import solve
    from ccfem.paths.planning import plan
    from ccfem.slicing.slicers.planar import Planar
    from ccfem.strategies.isocurve import Isocurve

    marks = [time.perf_counter()]

    def stage() -> None:
        marks.append(time.perf_counter())

    case = load()
    assert isinstance(case, Case)
    stage()
    field = next(iter(solve(case.problem).values()))
    stage()
    layers = Planar(count=12).cut(field.mesh, case.build)
    stage()
    plan(Isocurve(), layers, field, case.machine)
    stage()
    seconds = [b - a for a, b in itertools.pairwise(marks)]
    result = dict(zip(("mesh", "solve", "slice", "plan"), seconds, strict=True))
    result["cells"], result["total"] = float(len(field.mesh.cells)), sum(seconds)
    return result


def warm(name: str, load: Callable[[], object]) -> None:
    """Print the best of three warm runs."""
    timed(load)
    best = min((timed(load) for _ in range(3)), key=lambda run: run["total"])
    stages = "  ".join(f"{stage} {best[stage]:.2f}" for stage in ("mesh", "solve", "slice", "plan"))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(
        f"{name:14} {best['cells']:8.0f} cells  {stages}  total {best['total']:.2f} s  "
        f"peak memory {peak:.0f} MiB",
        flush=True,
    )
    if load is authors_loop:
        print(f"{'':14} {PAPER_SECONDS / best['total']:.0f} times as fast as the paper")


def cold(name: str, load: Callable[[], object]) -> None:
    """Print the best of three new processes, interpreter and imports included."""
    times = []
    for _ in range(3):
        started = time.perf_counter()
        command = [sys.executable, "-c", _COLD.format(part=load.__name__)]
        subprocess.run(command, check=True)
        times.append(time.perf_counter() - started)
    print(f"{name:14} cold process {min(times):.2f} s", flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--cold", action="store_true", help="time new processes")
    run = cold if parser.parse_args().cold else warm
    parts: dict[str, Callable[[], object]] = {"loop": stored_loop, "loop, fine": fine_loop}
    if "CCFEM_CHEN2021" in os.environ:
        parts["authors' Loop"] = authors_loop
    for name, load in parts.items():
        run(name, load)


if __name__ == "__main__":
    main()
