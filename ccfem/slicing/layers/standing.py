"""Orientation in which a part of curved layers is printed."""

from collections.abc import Sequence

import numpy as np

from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.slicing.layers.slicer import Vector

_DOWN = 1e-3
"""Share of the layers' area that may face downwards."""


def standing(layers: Sequence[Layer], build: Vector) -> Vector:
    """Choose the unit vector along which layers are stacked on a bed.

    Layers that face downwards can be printed by no head that stands over them, and rest on no
    support. If layers do, as seen along the build direction, the part is rotated so that their mean
    normal points up, as Kipping and Schueppstuhl 2023 do with all parts (section 2.3). Flat layers
    stay as they are.

    Parameters
    ----------
    build : tuple of 3 floats
        Build direction.
    """
    up = np.asarray(build, dtype=np.float64) / np.linalg.norm(build)
    area = np.concatenate([layer.areas for layer in layers])
    normals = np.concatenate([layer.normals for layer in layers])
    curved = curved_layers(layers)
    mean = area @ normals
    size = float(np.linalg.norm(mean))
    if curved and area[normals @ up < 0.0].sum() > _DOWN * area.sum() and size > 0.0:
        up = mean / size
    x, y, z = up.tolist()
    return (x, y, z)
