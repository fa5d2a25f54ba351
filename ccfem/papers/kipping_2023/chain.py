"""The chain from stress to paths, stage by stage: seconds and what comes out (tables 1 and 2)."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ccfem.cases import create_case
from ccfem.cases.case import Case
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.papers.contents import table
from ccfem.papers.kipping_2023.thickness import Distances, distances_below
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.support import SupportLayers, support_layers
from ccfem.slicing.guidance.height_field import height_field
from ccfem.slicing.guidance.normal_field import normal_field
from ccfem.slicing.guidance.stress_regions import stress_regions
from ccfem.slicing.slicers.load_oriented import LoadOriented, LoadOrientedSlicing
from ccfem.strategies import create

PARTS = {"A": "corner_bracket", "B": "arm_bracket"}
PAPER_SECONDS = {"A": 1380.0, "B": 330.0}
"""Section 4: 23 and 5.5 minutes, i7-1165G7; the single steps of table 2 are lost."""
PAPER_CELLS = {"A": 32_666, "B": 8_514}
PAPER_SHARE = {"A": 0.16, "B": 0.46}


@dataclass(frozen=True)
class Chain:
    """What the chain makes of a part, and the seconds of each stage."""

    case: Case
    stress: StressField
    sliced: LoadOrientedSlicing
    paths: Toolpaths
    support: SupportLayers
    distances: Distances
    seconds: dict[str, float]


def chain(name: str) -> Chain:
    """Run the chain on a case, once for the compiler and once on the clock."""
    case = create_case(name)
    stress = solve(case.problem)["lift"]
    slicer = case.slicing
    assert isinstance(slicer, LoadOriented)
    up = np.array([0.0, 0.0, 1.0])
    seconds: dict[str, float] = {}
    for _ in range(2):
        start = time.perf_counter()
        regions = stress_regions(
            stress.mesh, stress.stress, up, slicer.share, slicer.quantile, slicer.gap
        )
        seconds["critical regions"] = time.perf_counter() - start
        start = time.perf_counter()
        normals = normal_field(stress.mesh, regions, up)
        seconds["vector field"] = time.perf_counter() - start
        start = time.perf_counter()
        lengths = (slicer.thickness / slicer.thickest, slicer.thickness / slicer.thinnest)
        height_field(stress.mesh, normals.direction, slicer.blend, lengths)
        seconds["scalar field"] = time.perf_counter() - start
        start = time.perf_counter()
        sliced = slicer.slice(stress)
        whole = time.perf_counter() - start
        seconds["layers"] = max(whole - sum(list(seconds.values())[:3]), 0.0)
        start = time.perf_counter()
        x, y, z = sliced.field.up.tolist()
        support = support_layers(
            stress.mesh, sliced.layers, (x, y, z), sliced.field.values, sliced.step
        )
        seconds["support layers"] = time.perf_counter() - start
        start = time.perf_counter()
        paths = plan(create("fiso", {"turns": "tight"}), sliced.layers, stress, case.machine)
        seconds["paths"] = time.perf_counter() - start
        stages = ("critical regions", "vector field", "scalar field", "layers")
        parts = (*stages, "support layers", "paths")
        seconds = {key: seconds[key] for key in parts}
    seconds["all"] = sum(seconds.values())
    return Chain(case, stress, sliced, paths, support, distances_below(sliced.layers), seconds)


def table_1(chains: Mapping[str, Chain]) -> str:
    """Parameters and properties of both parts, the paper's in brackets."""
    rows = []
    for part, run in chains.items():
        slicer, regions = run.case.slicing, run.sliced.regions
        assert isinstance(slicer, LoadOriented)
        rows.append(
            (
                *(part, f"{len(run.stress.mesh.cells)} ({PAPER_CELLS[part]})"),
                f"{slicer.share:g} ({PAPER_SHARE[part]:g})",
                *(f"{regions.critical.mean():.1%}", f"{(regions.region >= 0).mean():.1%}"),
                *(str(regions.count), str(len(run.sliced.layers))),
            )
        )
    shares = ("share of the peak", "of cells critical", "in regions")
    return table(("part", "cells", *shares, "regions", "layers"), rows)


def table_2(chains: Mapping[str, Chain]) -> str:
    """Seconds of each stage; the paper gives sums alone."""
    stages = list(next(iter(chains.values())).seconds)
    rows = [
        (part, *(f"{run.seconds[stage]:.2f}" for stage in stages), f"{PAPER_SECONDS[part]:g}")
        for part, run in chains.items()
    ]
    return table(("part", *stages, "paper, all"), rows)
