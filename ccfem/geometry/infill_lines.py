"""Lines of sparse infill, clipped to a region; those of all layers of a part fit each other.

Ends of neighbouring lines are joined along the border of the region.
"""

from collections.abc import Sequence

import contourpy
import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import between, line_length
from ccfem.geometry.shapes import Region, open_lines

_STEPS = 32
"""Steps of the grid on which a gyroid is contoured, in a period."""
_OFF = 1e-3
"""Distance, in periods, up to which points of a gyroid's lines are left out."""


def parallel_lines(region: Region, pitch: float, angle: float) -> list[FloatArray]:
    """Parallel lines (k, 2), mm, whose distances from the origin are multiples of a pitch.

    Parameters
    ----------
    region : shapely (Multi)Polygon, mm
    pitch : float, mm
        Distance of the lines, > 0.
    angle : float, radians
        Direction of the lines to the first axis.
    """
    if region.is_empty:
        return []
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    corners = shapely.get_coordinates(region)
    low, high = (corners @ across).min(), (corners @ across).max()
    ends = np.array([(corners @ along).min() - 1.0, (corners @ along).max() + 1.0])
    offsets = pitch * np.arange(np.ceil(low / pitch), np.floor(high / pitch) + 1.0)
    lines = offsets[:, None, None] * across + ends[:, None] * along
    return open_lines(shapely.intersection(shapely.linestrings(lines), region))


def gyroid_lines(region: Region, height: float, period: float) -> list[FloatArray]:
    """Lines (k, 2), mm, in which a plane at a height cuts a gyroid.

    The surface is ``sin x cos y + sin y cos z + sin z cos x = 0`` with coordinates in ``period / 2
    pi`` (Schoen, Infinite periodic minimal surfaces, NASA TN D-5541, 1970, in the usual nodal
    approximation).

    Parameters
    ----------
    region : shapely (Multi)Polygon, mm
    height : float, mm
    period : float, mm
        > 0.
    """
    if region.is_empty:
        return []
    step, turn = period / _STEPS, 2.0 * np.pi / period
    low = np.floor(np.array(region.bounds[:2]) / step) - 1.0
    high = np.ceil(np.array(region.bounds[2:]) / step) + 1.0
    x, y = (step * np.arange(low[k], high[k] + 1.0) for k in (0, 1))
    u, v, w = turn * x[None, :], turn * y[:, None], turn * height
    field = np.sin(u) * np.cos(v) + np.sin(v) * np.cos(w) + np.sin(w) * np.cos(u)
    lines = contourpy.contour_generator(x, y, field).lines(0.0)
    drawn = [shapely.LineString(line) for line in lines if len(line) > 1]
    drawn = shapely.simplify(np.array(drawn, dtype=object), _OFF * period)
    return open_lines(shapely.intersection(drawn, region))


_ON_BORDER = 1e-6
"""Distance from the border of a region, mm, up to which a line ends on it."""


def border_joints(
    lines: Sequence[FloatArray], region: Region, longest: float
) -> list[tuple[int, int, FloatArray]]:
    """Ways along the border of a region that join the ends of lines clipped to it.

    Only ends that follow each other on a ring are joined, the nearest first, so that no way crosses
    a line; none of the lines becomes a ring.

    Parameters
    ----------
    lines : sequence of (n, 2) arrays, mm
    longest : float, mm
        Of a way.

    Returns
    -------
    list of (int, int, (k, 2) array)
        Two ends, of which line k has 2 k and 2 k + 1, and the points between them.
    """
    ends = np.array([line[[0, -1]] for line in lines]).reshape(-1, 2)
    ways: list[tuple[float, int, int, FloatArray]] = []
    for ring in rings(region):
        border, points = shapely.LineString(ring), shapely.points(ends)
        mine = np.flatnonzero(shapely.distance(points, border) < _ON_BORDER)
        place = shapely.line_locate_point(border, points[mine])
        order = np.argsort(place, kind="stable")
        mine, place, whole = mine[order], place[order], line_length(ring)
        twice = np.concatenate([ring[:-1], ring])
        for k in range(len(mine) if len(mine) > 1 else 0):
            following = (k + 1) % len(mine)
            start, end = place[k], place[following] + (whole if following <= k else 0.0)
            if end - start <= longest:
                way = between(twice, start, end)[1:-1]
                ways.append((end - start, int(mine[k]), int(mine[following]), way))
    joined = np.arange(len(lines))
    free, joints = np.ones(len(ends), dtype=bool), []
    for _, a, b, way in sorted(ways, key=lambda one: one[:3]):
        if free[a] and free[b] and joined[a // 2] != joined[b // 2]:
            free[[a, b]] = False
            joined[joined == joined[a // 2]] = joined[b // 2]
            joints.append((a, b, way))
    return joints
