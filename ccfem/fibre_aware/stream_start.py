"""Start of the design of a stream function: its grid, and a field that follows the tension."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray
from ccfem.elasticity.stress_field import StressField
from ccfem.fibre_aware.smeared import SmearedPart
from ccfem.fibre_aware.stream_design import DENSEST, StreamProblem
from ccfem.fields.fill import fill_screened
from ccfem.fields.layer_elements import Surface, positive_definite
from ccfem.fields.layer_tension import layer_tension
from ccfem.fields.orientation import orient
from ccfem.fields.tensile import Tension
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import stress_on
from ccfem.tensor import largest_in_plane

__all__ = ["field_along", "mixed_tension", "plane_axes", "start_field"]

_SPACING_WEIGHT = 0.1
"""Weight of the wanted density against the direction, as in `fields.scalar.fit_weighted`."""

_FILL_LENGTH = 3.0
"""Length, mm, over which the screened fill carries the field on."""

_FULLEST = 0.85
"""Largest share of the fibre at the density limit to which the first field is scaled up."""

_LEAST_WEIGHT = 1e-3
_SMOOTH = 1e-5
_REGULARISATION = 1e-9


def plane_axes(part: SmearedPart, energy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Centre (2,) and in-plane axes (2, 2) that rotate with the part and its load.

    They are the in-plane principal axes of inertia, of volume and strain energy in equal parts: a
    symmetric part rarely has a load that is symmetric too.

    Parameters
    ----------
    part : SmearedPart
    energy : (m,) array
        Strain energy of each cell, in any unit.
    """
    mesh = part.mesh
    place = part.centroids @ part.frame[:2].T
    weight = mesh.volumes / mesh.volumes.sum() + energy / energy.sum()
    centre = weight @ place / weight.sum()
    away = place - centre
    _, vectors = np.linalg.eigh((away * weight[:, None]).T @ away)
    first = vectors[:, 1] * (1.0 if vectors[np.abs(vectors[:, 1]).argmax(), 1] > 0.0 else -1.0)
    return centre, np.stack([first, [-first[1], first[0]]])


def start_field(
    problem: StreamProblem,
    stress: StressField,
    layers: Sequence[Layer],
    cap: float,
) -> FloatArray:
    """Fields that follow the tension, as dense as the budget allows.

    Parameters
    ----------
    problem : StreamProblem
    stress : StressField
        Of the part without fibre.
    layers : sequence of Layer
        One for each group, whose tension its field follows.
    cap : float
        Percentile of the stress above which the density no longer increases.

    Returns
    -------
    (c,) array
        Coefficients; zero for a group without tension.
    """
    return field_along(problem, layers, [layer_tension(stress_on(k, stress)) for k in layers], cap)


def field_along(
    problem: StreamProblem, layers: Sequence[Layer], tensions: Sequence[Tension], cap: float
) -> FloatArray:
    """Fields (c,) that follow given tensions of one layer for each group; cap as `start_field`."""
    values = np.concatenate([np.where(t.defined, t.stress, 0.0) for t in tensions])
    weight = np.concatenate([layer.areas for layer in layers])
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order])
    at = int(np.searchsorted(below, cap / 100.0 * below[-1] * (1.0 - 1e-12)))
    top = max(float(values[order[min(at, len(order) - 1)]]), 1e-300)
    field = np.concatenate(
        [
            _fit(problem, layer, tension, top)
            for layer, tension in zip(layers, tensions, strict=True)
        ]
    )
    return _to_budget(problem, field)


def mixed_tension(tensions: Sequence[Tension], factors: FloatArray) -> Tension:
    """Tension of ``sum of factor s t t^T`` over the tensions s along t of several load cases.

    Parameters
    ----------
    tensions : sequence of Tension
        In the plane of one layer.
    factors : (n,) array
        Not negative.
    """
    total = np.zeros((len(tensions[0].stress), 3))
    for factor, one in zip(factors, tensions, strict=True):
        x, y = one.direction.T
        size = factor * np.where(one.defined, one.stress, 0.0)
        total += size[:, None] * np.stack([x * x, y * y, x * y], axis=1)
    largest, _, angle = largest_in_plane(total)
    return Tension(np.stack([np.cos(angle), np.sin(angle)], axis=1), largest, largest > 0.0)


def _fit(problem: StreamProblem, layer: Layer, tension: Tension, top: float) -> FloatArray:
    """Coefficients (k,) of the field along the tension of one layer."""
    grid = problem.grid
    if not tension.defined.any():
        return np.zeros(len(grid))
    surface = Surface.of(layer)
    confidence = np.where(tension.defined, np.minimum(tension.stress / top, 1.0), 0.0)
    direction, size = fill_screened(
        surface, tension.direction, tension.stress, confidence, _FILL_LENGTH
    )
    direction = orient(direction, surface.neighbours, confidence)
    density = DENSEST * np.clip(size / top, 0.0, 1.0)
    weight = np.maximum(confidence, _LEAST_WEIGHT) * surface.areas
    weight = weight / weight.sum()
    x, y = grid.slopes(surface.points[surface.triangles].mean(axis=1))
    a, b = direction.T
    along = problem.width * (sp.diags_array(a) @ x + sp.diags_array(b) @ y)
    across = problem.width * (sp.diags_array(a) @ y - sp.diags_array(b) @ x)
    weighted = (_SPACING_WEIGHT * across).T * weight
    bend = grid.laplacian.T @ grid.laplacian / len(grid)
    matrix = (along.T * weight) @ along + weighted @ across + _SMOOTH * bend
    matrix = matrix + _REGULARISATION * sp.eye_array(len(grid))
    return np.asarray(positive_definite(matrix).solve(weighted @ density))


def _to_budget(problem: StreamProblem, field: FloatArray) -> FloatArray:
    """Scale a field so that it uses the budget as far as the density stays below its limit."""
    size = np.hypot(*(slope @ field for slope in problem.slopes))
    most = _FULLEST * DENSEST * float(problem.room.sum())
    low, high = 1e-2, 1e2
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        length = problem.room @ np.minimum(middle * size, DENSEST)
        low, high = (middle, high) if length < min(problem.budget, most) else (low, middle)
    return low * field
