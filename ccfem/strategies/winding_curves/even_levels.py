"""Rescaling of a field so that its level lines are evenly spaced on average."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.paths.fields.layer_elements import Surface

_BINS = 40


def evened(surface: Surface, field: FloatArray) -> FloatArray:
    """Rescale a field in [0, 1] so that the mean distance between any two levels is the same.

    The mean distance between two levels is the area between them over the mean length of the levels
    there, which is the integral of the gradient's size over that area (coarea formula). Values
    below 0 are stretched like the lowest ones.

    Parameters
    ----------
    surface : Surface
    field : (n,) array

    Returns
    -------
    (n,) array
    """
    size = np.linalg.norm(surface.gradient(field), axis=1)
    corners = field[surface.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    edges = np.linspace(0.0, 1.0, _BINS + 1)
    inside = np.minimum(high[:, None], edges[1:]) - np.maximum(low[:, None], edges[:-1])
    share = np.clip(inside, 0.0, None) / np.maximum(high - low, 1e-12)[:, None]
    area = surface.areas @ share
    length = (surface.areas * size) @ share * _BINS
    width = area / np.maximum(length, 1e-9)
    values = np.concatenate([[0.0], np.cumsum(width)]) / width.sum()
    return np.where(field < 0.0, field * values[1] * _BINS, np.interp(field, edges, values))


def steep(surface: Surface, field: FloatArray, share: float) -> float:
    """Size of the gradient, 1/mm, that this share of the level lines' length does not exceed."""
    size = np.linalg.norm(surface.gradient(field), axis=1)
    weight = surface.areas * size * (surface.mean(field) > 0.0)
    order = np.argsort(size, kind="stable")
    below = np.cumsum(weight[order])
    at = min(int(np.searchsorted(below, share * below[-1])), len(size) - 1)
    return float(size[order][at])
