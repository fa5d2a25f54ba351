"""Field, layers and strands on the T-bracket beside the published ones.

    python -m ccfem.papers.fang_2024.t_bracket

with ``CCFEM_FANG2024`` naming the data. Prints tables in Markdown; a quarter of an hour, most of
it the finite elements.
"""

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity import GivenStress, PartStress
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import resample, sample_midpoints, turning_angles
from ccfem.machine import Machine
from ccfem.papers.contents import table
from ccfem.papers.fang_2024.authors import (
    authors_layers,
    authors_mesh,
    authors_strands,
    authors_stress,
)
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.planning import PartStrategy, Strategy, plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.curved_stack import layer_matrix
from ccfem.slicing.guidance.joints import joint_lines, joints_of
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.slicing.principal_lines import strongest_stress
from ccfem.slicing.slicers.spatial import Spatial, SpatialSlicing
from ccfem.strategies import create
from ccfem.strategies.winding_curves.piece import joint_loops
from ccfem.strategies.winding_curves.spaced import CLOSEST

# Figures of strands in space: the same measures for ours and for the published ones.


_AWAY = 12.0
"""Arc length from which on a strand is its own neighbour, mm (as the published spacing)."""


NOMINAL, WIDEST = 2.2, 1.5
"""Spacing asked for, mm, as the authors' is; most that it may be, in itself (least: `CLOSEST`)."""
_MEASURED = 0.99
"""Allowance for the steps of the samples, which are cut afresh."""


def measured(
    paths: Toolpaths, layers: Sequence[Layer], stress: PartStress, weight: FloatArray
) -> dict[str, float]:
    """Measure strands.

    Parameters
    ----------
    weight : (m,) array
        Of the cells: above 0 where stress lines join the joints.

    Returns
    -------
    layers, per_layer, metres_per_layer
        Layers with fibre, strands on each of them, and their length, m.
    closed, round_all
        Shares of the strands that are closed, and that go once round all joints of their layer.
    angle, angle_weighted
        Mean angle, degrees, to the strongest stress where stress lines join the joints, by length,
        and by length and number of these lines.
    spacing_10, spacing_50, spacing_90
        Percentiles, mm.
    curvature_50, curvature_80, curvature_95
        Percentiles, 1/mm.
    near, far
        Shares of the strands' length with the next strand nearer than 0.7 nominal spacings, and
        further than 1.5.
    covered
        Share of the area of the layers with fibre within half of 1.5 nominal spacings of a strand.
    closed_length
        Share of the strands' length in closed ones.
    """
    with_fibre = np.unique(paths.layer)
    angle, length, cell = _angles(paths, stress)
    critical = weight[cell] > 0.0
    spacing, curvature, round_all, area = [], [], [], np.zeros(2)
    known = {layer.index: layer for layer in layers}
    for index in with_fibre.tolist():
        mine = paths.on_layer(index)
        spacing.append(_spacing(mine))
        curvature.append(_curvature(mine))
        round_all.append(_round_all(mine, known[index], stress))
        area += _covered(mine, known[index], 0.5 * WIDEST * NOMINAL)
    apart, bend = np.concatenate(spacing), np.concatenate(curvature)
    apart = apart[np.isfinite(apart)]
    figures = {
        "layers": len(with_fibre),
        "per_layer": len(paths) / len(with_fibre),
        "closed": paths.closed.mean(),
        "round_all": np.concatenate(round_all).mean(),
        "metres_per_layer": float(paths.lengths.sum()) / 1e3 / len(with_fibre),
        "angle": np.average(angle[critical], weights=length[critical]),
        "angle_weighted": np.average(angle, weights=length * weight[cell]),
        **{f"spacing_{share}": np.quantile(apart, share / 100) for share in (10, 50, 90)},
        **{f"curvature_{share}": np.quantile(bend, share / 100) for share in (50, 80, 95)},
        "near": (apart < _MEASURED * CLOSEST * NOMINAL).mean(),
        "far": (apart > WIDEST * NOMINAL).mean(),
        "covered": area[0] / area[1],
        "closed_length": paths.lengths[paths.closed].sum() / paths.lengths.sum(),
    }
    return {name: float(value) for name, value in figures.items()}


def _angles(paths: Toolpaths, stress: PartStress) -> tuple[FloatArray, FloatArray, IntArray]:
    """Angle to the strongest stress of the cell, degrees, length and cell of samples."""
    points, tangent, length, _ = sample_midpoints(paths.points, paths.offsets, 0.7)
    cell, _ = locate(stress.mesh.points, stress.mesh.corners, points, 2.0)
    inside = cell >= 0
    direction = strongest_stress(stress.stress).direction[cell[inside]]
    cosine = np.abs(np.einsum("sd,sd->s", tangent[inside], direction))
    return np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))), length[inside], cell[inside]


def _spacing(paths: Toolpaths) -> FloatArray:
    """Distance to the nearest strand of the layer within 6 mm, of itself from 12 mm of arc on."""
    points, offsets = resample(paths.points, paths.offsets, 0.4)
    owner = np.repeat(np.arange(len(paths)), np.diff(offsets))
    step = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1)])
    step[offsets[:-1]] = 0.0
    along = np.cumsum(step)
    along = along - along[offsets[:-1]][owner]
    period = np.where(paths.closed, paths.lengths, np.inf)
    spacing = []
    tree = cKDTree(points)
    for row, near in zip(
        range(0, len(points), 3), tree.query_ball_point(points[::3], 6.0), strict=True
    ):
        others = np.array(near)
        apart = np.abs(along[others] - along[row])
        apart = np.minimum(apart, period[owner[row]] - apart)
        others = others[(owner[others] != owner[row]) | (apart > _AWAY)]
        away = np.linalg.norm(points[others] - points[row], axis=1)
        spacing.append(float(away.min()) if len(others) else np.nan)
    return np.array(spacing)


def _covered(paths: Toolpaths, layer: Layer, reach: float) -> FloatArray:
    """Area of a layer within a reach of its strands, and all of it."""
    points, _ = resample(paths.points, paths.offsets, 0.4)
    middle = layer.points[layer.triangles].mean(axis=1)
    near = cKDTree(points).query(middle)[0] <= reach
    return np.array([layer.areas[near].sum(), layer.areas.sum()])


def _curvature(paths: Toolpaths) -> FloatArray:
    """Curvature at millimetre steps, 1/mm."""
    points, offsets = resample(paths.points, paths.offsets, 1.0)
    turn = turning_angles(points, offsets, paths.closed)
    size = np.repeat(paths.lengths / np.maximum(np.diff(offsets) - 1, 1), np.diff(offsets))
    inner = np.ones(len(points), dtype=bool)
    inner[offsets[:-1]] = inner[offsets[1:] - 1] = False
    return np.asarray((turn / np.maximum(size, 1e-9))[inner])


def _round_all(paths: Toolpaths, layer: Layer, stress: PartStress) -> FloatArray:
    """Whether each strand is closed and has all joints of its layer inside, in the chart."""
    chart = chart_of(layer)
    flat = chart.flattened(paths)
    holes = [
        shapely.Polygon(chart.flat.points[loop][:, :2])
        for loop in joint_loops(layer, stress.held_or_loaded).values()
    ]
    return np.array(
        [
            closed
            and len(line) > 3
            and all(shapely.Polygon(line[:, :2]).buffer(0.0).covers(hole) for hole in holes)
            for line, closed in zip(flat, paths.closed, strict=True)
        ],
        dtype=np.float64,
    )


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
