"""Start of the design of stream functions: their grid, and fields that follow the tension."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import in_axes, in_plane, largest_in_plane
from ccfem.fem.elasticity import StressField
from ccfem.paths.fields.directed import fill_screened
from ccfem.paths.fields.layer_elements import Surface, positive_definite
from ccfem.paths.fields.tensile import Tension, layer_tension, orient, plane_tension
from ccfem.slicing.layers.layer import Layer, stress_on
from ccfem.strategies.fibre_aware.layer_axes import LayerAxes
from ccfem.strategies.fibre_aware.smeared import SmearedPart
from ccfem.strategies.fibre_aware.stream_design import DENSEST, StreamModel, StreamProblem

_SPACING_WEIGHT = 0.1
"""Weight of the wanted density against the direction, as in `fields.scalar.fit_weighted`."""

_FILL_LENGTH = 3.0
"""Length, mm, over which the screened fill carries the field on."""

_FULLEST = 0.85
"""Largest share of the fibre at the density limit to which the first field is scaled up."""

_LEAST_WEIGHT = 1e-3
_SMOOTH = 1e-5
_REGULARISATION = 1e-9


def plane_axes(part: SmearedPart, energies: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Centre (2,) and in-plane axes (2, 2) that rotate with the part and its loads.

    They are the in-plane principal axes of inertia, of volume and strain energy in equal parts: a
    symmetric part rarely has a load that is symmetric too. For curved layers they are (3,) and
    (3, 3) in space.

    Parameters
    ----------
    energies : sequence of (m,) arrays
        Strain energy of each cell under each load case, in any unit.
    """
    mesh = part.mesh
    place = part.axes.places(part.centroids)
    shares = np.mean([energy / energy.sum() for energy in energies], axis=0)
    weight = mesh.volumes / mesh.volumes.sum() + shares
    centre = weight @ place / weight.sum()
    away = place - centre
    _, vectors = np.linalg.eigh((away * weight[:, None]).T @ away)
    if part.axes.curved:  # their signs do not change the grid, whose corner is the centre
        return centre, vectors[:, ::-1].T
    first = vectors[:, 1] * (1.0 if vectors[np.abs(vectors[:, 1]).argmax(), 1] > 0.0 else -1.0)
    return centre, np.stack([first, [-first[1], first[0]]])


def start_fields(
    problem: StreamProblem,
    stresses: Sequence[StressField],
    layers: Sequence[Layer],
    cap: float,
    tilt: float = 1.0,
) -> FloatArray:
    """Make fields (n * c,) to start with: each mainly follows the tension of its own case.

    Field k follows ``sum over i of v_i s_i t_i t_i^T / sqrt(C_i)``, s_i the tension along t_i and
    C_i the compliance without fibre, v_i the tilt for its own case and equal for the others. It is
    as dense as the budget allows.

    Parameters
    ----------
    stresses : sequence of StressField
        Of the part without fibre, one for each case.
    layers : sequence of Layer
        One for each group, whose tension its field follows.
    cap : float
        Percentile of the stress above which the density no longer increases.
    tilt : float in (0, 1], default 1
        Weight of a field's own case. At 1 the initial fields are independent of each other; at
        1 / n they start alike, and stay so.

    Returns
    -------
    (n * c,) array
        Coefficients, field after field; zero for a group without tension.
    """
    count, axes = len(stresses), problem.model.part.axes
    if axes.curved:
        tensions = [[_tension_in_cells(stress_field, axes) for stress_field in stresses]]
    else:
        tensions = [
            [layer_tension(stress_on(layer, stress_field)) for stress_field in stresses]
            for layer in layers
        ]
    size = np.sqrt([part.unreinforced.work for part in problem.parts])
    fields = []
    for k in range(count):
        factors = np.full(count, (1.0 - tilt) / max(count - 1, 1))
        factors[k] = tilt
        mixed = [mixed_tension(of_layer, factors / size) for of_layer in tensions]
        fields.append(field_along(problem.model, layers, mixed, cap))
    return np.concatenate(fields)


def field_along(
    model: StreamModel, layers: Sequence[Layer], tensions: Sequence[Tension], cap: float
) -> FloatArray:
    """Fields (c,) that follow given tensions of one layer for each group; cap as `start_fields`.

    For curved layers the only tension is that of the cells (`_tension_in_cells`).
    """
    part = model.part
    values = np.concatenate([np.where(t.defined, t.stress, 0.0) for t in tensions])
    areas = [layer.areas for layer in layers]
    weight = part.mesh.volumes if part.axes.curved else np.concatenate(areas)
    order = np.argsort(values, kind="stable")
    below = np.cumsum(weight[order])
    at = int(np.searchsorted(below, cap / 100.0 * below[-1] * (1.0 - 1e-12)))
    top = max(float(values[order[min(at, len(order) - 1)]]), 1e-300)
    if part.axes.curved:
        return _to_budget(model, _fit_in_cells(model, tensions[0], top))
    field = np.concatenate(
        [_fit(model, layer, tension, top) for layer, tension in zip(layers, tensions, strict=True)]
    )
    return _to_budget(model, field)


def _tension_in_cells(stress: StressField, axes: LayerAxes) -> Tension:
    """Tension along curved layers in the cells of a part, in the frames of the cells."""
    tensors = in_axes(stress.nodal[stress.mesh.corners].mean(axis=1), axes.frames)
    return plane_tension(in_plane(tensors, np.eye(3)))


def mixed_tension(tensions: Sequence[Tension], factors: FloatArray) -> Tension:
    """Tension of ``sum of factor s t t^T`` over the tensions s along t of several load cases.

    The tensions lie in the plane of one layer, and the factors (n,) are not negative.
    """
    if len(tensions) == 1:  # only its size would change, which no field depends on
        return tensions[0]
    total = np.zeros((len(tensions[0].stress), 3))
    for factor, one in zip(factors, tensions, strict=True):
        x, y = one.direction.T
        size = factor * np.where(one.defined, one.stress, 0.0)
        total += size[:, None] * np.stack([x * x, y * y, x * y], axis=1)
    largest, _, angle = largest_in_plane(total)
    return Tension(np.stack([np.cos(angle), np.sin(angle)], axis=1), largest, largest > 0.0)


def _fit(model: StreamModel, layer: Layer, tension: Tension, top: float) -> FloatArray:
    """Coefficients (k,) of the field along the tension of one layer."""
    grid = model.grid
    if not tension.defined.any():
        return np.zeros(len(grid))
    surface = Surface.of(layer)
    confidence = np.where(tension.defined, np.minimum(tension.stress / top, 1.0), 0.0)
    direction, size = fill_screened(
        surface, tension.direction, tension.stress, confidence, _FILL_LENGTH
    )
    direction = orient(direction, surface.neighbours, confidence)
    weight = np.maximum(confidence, _LEAST_WEIGHT) * surface.areas
    slopes = grid.slopes(surface.points[surface.triangles].mean(axis=1))
    return _fitted(model, slopes, direction, size / top, weight)


def _fit_in_cells(model: StreamModel, tension: Tension, top: float) -> FloatArray:
    """Coefficients (k,) of a field in space along the tension in the cells."""
    mesh, direction = model.part.mesh, tension.direction
    confidence = np.where(tension.defined, np.minimum(tension.stress / top, 1.0), 0.0)
    lines = model.part.axes.in_space(direction)
    oriented = orient(lines, mesh.neighbours, confidence)
    direction = np.einsum("td,td->t", oriented, lines)[:, None] * direction
    weight = np.maximum(confidence, _LEAST_WEIGHT) * mesh.volumes
    slopes = model.part.axes.slopes(model.grid, model.centres)
    return _fitted(model, slopes, direction, tension.stress / top, weight)


def _fitted(
    model: StreamModel,
    slopes: Sequence[Any],
    direction: FloatArray,
    size: FloatArray,
    weight: FloatArray,
) -> FloatArray:
    """Coefficients (k,) of a field along directions, whose density grows with the stress.

    Parameters
    ----------
    slopes : two sparse (t, k) arrays
        Map coefficients to the gradient at the places, 1/mm.
    direction : (t, 2) array
        Unit vectors.
    size : (t,) array
        Stress over that at which strands lie side by side.
    weight : (t,) array
    """
    density = DENSEST * np.clip(size, 0.0, 1.0)
    weight = weight / weight.sum()
    grid, (x, y), (a, b) = model.grid, slopes, direction.T
    along = model.width * (sp.diags_array(a) @ x + sp.diags_array(b) @ y)
    across = model.width * (sp.diags_array(a) @ y - sp.diags_array(b) @ x)
    weighted = (_SPACING_WEIGHT * across).T * weight
    bend = grid.laplacian.T @ grid.laplacian / len(grid)
    matrix = (along.T * weight) @ along + weighted @ across + _SMOOTH * bend
    matrix = matrix + _REGULARISATION * sp.eye_array(len(grid))
    return np.asarray(positive_definite(matrix).solve(weighted @ density))


def _to_budget(model: StreamModel, field: FloatArray) -> FloatArray:
    """Scale a field so that it uses the budget as far as the density stays below its limit."""
    size = np.hypot(*(slope @ field for slope in model.slopes))
    most = _FULLEST * DENSEST * float(model.room.sum())
    low, high = 1e-2, 1e2
    for _ in range(60):
        middle = float(np.sqrt(low * high))
        length = model.room @ np.minimum(middle * size, DENSEST)
        low, high = (middle, high) if length < min(model.budget, most) else (low, middle)
    return low * field
