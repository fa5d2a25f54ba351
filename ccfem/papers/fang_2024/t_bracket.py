"""Field, layers and strands on the T-bracket beside the published ones.

    python -m ccfem.papers.fang_2024.t_bracket

with ``CCFEM_FANG2024`` naming the data. Prints tables in Markdown; a quarter of an hour, most of
it the finite elements.
"""

import os
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ccfem.fem.elasticity import GivenStress, PartStress
from ccfem.machine import Machine
from ccfem.papers.contents import table
from ccfem.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands,
    authors_stress,
)
from ccfem.papers.fang_2024.measures import measured
from ccfem.paths.planning import PartStrategy, Strategy, plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.layer_matrix import layer_matrix
from ccfem.slicing.guidance.joints import joint_lines, joints_of
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.slicing.slicers.spatial import Spatial, SpatialSlicing
from ccfem.strategies import create

BUILD = (0.0, 1.0, 0.0)

PAPER_SECONDS = {
    "stress lines": 7.68,
    "field": 1.26,
    "level surfaces": 1.78,
    "a layer": 11.46,
    "all": 187.54,
}
"""Table 1 of the paper, 85,119 cells and 45 layers, matrix paths included: i7-12700H, C++.

A layer: .34 + 3.44 + 6.46 + 1.22 (stress on it, its segmentation, field, paths).
"""

VARIANTS: dict[str, dict[str, Any]] = {
    "winding": {},
    "winding, even": {"even": True},
    "winding, no cut": {"cut": False},
    "winding, stress as weight": {"weight": "stress"},
    "winding, all alike": {"weight": "even"},
    "winding, stress term small": {"isotropy": 10.0},
    "winding, the paper's energy": {"energy": "paper"},
}


def _timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return a result, seconds on the clock and those of all processors."""
    start, busy = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - start, time.process_time() - busy


class Chain(NamedTuple):
    """What the chain gives, and its seconds by stage, on the clock and of all processors."""

    sliced: SpatialSlicing
    strands: Toolpaths
    matrix: Toolpaths
    seconds: dict[str, float]


def timed_chain(stress: PartStress) -> Chain:
    """Slice, lay fibre and fill with matrix again once all is compiled, and print the times."""
    strategy, machine = create("winding"), Machine()
    first = Spatial().slice(stress, BUILD)
    plan(strategy, first.layers[18:22], stress, machine)
    layer_matrix(first.layers[18:20], machine)
    load = os.getloadavg()[0]
    # What was traced for the first run is traced again.
    fresh = _fresh(stress)
    joints = joints_of(fresh)
    _, *lines = _timed(lambda: joint_lines(fresh, joints, "joining"))
    sliced, *field = _timed(lambda: Spatial().slice(fresh, BUILD))
    paths, *strands = _timed(lambda: plan(strategy, sliced.layers, fresh, machine))
    matrix, *fill = _timed(lambda: layer_matrix(sliced.layers, machine))
    seconds: dict[str, float] = {}
    stages = {
        "stress lines": lines,
        "field and layers": field,
        "strands": strands,
        "matrix paths": fill,
    }
    for name, (clock, busy) in stages.items():
        seconds |= {f"{name}, clock": clock, f"{name}, processors": busy}
    for kind in ("clock", "processors"):
        seconds[f"all, {kind}"] = sum(seconds[f"{name}, {kind}"] for name in stages)
    single = _single_layers(fresh, set(paths.layer.tolist()), strategy, machine)
    seconds |= {
        "slowest layer, processors": max(single),
        "median layer, processors": float(np.median(single)),
        "layers": float(len(sliced.layers)),
        "load of the machine before": load,
    }
    print(_times(seconds, len(stress.mesh.cells)), flush=True)
    return Chain(sliced, paths, matrix, seconds)


def _fresh(stress: PartStress) -> GivenStress:
    """Return the same stress, of which nothing is traced yet."""
    names = (stress.held_or_loaded, stress.loaded)
    return GivenStress(stress.mesh, stress.stress, stress.nodal, *names)


def _single_layers(
    stress: PartStress, with_fibre: set[int], strategy: Strategy, machine: Machine
) -> list[float]:
    """Seconds of processor of each layer with fibre, strands and matrix, planned alone."""
    layers = Spatial().slice(stress, BUILD).layers
    assert isinstance(strategy, PartStrategy)
    planner = strategy.for_part(stress, layers, machine)
    seconds: list[float] = []
    for layer in (one for one in layers if one.index in with_fibre):

        def work(one: Layer = layer) -> None:
            planner(one, stress_on(one, stress), machine)
            layer_matrix([one], machine)

        seconds.append(_timed(work)[2])
    return seconds


def _times(seconds: dict[str, float], cells: int) -> str:
    """Markdown table of the stages beside table 1 of the paper."""
    paper = PAPER_SECONDS
    theirs = {
        "stress lines": paper["stress lines"],
        "field and layers": paper["field"] + paper["level surfaces"],
        "all": paper["all"],
    }
    head = f"{cells} cells, {seconds['layers']:.0f} layers"
    lines = [f"\n{head}; seconds of the paper on 85,119 cells, 45 layers\n"]
    rows = []
    for name in ("stress lines", "field and layers", "strands", "matrix paths", "all"):
        published = f"{theirs[name]:.2f}" if name in theirs else ""
        clock, busy = seconds[f"{name}, clock"], seconds[f"{name}, processors"]
        rows.append((name, f"{clock:.2f}", f"{busy:.2f}", published))
    slowest = f"slowest layer (median {seconds['median layer, processors']:.2f})"
    busiest = f"{seconds['slowest layer, processors']:.2f}"
    rows.append((slowest, "", busiest, f"{paper['a layer']:.2f}"))
    lines.append(table(("seconds", "ours, clock", "processors", "paper"), rows))
    lines.append(f"load of the machine before: {seconds['load of the machine before']:.1f}")
    return "\n".join(lines)


def study(stress: PartStress, sliced: SpatialSlicing) -> dict[str, dict[str, float]]:
    """Print the tables of field and strands; the strands' figures by name."""
    machine = Machine()
    quality = [(name, f"{value:.3f}") for name, value in vars(sliced.quality).items()]
    print(f"\n{table(('field', 'ours'), quality)}", end="")
    weight = sliced.region.weight
    strands: dict[str, dict[str, float]] = {}
    for name, given in VARIANTS.items():
        paths = plan(create("winding", given), sliced.layers, stress, machine)
        strands[name] = measured(paths, sliced.layers, stress, weight)
    theirs = authors_layers(stress)
    strands["authors"] = measured(authors_strands(theirs), theirs, stress, weight)
    paths = plan(create("winding"), theirs, stress, machine)
    strands["winding on the authors' layers"] = measured(paths, theirs, stress, weight)
    rows = [(k, *(f"{v:.3g}" for v in row.values())) for k, row in strands.items()]
    print(f"\n{table(('strands', *strands['authors']), rows)}", end="")
    return strands


if __name__ == "__main__":
    solved = authors_stress(authors_mesh())
    study(solved, timed_chain(solved).sliced)
