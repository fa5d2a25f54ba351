"""Number of isocurves that fit, and its search [Chen et al. 2021, section 4.3, Eq. 7]."""

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import dijkstra

from ccfem.base.arrays import FloatArray
from ccfem.geometry.isocontours import Isocontours, isocontours, least_distance
from ccfem.paths.fields.layer_elements import Surface


def levels_at(surface: Surface, values: FloatArray, count: int) -> Isocontours:
    """Isocurves at `count` levels, half a step from the extremes [Chen et al. 2021, Eq. 7]."""
    first, step = _levels(values, count)
    return isocontours(surface.points, surface.triangles, values, first, step, surface.edges)


def unit_levels(surface: Surface, values: FloatArray) -> Isocontours:
    """Isocurves at unit steps, as many as fit, equally far from both extremes.

    The curves are therefore the same for a field and for its negative.
    """
    low, high = float(values.min()), float(values.max())
    count = int(np.floor(high - low + 0.5))
    first = 0.5 * (low + high) - 0.5 * (count - 1)
    return isocontours(surface.points, surface.triangles, values, first, 1.0, surface.edges)


def extract_levels(surface: Surface, values: FloatArray, width: float) -> Isocontours:
    """Extract the largest number of isocurves whose neighbours are more than a width apart.

    The number starts at `start_count` and grows while the smallest distance between neighbouring
    isocurves exceeds the width. Then it falls one by one until the distance exceeds the width
    again. A number is first checked on single triangles that two levels cross, and all distances
    are computed only if it passes: this changes the cost, not the result.

    Parameters
    ----------
    values : (n,) array
        The scalar field.
    width : float, mm
        W.

    Returns
    -------
    Isocontours
        Empty if not even one isocurve fits. "Neighbours" are curves of levels i and i + 1; branches
        of the same level may come nearer to each other.
    """
    if not np.ptp(values) > 0.0:
        return levels_at(surface, np.zeros(len(values)), 1)
    steepness = np.hypot(*surface.gradient(values).T)
    usable = (surface.areas > 0.0) & (steepness > 0.0)
    corners, steepness = values[surface.triangles[usable]], steepness[usable]
    low, high = corners.min(axis=1), corners.max(axis=1)

    def apart(count: int) -> float:
        first, step = _levels(values, count)
        twice = np.floor((high - first) / step) > np.ceil((low - first) / step)
        least = float((step / steepness[twice]).min(initial=np.inf))
        if least <= width:
            return least
        return least_distance(levels_at(surface, values, count), 2.0 * width, width)

    count = start_count(surface, values, width)
    distance = apart(count)
    while distance > width:
        count = int(np.ceil(count * distance / width))
        distance = apart(count)
    while count > 1 and not distance > width:
        count -= 1
        distance = apart(count)
    return levels_at(surface, values, count)


def start_count(surface: Surface, values: FloatArray, width: float) -> int:
    """Distance along mesh edges from the smallest to the largest value, in widths (Dijkstra).

    If the surface has several parts: to the farthest point of the part with the smallest value.
    """
    edges, n = surface.edges[0], len(surface.points)
    length = np.linalg.norm(surface.points[edges[:, 0]] - surface.points[edges[:, 1]], axis=1)
    graph = sparse.coo_array((length, edges.T), shape=(n, n)).tocsr()
    distance = dijkstra(graph, directed=False, indices=int(np.argmin(values)))
    highest = distance[int(np.argmax(values))]
    if not np.isfinite(highest):
        highest = distance[np.isfinite(distance)].max()
    return max(int(np.ceil(highest / width)), 1)


def _levels(values: FloatArray, count: int) -> tuple[float, float]:
    low, step = float(values.min()), float(np.ptp(values)) / count
    return low + 0.5 * step, step if step > 0.0 else 1.0
