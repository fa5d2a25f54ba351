"""Mirror symmetry of plane regions."""

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.geometry.shapes import Region

__all__ = ["mirror_image", "mirrors_of"]

_ALIKE = 1e-3
"""Share of its area by which a symmetric region may differ from its mirror image."""


def mirrors_of(region: Region) -> tuple[int, ...]:
    """Find the axes, 0 for x and 1 for y, along which a region is its own mirror image.

    The mirror goes through the middle of its extent.
    """
    found = []
    for axis in (0, 1):
        image = shapely.transform(region, lambda p, a=axis: mirror_image(p, region, a))
        if shapely.symmetric_difference(region, image).area <= _ALIKE * region.area:
            found.append(axis)
    return tuple(found)


def mirror_image(points: FloatArray, region: Region, axis: int) -> FloatArray:
    """Points (n, 2) mirrored along an axis about the middle of a region's extent."""
    image = np.array(points)
    image[:, axis] = region.bounds[axis] + region.bounds[2 + axis] - image[:, axis]
    return image
