"""The chain from stress to paths, stage by stage: seconds and what comes out (tables 1 and 2)."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.cases import create_case
from ccfem.cases.case import Case
from ccfem.fem.elasticity import StressField, solve
from ccfem.papers.contents import table
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.support import SupportLayers, support_layers
from ccfem.slicing.guidance.height_field import height_field
from ccfem.slicing.guidance.normal_field import normal_field
from ccfem.slicing.guidance.stress_regions import stress_regions
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.load_oriented import LoadOriented, LoadOrientedSlicing
from ccfem.strategies import create

# Distance of layers, on their triangles alone: from each to the plane of the one below.


_REACH = 8
"""So many layers below are looked at."""
_FARTHEST = 1.0
"""Distance, mm, twice the thickest layer, from which on nothing is below: an island begins."""
_AT_BORDER = 0.03
"""Share by which the nearest point may lie aside of the foot on its plane: else it is a border."""


@dataclass(frozen=True)
class Distances:
    """Distance, mm, of the middle of triangles from the layer below, and their areas, mm^2.

    Triangles with nothing below are left out; `covered` is the share of the area that is not.
    """

    distance: FloatArray
    area: FloatArray
    covered: float

    @property
    def mean(self) -> float:
        """Mean by area, mm."""
        return float(np.average(self.distance, weights=self.area))

    def within(self, least: float, most: float) -> float:
        """Share of the area with a distance in a range, mm."""
        inside = (self.distance >= least) & (self.distance <= most)
        return float(self.area[inside].sum() / self.area.sum())


def distances_below(layers: Sequence[Layer], judged: Sequence[bool] | None = None) -> Distances:
    """Measure the distance of all layers, or of those that are judged, from those below."""
    distances, areas = [], []
    for k, layer in enumerate(layers[1:], 1):
        if judged is not None and not judged[k]:
            continue
        middle = layer.points[layer.triangles].mean(axis=1)
        nearest = np.full(len(middle), np.inf)
        for below in layers[max(0, k - _REACH) : k]:
            low, high = below.points.min(axis=0), below.points.max(axis=0)
            near = ((middle > low - _FARTHEST) & (middle < high + _FARTHEST)).all(axis=1)
            if not near.any():
                continue
            foot = below.nearest(middle[near])
            off = middle[near] - below.values_at(foot, below.points)
            plane = np.abs(np.einsum("kd,kd->k", off, below.normals[foot.triangle]))
            inside = foot.distance - plane < _AT_BORDER * foot.distance + 1e-3
            nearest[near] = np.minimum(nearest[near], np.where(inside, plane, np.inf))
        distances.append(nearest)
        areas.append(layer.areas)
    distance, area = np.concatenate(distances), np.concatenate(areas)
    known = distance < _FARTHEST
    return Distances(distance[known], area[known], float(area[known].sum() / area.sum()))


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


@contextmanager
def _clocked(seconds: dict[str, float], stage: str) -> Iterator[None]:
    """Note the seconds that a block takes."""
    start = time.perf_counter()
    yield
    seconds[stage] = time.perf_counter() - start


def chain(name: str) -> Chain:
    """Run the chain on a case, once for the compiler and once on the clock."""
    case = create_case(name)
    stress = solve(case.problem)["lift"]
    slicer = case.slicing
    assert isinstance(slicer, LoadOriented)
    up = np.array([0.0, 0.0, 1.0])
    for _ in range(2):
        seconds: dict[str, float] = {}
        with _clocked(seconds, "critical regions"):
            regions = stress_regions(
                stress.mesh, stress.stress, up, slicer.share, slicer.quantile, slicer.gap
            )
        with _clocked(seconds, "vector field"):
            normals = normal_field(stress.mesh, regions, up)
        with _clocked(seconds, "scalar field"):
            lengths = (slicer.thickness / slicer.thickest, slicer.thickness / slicer.thinnest)
            height_field(stress.mesh, normals.direction, slicer.blend, lengths)
        before = sum(seconds.values())  # the slicer does these again
        with _clocked(seconds, "layers"):
            sliced = slicer.slice(stress)
        seconds["layers"] = max(seconds["layers"] - before, 0.0)
        with _clocked(seconds, "support layers"):
            x, y, z = sliced.field.up.tolist()
            support = support_layers(
                stress.mesh, sliced.layers, (x, y, z), sliced.field.values, sliced.step
            )
        with _clocked(seconds, "paths"):
            paths = plan(create("fiso", {"turns": "tight"}), sliced.layers, stress, case.machine)
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
