"""Assignment of layers to load cases by weight, alternating over the height."""

from collections.abc import Sequence

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.layers.layer import Layer

__all__ = ["layer_counts", "layers_by_case"]


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
    found = np.floor(wanted + 1e-9).astype(np.int64)
    rest = np.argsort(-np.round(wanted - found, 9), kind="stable")
    found[rest[: count - int(found.sum())]] += 1
    return found


def layers_by_case(weights: FloatArray, layers: Sequence[Layer]) -> IntArray:
    """Case of each layer, (layers,); the layers of each case are spread evenly over the height.

    From the bottom up each layer goes to the case that is farthest behind its share; if several
    are, to the first of them.
    """
    count = len(layers)
    counts = layer_counts(weights, count)
    order = np.argsort([layer.plane.height for layer in layers], kind="stable")
    given = np.zeros(len(counts), dtype=np.int64)
    found = np.empty(count, dtype=np.int64)
    for place, number in enumerate(order):
        behind = np.round(counts * (place + 0.5) / count - given, 9)
        k = int(np.argmax(np.where(given < counts, behind, -np.inf)))
        given[k] += 1
        found[number] = k
    return found
