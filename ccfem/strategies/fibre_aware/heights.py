"""Layers over the height of a part: their cells, how they differ, and the case that each serves."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.tensor import in_plane
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.smeared import SmearedPart


def nearest_layer(part: SmearedPart, layers: Sequence[Layer]) -> IntArray:
    """Position in `layers` of the one nearest in height to each cell, (m,)."""
    heights = np.array([layer.plane.height for layer in layers])
    order = np.argsort(heights, kind="stable")
    bounds = 0.5 * (heights[order][1:] + heights[order][:-1])
    level = part.centroids @ part.frame[2]
    return np.asarray(order[np.searchsorted(bounds, level)])


def fibre_capacity(part: SmearedPart, layers: Sequence[Layer], machine: Machine) -> FloatArray:
    """Density of fibre (m,), mm/mm^3, at one strand a width in the layer nearest to each cell."""
    thickness = np.array([layer.thickness for layer in layers])
    return 1.0 / (machine.fibre_width * thickness[nearest_layer(part, layers)])


def group_layers(layers: Sequence[Layer], groups: int) -> IntArray:
    """Divide layers into groups of about the same number, from the bottom to the top.

    Returns
    -------
    (n,) int array
        Group of each layer; every group has a layer.
    """
    order = np.argsort([layer.plane.height for layer in layers], kind="stable")
    group = np.empty(len(layers), dtype=np.int64)
    group[order] = np.arange(len(layers)) * min(groups, len(layers)) // len(layers)
    return group


def alike_share(part: SmearedPart, stress: FloatArray, size: float) -> float:
    """Share of the in-plane stress that is the same at all heights, in [0, 1].

    Parameters
    ----------
    stress : (m, 3, 3) array, MPa
    size : float, mm
        Side of the squares above which the stress is averaged over the height.

    Returns
    -------
    float
        1 for a plate loaded in its plane, about 0 for a plate that is bent.
    """
    volume = part.mesh.volumes
    place = part.centroids @ part.frame[:2].T
    plane = in_plane(stress, part.frame) * np.array([1.0, 1.0, np.sqrt(2.0)])
    square = np.floor((place - place.min(axis=0)) / size).astype(np.int64)
    _, column = np.unique(square, axis=0, return_inverse=True)
    total = np.bincount(column, volume)
    mean = np.stack([np.bincount(column, volume * s) / total for s in plane.T], axis=1)
    whole = float(volume @ (plane**2).sum(axis=1))
    return float(total @ (mean**2).sum(axis=1)) / whole if whole > 0.0 else 1.0


def middle_layers(layers: Sequence[Layer], group: IntArray) -> list[Layer]:
    """Return the middle layer of each group, from the group (layers,) of every layer."""
    numbers = [np.flatnonzero(group == k) for k in range(int(group.max()) + 1)]
    return [layers[int(own[len(own) // 2])] for own in numbers]


def layer_counts(weights: FloatArray, count: int) -> IntArray:
    """Share out layers among cases by the largest remainder: the number of each, (n,).

    Parameters
    ----------
    weights : (n,) array
        Positive.
    count : int
        Of layers.
    """
    wanted = weights / weights.sum() * count
    counts = np.floor(wanted + 1e-9).astype(np.int64)
    rest = np.argsort(-np.round(wanted - counts, 9), kind="stable")
    counts[rest[: count - int(counts.sum())]] += 1
    return counts


def layers_by_case(weights: FloatArray, layers: Sequence[Layer]) -> IntArray:
    """Case of each layer, (layers,); the layers of each case are spread evenly over the height.

    From the bottom up each layer goes to the case that is farthest behind its share; if several
    are, to the first of them.
    """
    count = len(layers)
    counts = layer_counts(weights, count)
    order = np.argsort([layer.plane.height for layer in layers], kind="stable")
    given = np.zeros(len(counts), dtype=np.int64)
    case_of = np.empty(count, dtype=np.int64)
    for place, number in enumerate(order):
        behind = np.round(counts * (place + 0.5) / count - given, 9)
        k = int(np.argmax(np.where(given < counts, behind, -np.inf)))
        given[k] += 1
        case_of[number] = k
    return case_of
