"""Field, layers and strands on the T-bracket beside the published ones.

    python -m benchmarks.papers.fang_2024.t_bracket

with ``CCFEM_FANG2024`` naming the data. Prints tables in Markdown; a quarter of an hour, most of
it the finite elements.
"""

import time
from collections.abc import Callable
from typing import Any

from benchmarks.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands,
    authors_stress,
)
from benchmarks.papers.fang_2024.measures import Strands, measured
from ccfem.elasticity.part_stress import PartStress
from ccfem.layers.slicing.spatial import Spatial
from ccfem.machine import Machine
from ccfem.planning import plan
from ccfem.strategies import create

__all__ = ["study"]

PAPER_SECONDS = {"stress lines": 7.68, "field": 1.26, "layers": 1.78, "all": 187.54}
"""Table 1 of the paper: i7-12700H, C++, matrix paths included; 45 layers."""

VARIANTS: dict[str, dict[str, Any]] = {
    "winding": {},
    "winding, no cut": {"cut": False},
    "winding, stress as weight": {"weight": "stress"},
    "winding, all alike": {"weight": "even"},
    "winding, stress term small": {"isotropy": 10.0},
}


def _timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return a result, seconds on the clock and those of all processors."""
    start, busy = time.perf_counter(), time.process_time()
    found = work()
    return found, time.perf_counter() - start, time.process_time() - busy


def study(stress: PartStress) -> dict[str, Strands]:
    """Print the tables; the strands' figures by name."""
    machine, build = Machine(), (0.0, 1.0, 0.0)
    Spatial().slice(stress, build)
    sliced, clock, busy = _timed(lambda: Spatial().slice(stress, build))
    print(f"\nlayers: {len(sliced.layers)}, {clock:.1f} s on the clock, {busy:.1f} s of processors")
    print("\n| field | ours |\n|---|---|")
    for name, value in vars(sliced.quality).items():
        print(f"| {name} | {value:.3f} |")
    weight = sliced.region.weight
    found: dict[str, Strands] = {}
    create_all = {name: create("winding", given) for name, given in VARIANTS.items()}
    plan(create_all["winding"], sliced.layers[:40], stress, machine)
    for name, strategy in create_all.items():
        paths, clock, busy = _timed(lambda one=strategy: plan(one, sliced.layers, stress, machine))
        found[name] = measured(paths, sliced.layers, stress, weight)
        print(f"{name}: {clock:.1f} s on the clock, {busy:.1f} s of processors")
    theirs = authors_layers(stress)
    found["authors"] = measured(authors_strands(theirs), theirs, stress, weight)
    paths = plan(create_all["winding"], theirs, stress, machine)
    found["winding on the authors' layers"] = measured(paths, theirs, stress, weight)
    names = list(next(iter(found.values())).table())
    print("\n| strands | " + " | ".join(names) + " |\n" + "|---" * (len(names) + 1) + "|")
    for name, figures in found.items():
        values = " | ".join(f"{value:.3g}" for value in figures.table().values())
        print(f"| {name} | {values} |")
    print("\npaper, seconds:", PAPER_SECONDS)
    return found


if __name__ == "__main__":
    study(authors_stress(authors_mesh()))
