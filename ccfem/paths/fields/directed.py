"""Direction and stress everywhere on a layer, ready for scalar fields of any density."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.sparse as sparse

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.paths.fields.layer_elements import Surface, positive_definite
from ccfem.paths.fields.tensile import Tension, orient
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class Directed:
    """Direction and stress everywhere on a layer, whatever the density of its strands.

    Attributes
    ----------
    cap : float, MPa
        Stress at which the density reaches its full value.
    confidence : (t,) array in [0, 1]
        Stress over the cap; 0 where the tension has no direction.
    direction : (t, 2) array
        Oriented unit vectors.
    size : (t,) array, MPa
    """

    layer: Layer
    surface: Surface
    tension: Tension
    cap: float
    confidence: FloatArray
    direction: FloatArray
    size: FloatArray


def directed(
    layer: Layer,
    tension: Tension,
    cap: float,
    fill: Literal["screened", "laplacian"],
    fill_length: float,
) -> Directed:
    """Extend the directions of the tension to the whole layer, and orient them.

    Parameters
    ----------
    tension : Tension
        On its triangles.
    cap : float
        Percentile, by area, of the stress at which the density reaches its full value.
    fill : {"screened", "laplacian"}
        See `fields.fill`.
    fill_length : float, mm
        Length over which the screened fill carries the field on.
    """
    surface = Surface.of(layer)
    percentile = np.quantile(
        tension.stress, cap / 100.0 * (1.0 - 1e-12), weights=surface.areas, method="inverted_cdf"
    )
    top = max(float(percentile), 1e-300)
    confidence = np.where(tension.defined, np.minimum(tension.stress / top, 1.0), 0.0)
    direction = tension.direction
    if fill == "screened":
        direction, size = fill_screened(surface, direction, tension.stress, confidence, fill_length)
        direction = orient_along(surface, direction, confidence)
    else:
        if not tension.oriented:
            direction = orient(direction, surface.neighbours)
        direction, size = fill_laplacian(surface, direction, tension.stress, tension.defined)
    return Directed(layer, surface, tension, top, confidence, direction, size)


# Signs for a field of lines that no choice of signs makes continuous: a cut along the field.
#
# If a pin pulls a lug, the lines of tension come from the far end, turn round the hole and go back:
# a vector that follows them once round the hole has changed its sign. So there must be a cut across
# which neighbouring vectors oppose each other. If the cut runs along the lines, the scalar field
# has a crease there, and its isocurves stay parallel to the cut. If it crosses the lines, the
# isocurves turn aside. A spanning tree of neighbours cannot tell these cases apart.


_ACROSS = 3e-3
"""Penalty of a change across the lines, over that of one along them. The cut runs along the lines
while this is below (breadth / twice the length)^2 of the strip that they fill."""
_LEAST_WEIGHT = 1e-3
_POWER = 0.5
_ITERATIONS = 20


def orient_along(surface: Surface, direction: FloatArray, confidence: FloatArray) -> FloatArray:
    """Flip vectors so that, where they have to oppose each other, they do so across a line.

    The sign is that of a function u that is as smooth as possible along the lines. With the signs s
    of a spanning tree, inverse iteration minimises ``sum_f w_f A_f [(t . grad(s u))^2 + a |grad(s
    u)|^2]``, a small, at a fixed ``sum_f w_f A_f |u|^(1 + p)``. With p = 1 the result is an
    eigenvector, which may be confined to one limb of a part and meaningless elsewhere; with a
    smaller p it has a size everywhere. If a continuous choice of signs exists, u is constant, and
    the result is that of `orientation.orient`.

    Parameters
    ----------
    direction : (t, 2) array
        Unit vectors on the triangles, of any sign.
    confidence : (t,) array in [0, 1]
        w: the smaller it is, the less a cut costs.

    Returns
    -------
    (t, 2) array
        `direction` or its opposite, triangle by triangle.
    """
    direction = orient(direction, surface.neighbours, confidence)
    triangles = surface.triangles
    weight = confidence + _LEAST_WEIGHT
    relative = np.einsum(
        "td,tkd->tk", direction, _mean_line_at_points(surface, direction)[triangles]
    )
    sign = np.where(relative < 0.0, -1.0, 1.0)

    metric = direction[:, :, None] * direction[:, None, :] + _ACROSS * np.eye(2)
    stiffness = _turned_energy(surface, (weight * surface.areas)[:, None, None] * metric, sign)
    mass = surface.lumped(weight)
    mass += 1e-9 * mass.mean()  # points without triangles
    reach = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    solver = positive_definite(stiffness + sparse.diags_array(mass / reach**2, format="csc"))

    shares = (sign * (weight * surface.areas)[:, None]).ravel()
    values = np.sign(np.bincount(triangles.ravel(), shares, minlength=len(surface.points)))
    for _ in range(_ITERATIONS):
        values = solver.solve(mass * values)
        values /= np.abs(values).max()
        values = np.sign(values) * np.abs(values) ** _POWER
    opposed = (sign * values[triangles]).sum(axis=1) < 0.0
    return np.where(opposed[:, None], -direction, direction)


def _mean_line_at_points(surface: Surface, direction: FloatArray) -> FloatArray:
    """Mean line at the points, (n, 2), of any sign."""
    cosine = surface.lumped(direction[:, 0] ** 2 - direction[:, 1] ** 2)
    sine = surface.lumped(2.0 * direction[:, 0] * direction[:, 1])
    angle = 0.5 * np.arctan2(sine, cosine)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _turned_energy(surface: Surface, metric: FloatArray, sign: FloatArray) -> sparse.csc_array:
    """As `Surface.energy`, with the value at each corner of each triangle times a sign (t, 3)."""
    slopes = surface.gradients * sign[:, :, None]
    return surface.matrix(np.einsum("tid,tde,tje->tij", slopes, metric, slopes))


# Extending direction and stress to all of a layer, where tension is undefined or noisy.


_AVERAGES = 50


def fill_laplacian(
    surface: Surface, direction: FloatArray, stress: FloatArray, defined: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Fill by averaging over neighbouring triangles, 50 times [Chen et al. 2021, Eq. 3-4].

    The triangle of largest stress is fixed. The minimiser of the energy is a constant, so further
    iterations keep degrading the field; `fill_screened` does not.

    Parameters
    ----------
    direction : (t, 2) array
        Oriented vectors; those of undefined triangles are ignored.
    stress : (t,) array, MPa
    defined : (t,) bool array

    Returns
    -------
    direction : (t, 2) array
        Unit vectors.
    stress : (t,) array, MPa
    """
    count = len(surface.triangles)
    i, j = surface.neighbours.T
    adjacency = sparse.coo_array((np.ones(len(i)), (i, j)), shape=(count, count)).tocsr()
    adjacency = adjacency + adjacency.T
    degree = np.maximum(adjacency.sum(axis=1), 1.0)[:, None]
    held = int(np.argmax(np.where(defined, stress, -np.inf)))
    values = np.column_stack([np.where(defined[:, None], direction, 0.0), stress])
    fixed = values[held].copy()
    for _ in range(_AVERAGES):
        values = adjacency @ values / degree
        values[held] = fixed
    length = np.linalg.norm(values[:, :2], axis=1)
    unit = values[:, :2] / np.maximum(length, 1e-300)[:, None]
    return np.where(length[:, None] > 0.0, unit, [1.0, 0.0]), values[:, 2]


def fill_screened(
    surface: Surface,
    direction: FloatArray,
    stress: FloatArray,
    confidence: FloatArray,
    length: float = 3.0,
) -> tuple[FloatArray, FloatArray]:
    """Fill by one screened Poisson problem at the points of the layer.

    Solves ``(M_c + length^2 L) x = M_c x0`` with the mass M_c weighted by the confidence and the
    Laplacian L, for the stress and for the direction in double-angle form (since a line has no
    sign). The field is kept where the confidence is high; elsewhere it is carried on from there
    over about `length`.

    Parameters
    ----------
    direction : (t, 2) array
        Unit vectors on the triangles, of any sign.
    stress : (t,) array, MPa
    confidence : (t,) array in [0, 1]
    length : float, mm, default 3.0

    Returns
    -------
    direction : (t, 2) array
        Unit vectors on the triangles, of any sign.
    stress : (t,) array, MPa
    """
    angle = np.arctan2(direction[:, 1], direction[:, 0])
    mass = surface.lumped(np.ones(len(angle)))
    floor = 1e-9 * mass.mean() + 1e-6 * mass
    metric = length**2 * surface.areas[:, None, None] * np.eye(2)
    weighted = surface.lumped(confidence) + floor
    matrix = surface.energy(metric) + sparse.diags_array(weighted, format="csc")
    sources = [np.cos(2.0 * angle), np.sin(2.0 * angle), stress]
    right = np.column_stack([surface.lumped(confidence * source) for source in sources])
    cosine, sine, size = surface.mean(positive_definite(matrix).solve(right)).T
    filled = 0.5 * np.arctan2(sine, cosine)
    return np.column_stack([np.cos(filled), np.sin(filled)]), size
