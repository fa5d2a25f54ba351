"""Extending direction and stress to all of a layer, where tension is undefined or noisy."""

import numpy as np
import scipy.sparse as sparse

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.paths.fields.layer_elements import Surface, positive_definite

_AVERAGES = 50


def fill_laplacian(
    surface: Surface,
    direction: FloatArray,
    stress: FloatArray,
    defined: BoolArray,
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
