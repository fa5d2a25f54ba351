"""Field, layers and strands on the T-bracket beside the published ones.

    python -m ccfem.papers.fang_2024.t_bracket

with ``CCFEM_FANG2024`` naming the data. Prints tables in Markdown; a quarter of an hour, most of
it the finite elements.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ccfem.elasticity.part_stress import GivenStress, PartStress
from ccfem.layers.layer_stress import stress_on
from ccfem.layers.slicing.spatial import Spatial, SpatialSlicing
from ccfem.machine import Machine
from ccfem.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands,
    authors_stress,
)
from ccfem.papers.fang_2024.measures import Strands, measured
from ccfem.planning import plan
from ccfem.strategies import create
from ccfem.toolpaths import Toolpaths

__all__ = ["PAPER_SECONDS", "study", "timed_chain"]

BUILD = (0.0, 1.0, 0.0)

PAPER_SECONDS = {"slicing": 10.72, "a layer": 11.46, "all": 187.54}
"""Table 1 of the paper, 85,119 cells and 45 layers, matrix paths included: i7-12700H, C++.

Stress lines 7.68, field 1.26, level surfaces 1.78; a layer .34 + 3.44 + 6.46 + 1.22.
"""

VARIANTS: dict[str, dict[str, Any]] = {
    "winding": {},
    "winding, no cut": {"cut": False},
    "winding, stress as weight": {"weight": "stress"},
    "winding, all alike": {"weight": "even"},
    "winding, stress term small": {"isotropy": 10.0},
    "winding, the paper's energy": {"energy": "paper"},
}


def _timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return a result, seconds on the clock and those of all processors."""
    start, busy = time.perf_counter(), time.process_time()
    found = work()
    return found, time.perf_counter() - start, time.process_time() - busy


def timed_chain(stress: PartStress) -> tuple[SpatialSlicing, Toolpaths, dict[str, float]]:
    """Slice and plan once more after all is compiled; seconds by stage, clock and processors."""
    strategy, machine = create("winding"), Machine()
    first = Spatial().slice(stress, BUILD)
    plan(strategy, first.layers[18:22], stress, machine)
    # What was traced for the first run is traced again.
    fresh = GivenStress(
        stress.mesh, stress.stress, stress.nodal, stress.held_or_loaded, stress.loaded
    )
    sliced, *slicing = _timed(lambda: Spatial().slice(fresh, BUILD))
    paths, *planning = _timed(lambda: plan(strategy, sliced.layers, fresh, machine))
    single: list[float] = []
    planner = strategy.for_part(fresh, sliced.layers, machine)
    laid = set(paths.layer.tolist())
    for layer in Spatial().slice(fresh, BUILD).layers:
        if layer.index in laid:
            single.append(_timed(lambda one=layer: planner(one, stress_on(one, fresh), machine))[2])
    seconds = {
        "slicing, clock": slicing[0],
        "slicing, processors": slicing[1],
        "strands, clock": planning[0],
        "strands, processors": planning[1],
        "all, clock": slicing[0] + planning[0],
        "all, processors": slicing[1] + planning[1],
        "slowest layer, processors": max(single),
        "median layer, processors": float(np.median(single)),
    }
    print("\n| seconds | ours |\n|---|---|")
    for name, value in seconds.items():
        print(f"| {name} | {value:.2f} |")
    print("paper:", PAPER_SECONDS)
    return sliced, paths, seconds


def study(stress: PartStress, sliced: SpatialSlicing) -> dict[str, Strands]:
    """Print the tables of field and strands; the strands' figures by name."""
    machine = Machine()
    print("\n| field | ours |\n|---|---|")
    for name, value in vars(sliced.quality).items():
        print(f"| {name} | {value:.3f} |")
    weight = sliced.region.weight
    found: dict[str, Strands] = {}
    for name, given in VARIANTS.items():
        paths = plan(create("winding", given), sliced.layers, stress, machine)
        found[name] = measured(paths, sliced.layers, stress, weight)
    theirs = authors_layers(stress)
    found["authors"] = measured(authors_strands(theirs), theirs, stress, weight)
    paths = plan(create("winding"), theirs, stress, machine)
    found["winding on the authors' layers"] = measured(paths, theirs, stress, weight)
    names = list(next(iter(found.values())).table())
    print("\n| strands | " + " | ".join(names) + " |\n" + "|---" * (len(names) + 1) + "|")
    for name, figures in found.items():
        values = " | ".join(f"{value:.3g}" for value in figures.table().values())
        print(f"| {name} | {values} |")
    return found


if __name__ == "__main__":
    solved = authors_stress(authors_mesh())
    study(solved, timed_chain(solved)[0])
