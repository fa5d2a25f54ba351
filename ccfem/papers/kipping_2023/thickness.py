"""Distance of layers, on their triangles alone: from each to the plane of the one below."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.slicing.layers.layer import Layer

_REACH = 8
"""So many layers below are looked at."""
_FARTHEST = 1.0
"""Distance, mm, twice the thickest layer, from which on nothing is below: an island begins."""
_AT_BORDER = 0.03
"""Share by which the nearest point may lie aside of the foot on its plane: else it is a border."""


@dataclass(frozen=True)
class Distances:
    """Distance, mm, of the middle of triangles from the layer below, and their areas, mm^2.

    Triangles with nothing below are left out; `covered` is the share of the area that is not.
    """

    distance: FloatArray
    area: FloatArray
    covered: float

    @property
    def mean(self) -> float:
        """Mean by area, mm."""
        return float(np.average(self.distance, weights=self.area))

    def within(self, least: float, most: float) -> float:
        """Share of the area with a distance in a range, mm."""
        inside = (self.distance >= least) & (self.distance <= most)
        return float(self.area[inside].sum() / self.area.sum())


def distances_below(layers: Sequence[Layer], judged: Sequence[bool] | None = None) -> Distances:
    """Measure the distance of all layers, or of those that are judged, from those below."""
    distances, areas = [], []
    for k, layer in enumerate(layers[1:], 1):
        if judged is not None and not judged[k]:
            continue
        middle = layer.points[layer.triangles].mean(axis=1)
        nearest = np.full(len(middle), np.inf)
        for below in layers[max(0, k - _REACH) : k]:
            low, high = below.points.min(axis=0), below.points.max(axis=0)
            near = ((middle > low - _FARTHEST) & (middle < high + _FARTHEST)).all(axis=1)
            if not near.any():
                continue
            foot = nearest_on_triangles(below.points, below.triangles, middle[near])
            corners = below.points[below.triangles[foot.triangle]]
            off = middle[near] - np.einsum("kc,kcd->kd", foot.weights, corners)
            plane = np.abs(np.einsum("kd,kd->k", off, below.normals[foot.triangle]))
            inside = foot.distance - plane < _AT_BORDER * foot.distance + 1e-3
            nearest[near] = np.minimum(nearest[near], np.where(inside, plane, np.inf))
        distances.append(nearest)
        areas.append(layer.areas)
    distance, area = np.concatenate(distances), np.concatenate(areas)
    known = distance < _FARTHEST
    return Distances(distance[known], area[known], float(area[known].sum() / area.sum()))
