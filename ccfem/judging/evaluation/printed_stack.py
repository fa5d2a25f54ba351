"""A stack of curved layers as points, in the order in which they are printed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.slicing.layers.layer import Layer, curved_layers

COARSE = 2.0
"""Distance, mm, between points that represent printed material, and between fibre samples."""


@dataclass(frozen=True)
class Printed:
    """Points of all layers, those of the first ones first.

    Attributes
    ----------
    points : (n, 3) array, mm
    index : (n,) int array
        Of the layer.
    build : (3,) array
        Unit vector.
    """

    points: FloatArray
    index: FloatArray
    build: FloatArray


def printed(layers: Sequence[Layer], build: Sequence[float] | None = None) -> Printed | None:
    """Sample a stack of layers; None where all are flat.

    Parameters
    ----------
    build : sequence of 3 floats, optional
        Build direction; by default the mean normal of the layers.
    """
    if not curved_layers(layers):
        return None
    stack = sorted(layers, key=lambda layer: layer.index)
    points = [np.concatenate([k.points, k.points[k.triangles].mean(axis=1)]) for k in stack]
    index = np.repeat(
        [layer.index for layer in stack], [len(layer_points) for layer_points in points]
    )
    every = np.concatenate(points)
    # Keep the point of each cube that is printed first.
    _, first = np.unique(np.floor(every / COARSE).astype(np.int64), axis=0, return_index=True)
    first = np.sort(first)
    up = np.zeros(3)
    if build is None:
        for layer in stack:
            up += layer.areas @ layer.normals
    else:
        up += np.asarray(build, dtype=np.float64)
    size = float(np.linalg.norm(up))
    up = up / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    return Printed(np.ascontiguousarray(every[first]), index[first].astype(np.float64), up)
