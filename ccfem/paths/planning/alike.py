"""Layers of equal section under alike stress, which are planned once."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.fem.elasticity import PartStress
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, curved_layers

ALIKE = 0.01
"""Root mean square of the difference of alike stress, over that of the stress. Our choice, well
below the error that a solution estimates on the meshes of shipped cases (17 % on the loop)."""

EQUAL = 1e-6
"""Distance, mm, up to which two sections are equal: paths drawn on one are those of the other."""

BORDERS = 1e-3
"""Distance, mm, up to which those of layers that are alike may differ: what is too small for a
triangle is left out at the borders of regions."""

_PATCH = 0.01
"""Share by which the length of a patch along equal sections may differ: chords of round walls."""


def alike_layers(layers: Sequence[Layer], stress: PartStress) -> IntArray:
    """Position of the layer whose paths each layer may take, (n,); its own where no other is alike.

    From the first layer on, those that follow one another with its section, under stress that is
    alike, form a run; the middle one of a run stands for all. Curved layers stand for themselves.
    """
    source = np.arange(len(layers))
    if not layers:
        return source
    first, leading = 0, copy(layers[0])
    for k in range(1, len(layers) + 1):
        same = k < len(layers) and _equal(leading, layers[k])
        if same and _apart(leading, layers[k], stress.nodal) <= ALIKE:
            continue
        source[first:k] = (first + k) // 2
        # What it is searched by fills memory: it goes with the copy.
        first, leading = k, copy(layers[min(k, len(layers) - 1)])
    return source


def equal_sections(one: Layer, other: Layer, distance: float = EQUAL) -> bool:
    """Whether the borders of two flat layers are less than a distance, mm, apart."""
    sections = [layer.plane.polygon for layer in (one, other)]
    if shapely.equals_exact(*sections, tolerance=0.5 * distance):  # corner by corner
        return True
    borders = shapely.boundary(sections)
    # What bounds and areas rule out needs no look at the corners.
    farthest = float(np.abs(np.subtract(*shapely.bounds(sections))).max())
    if farthest >= distance:
        return False
    if abs(np.subtract(*shapely.area(sections))) > 4.0 * distance * shapely.length(borders).sum():
        return False
    return float(shapely.hausdorff_distance(*borders)) < distance


def on_layer(paths: Toolpaths, layer: Layer) -> Toolpaths:
    """Paths of a layer with the same section, drawn on another; those of a curved layer itself."""
    if layer.flat is None:
        return paths
    points = layer.plane.to_space(layer.plane.project(paths.points))
    return replace(paths, points=points, layer=np.full(len(paths), layer.index))


def _equal(one: Layer, other: Layer) -> bool:
    """Whether two flat layers have equal sections, and the same patches along them."""
    if curved_layers((one, other)) or abs(one.thickness - other.thickness) > EQUAL:
        return False
    same = equal_sections(one, other, BORDERS)
    if not np.array_equal(one.plane.frame, other.plane.frame) or not same:
        return False
    a, b = _along_patches(one), _along_patches(other)
    return a.keys() == b.keys() and all(
        abs(a[name] - b[name]) <= _PATCH * max(a[name], b[name]) for name in a
    )


def _along_patches(layer: Layer) -> dict[str, float]:
    """Length, mm, of the border that lies on each patch."""
    ends = {name: layer.points[edges] for name, edges in layer.patches.items() if len(edges)}
    return {
        name: float(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum())
        for name, edges in ends.items()
    }


def _apart(one: Layer, other: Layer, nodal: FloatArray) -> float:
    """Difference of the stress on two layers of equal section, over the stress on the first."""
    middles = other.plane.points[other.triangles].mean(axis=1)
    triangle, weights = one.plane_triangles.locate(middles)
    inside = triangle >= 0
    corners = one.interpolate(nodal)[one.triangles[triangle[inside]]]
    first = np.einsum("tk,tkij->tij", weights[inside], corners)
    second = other.interpolate(nodal)[other.triangles[inside]].mean(axis=1)
    area = other.areas[inside]
    size = float(area @ (first**2).sum(axis=(1, 2)))
    difference = float(area @ ((second - first) ** 2).sum(axis=(1, 2)))
    return float(np.sqrt(difference / size)) if size > 0.0 else float("inf")
