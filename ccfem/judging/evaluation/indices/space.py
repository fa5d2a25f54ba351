"""The fibre in space: its angle to the strongest principal stress, its bends, the linked joints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.geometry.polylines import curvature_samples, merge_repeated, sample_midpoints
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.principal_lines.critical import strongest_stress

PLACE = 140
"""Of these columns in tables: the smaller, the farther to the left."""

LARGE = True
"""Its samples take megabytes a layer."""

ON_SOME_LAYERS = True
"""Means and quantiles that some layers of many tell."""


_ANGLES = (10, 20, 30)
_REACH = 10.0
"""Distance, in fibre widths, within which a strand counts as linking a joint."""

_ANGLE = (
    "of the angle in space between the fibre and the principal stress of the largest size, tension "
    "or compression, of the nodal stress (samples as for angle_mean)"
)
_NONE = "NaN without fibre at any stress"

COLUMNS = (
    Column(
        "space_angle_mean",
        "degrees",
        f"Mean over the fibre's length {_ANGLE}.",
        f"0 to 90, 0 is best; {_NONE}",
    ),
    Column(
        "space_angle_stress",
        "degrees",
        f"Mean {_ANGLE}, weighted with the size of that stress too.",
        f"0 to 90, 0 is best; {_NONE}",
    ),
    *(
        Column(
            f"space_aligned_{a}",
            "1",
            f"Share of the fibre's length where that angle (space_angle_mean) is below {a} "
            "degrees.",
            f"0 to 1, 1 is best; {_NONE}",
        )
        for a in _ANGLES
    ),
    Column(
        "space_curvature_95",
        "1/mm",
        "95th percentile of the curvature in space over the fibre's length, "
        "resampled as for curvature_95: on curved layers that one is the curvature in the surface.",
        ">= 0; NaN where no path has three resampled points",
    ),
    Column(
        "across_tension",
        "1",
        "Tension that acts across the layers over all tension: sum over the layers' area of the "
        "normal stress on them, where positive, over that of the largest principal stress, where "
        "positive.",
        "0 to 1, 0 is best; NaN without tension",
    ),
    Column(
        "joints_linked",
        "1",
        "Number of held or loaded patches within ten fibre widths of a strand, along its layer, "
        "mean over strands by length.",
        ">= 0; NaN without fibre",
    ),
)


@dataclass(frozen=True)
class SpaceSamples(LayerSamples):
    """Samples of a layer."""

    # (s,): length, mm, of the fibre at each sample, its angle to the strongest stress, degrees, nan
    # where there is none, and that stress's size, MPa
    length: FloatArray
    angle: FloatArray
    size: FloatArray
    curvature: FloatArray  # (c,), 1/mm
    # (k,): length of each strand, mm, and number of patches near it
    strand: FloatArray
    linked: FloatArray
    # (t,): of each triangle: mm^2, normal stress and largest principal stress, MPa, 0 where
    # negative
    area: FloatArray
    across: FloatArray
    tension: FloatArray


def sample(paths: LayerPaths) -> SpaceSamples:
    """Take the samples of one layer, of the fibre a width apart.

    Nodal values of the stress are used for the fibre, those of the cells for the layer.
    """
    fibre, layer, stress = paths.inside, paths.layer, paths.stress
    step = paths.machine.fibre_width
    points, offsets, _ = merge_repeated(fibre.points, fibre.offsets, 1e-6)
    middle, tangent, length, _ = sample_midpoints(points, offsets, step)
    cells = stress.stress[layer.cell]
    angle, size = np.zeros(0), np.zeros(0)
    if len(middle):
        triangle, weights = _on_layer(layer, middle)
        corners = layer.interpolate(stress.nodal)[layer.triangles[triangle]]
        strongest = strongest_stress(np.einsum("sk,skij->sij", weights, corners))
        cosine = np.abs(np.einsum("sd,sd->s", tangent, strongest.direction))
        angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
        size = np.abs(strongest.value)
        angle[size <= 0.0] = np.nan
    across = layer.normals
    normal = np.einsum("ti,tij,tj->t", across, cells, across)
    return SpaceSamples(
        length,
        angle,
        size,
        curvature_samples(points, offsets, fibre.closed, step),
        fibre.lengths,
        _linked(fibre, layer, stress.held_or_loaded, _REACH * step),
        layer.areas,
        np.maximum(normal, 0.0),
        np.maximum(np.linalg.eigvalsh(cells)[:, 2], 0.0),
    )


def _on_layer(layer: Layer, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Triangle of a layer nearest to each point, and barycentric coordinates there."""
    triangle = np.full(len(points), -1, dtype=np.int64)
    weights = np.zeros((len(points), 3))
    if layer.flat is not None:
        triangle, weights = layer.plane_triangles.locate(layer.plane.project(points))
    left = np.flatnonzero(triangle < 0)
    if len(left):
        nearest = nearest_on_triangles(layer.points, layer.triangles, points[left])
        triangle[left], weights[left] = nearest.triangle, nearest.weights
    return triangle, weights


def _linked(fibre: Toolpaths, layer: Layer, patches: Sequence[str], reach: float) -> FloatArray:
    """Count the patches near each strand."""
    linked = np.zeros(len(fibre))
    if not len(fibre):
        return linked
    for name in patches:
        edges = layer.patches.get(name)
        if edges is None or not len(edges):
            continue
        away, _ = cKDTree(layer.points[np.unique(edges)]).query(fibre.points)
        linked += np.minimum.reduceat(away, fibre.offsets[:-1]) <= reach
    return linked


def indices(samples: SpaceSamples, _: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    known = ~np.isnan(samples.angle)
    length, angle = samples.length[known], samples.angle[known]
    force = length * samples.size[known]
    values = {"space_angle_mean": _mean(angle, length), "space_angle_stress": _mean(angle, force)}
    for a in _ANGLES:
        values[f"space_aligned_{a}"] = _mean((angle < a).astype(np.float64), length)
    bend = samples.curvature
    tension = float(samples.area @ samples.tension)
    return {
        **values,
        "space_curvature_95": (
            float(np.quantile(bend, 0.95, method="inverted_cdf")) if len(bend) else np.nan
        ),
        "across_tension": float(samples.area @ samples.across) / tension if tension else np.nan,
        "joints_linked": _mean(samples.linked, samples.strand),
    }


def _mean(values: FloatArray, weight: FloatArray) -> float:
    total = float(weight.sum())
    return float(weight @ values) / total if total > 0.0 else float("nan")
