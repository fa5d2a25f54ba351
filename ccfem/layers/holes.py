"""Holes of a layer, found by the patches that their edges lie on."""

from collections.abc import Iterable
from typing import Any

import shapely

from ccfem.errors import InputError
from ccfem.layers.layer import Layer

__all__ = ["holes_on"]


def holes_on(layer: Layer, patches: Iterable[str]) -> list[Any]:
    """Holes of a flat layer whose edge touches one of the patches, as shapely Polygons.

    Raises
    ------
    InputError
        For a patch that the part does not have.
    """
    touched: set[int] = set()
    for name in patches:
        if name not in layer.patches:
            known = ", ".join(sorted(layer.patches)) or "none"
            raise InputError(f"no patch named '{name}' for conformal curves; there are: {known}")
        touched |= set(layer.patches[name].ravel().tolist())
    rings = [shapely.Polygon(layer.plane.points[loop]) for loop in layer.loops if len(loop) > 2]
    loops = [loop for loop in layer.loops if len(loop) > 2]
    return [
        ring
        for ring, loop in zip(rings, loops, strict=True)
        if not ring.exterior.is_ccw and touched & set(loop.tolist())
    ]
