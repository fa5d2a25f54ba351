"""Layers that repeat others: the same paths in the same section, at another height."""

import hashlib
from collections.abc import Hashable, Sequence

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.geometry.shapes import corners_only
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import SAME_DECIMALS, Layer, Plane


def repeated_layers(
    toolpaths: Toolpaths, layers: Sequence[Layer], more: Sequence[Hashable] | None = None
) -> IntArray:
    """Position of the first layer that each one repeats, (n,); its own where it repeats none.

    Curved layers repeat none. What `more` says of each layer has to be the same too.
    """
    source, known = np.arange(len(layers)), dict[Hashable, int]()
    for k, layer in enumerate(layers):
        if layer.flat is not None:
            about = (corners_only(layer.plane.polygon), more[k] if more else None)
            source[k] = known.setdefault(
                (_digest(toolpaths.on_layer(layer.index), layer.flat), *about), k
            )
    return source


def _digest(paths: Toolpaths, plane: Plane) -> bytes:
    """Digest of the paths in a plane, in its frame."""
    digest = hashlib.sha256(plane.frame.tobytes())
    places = paths.points @ plane.frame.T - [0.0, 0.0, plane.height]
    for column in (
        places.round(SAME_DECIMALS) + 0.0,
        paths.offsets,
        paths.kind,
        paths.closed,
        paths.link,
    ):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.digest()
