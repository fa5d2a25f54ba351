"""Which way up a part of curved layers is printed."""

from collections.abc import Sequence

import numpy as np

from ccfem.layers.layer import Layer
from ccfem.layers.slicer import Vector

__all__ = ["standing"]

_DOWN = 1e-3
"""Share of the layers' area that may look down."""


def standing(layers: Sequence[Layer], build: Vector) -> Vector:
    """Choose the direction, of length 1, in which layers are stacked on a bed.

    Layers that look down can be printed by no head that stands over them, and rest on no support.
    Where layers do, as seen along the build direction, the part is stood up along their mean
    normal, as Kipping and Schueppstuhl 2023 do with all (section 2.3). Flat layers stay as they
    are.

    Parameters
    ----------
    layers : sequence of Layer
    build : tuple of 3 floats
        Build direction.
    """
    up = np.asarray(build, dtype=np.float64) / np.linalg.norm(build)
    area = np.concatenate([layer.areas for layer in layers])
    normals = np.concatenate([layer.normals for layer in layers])
    curved = any(layer.flat is None for layer in layers)
    mean = area @ normals
    size = float(np.linalg.norm(mean))
    if curved and area[normals @ up < 0.0].sum() > _DOWN * area.sum() and size > 0.0:
        up = mean / size
    x, y, z = up.tolist()
    return (x, y, z)
