"""Holes of a layer, identified by the patches that their edges lie on."""

from collections.abc import Iterable

import shapely

from ccfem.base.checks import check_known
from ccfem.slicing.layers.layer import Layer


def holes_on(layer: Layer, patches: Iterable[str]) -> list[shapely.Polygon]:
    """Holes of a flat layer whose edge touches one of the patches, as shapely Polygons.

    Raises
    ------
    InputError
        For a patch that the part does not have.
    """
    touched: set[int] = set()
    for name in patches:
        check_known("patch", name, sorted(layer.patches))
        touched |= set(layer.patches[name].ravel().tolist())
    rings = [shapely.Polygon(ring) for ring in layer.plane.rings if len(ring) > 2]
    loops = [loop for loop in layer.loops if len(loop) > 2]
    return [
        ring
        for ring, loop in zip(rings, loops, strict=True)
        if not ring.exterior.is_ccw and touched & set(loop.tolist())
    ]
