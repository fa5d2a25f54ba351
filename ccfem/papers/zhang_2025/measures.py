"""Figures of strands and layers: the same measures for ours and for the published ones."""

from collections.abc import Mapping, Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.body.mesh.patches import Cylinder, unit_vector
from ccfem.fem.elasticity import PartStress
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

WIDTH = 1.1
"""Of the strands of the paper, mm."""
SHORTEST = 42.0
"""Shortest strand that a cutter behind the nozzle allows, mm, as in Chen et al. 2021."""
_COLUMNS = {
    "coverage": "coverage",
    "coverage of tension": "coverage_stress",
    "angle": "angle_mean",
    "within 10": "aligned_10",
    "within 10, by tension": "aligned_stress_10",
    "spacing, 5 %": "spacing_5",
    "spacing, median": "spacing_50",
    "on fibre": "on_fibre",
}


def measured(
    paths: Toolpaths, layers: Sequence[Layer], stress: PartStress, machine: Machine
) -> dict[str, float]:
    """Measure strands.

    Returns
    -------
    coverage, coverage of tension
        Share of the layers within half a width of a strand, by area and by the tension there.
    angle, within 10, within 10, by tension
        Mean angle to the largest stress in the layer, degrees, and the share of the strands' length
        within 10 degrees of it, by itself and by the tension there.
    spacing, 5 %, spacing, median
        Distance to the neighbour, mm.
    on fibre
        Share of the length that lies on other fibre.
    metres, strands
        A layer with fibre.
    long
        Share of the length in strands of at least 42 mm.
    """
    total = evaluate(paths, layers, stress, machine).total
    count, length = len(np.unique(paths.layer)), paths.lengths
    return {
        **{name: float(total[column]) for name, column in _COLUMNS.items()},
        "metres": 1e-3 * float(length.sum()) / count,
        "strands": len(paths) / count,
        "long": float(length[length >= SHORTEST].sum() / length.sum()),
    }


def angles_to_axes(
    layers: Sequence[Layer], holes: Mapping[str, Cylinder], reach: float
) -> dict[str, float]:
    """Mean angle, degrees, by area, between layers' normals and the axes of holes near these.

    Parameters
    ----------
    holes : mapping of str to Cylinder
        Walls, whole or in part.
    reach : float, mm
        Distance from the wall up to which a triangle of a layer counts; it lies beside the hole,
        not above it, where its layer has a border on the wall.

    Returns
    -------
    dict of str to float
        By hole; NaN where no layer reaches it.
    """
    return {name: _angle_to_axis(layers, hole, reach) for name, hole in holes.items()}


def _angle_to_axis(layers: Sequence[Layer], hole: Cylinder, reach: float) -> float:
    point, axis = np.asarray(hole.point), unit_vector(hole.axis, "axis of a hole")
    total = np.zeros(2)
    for layer in layers:
        border = np.concatenate(layer.loops)
        at_wall = np.abs(_from_axis(layer.points[border], point, axis) - hole.radius) < 0.1 * reach
        if not at_wall.any():
            continue
        level = (layer.points[border][at_wall] - point) @ axis
        middle = layer.points[layer.triangles].mean(axis=1)
        away = _from_axis(middle, point, axis) - hole.radius
        height = (middle - point) @ axis
        near = (away < reach) & (height > level.min() - reach) & (height < level.max() + reach)
        cosine = np.abs(layer.normals[near] @ axis)
        angle = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
        total += [float(angle @ layer.areas[near]), float(layer.areas[near].sum())]
    return float(total[0] / total[1]) if total[1] else float("nan")


def _from_axis(places: FloatArray, point: FloatArray, axis: FloatArray) -> FloatArray:
    """Distance of places (n, 3) from an axis, mm."""
    away = places - point
    return np.asarray(np.linalg.norm(away - (away @ axis)[:, None] * axis, axis=1))
