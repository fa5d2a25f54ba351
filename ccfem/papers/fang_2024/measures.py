"""Figures of strands in space: the same measures for ours and for the published ones."""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import resample, sample_midpoints, turning_angles
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.principal_lines import strongest_stress
from ccfem.strategies.winding_curves.piece import joint_loops
from ccfem.strategies.winding_curves.spaced import CLOSEST

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
