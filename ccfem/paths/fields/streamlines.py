"""Streamlines of the in-plane principal stress of largest absolute value."""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.base.compiled import compiled
from ccfem.base.tensor import strongest_in_plane
from ccfem.geometry.facets import paired
from ccfem.geometry.locate import locate

_LONGEST = 10.0
"""Length, in diagonals of the points, at which a line stops in either sense."""

_SHARPEST = 0.5
"""Least cosine of the turn of the direction within one step: a line that turns by more than 60
degrees has changed to the other family of principal directions."""

_SKEW = 0.37
"""Share of a triangle's second side beside its first in the sense of a line. In regular meshes
stress is often across sides and sums of them in simple ratios, where rounding would choose."""

_RARE = 0.05
"""Share of the area that may have a higher stress than the one used as a measure."""


def streamlines(
    points: FloatArray,
    triangles: IntArray,
    plane_stress: FloatArray,
    starts: FloatArray,
    step: float,
    least: float = 0.02,
) -> list[FloatArray]:
    """Lines that follow the principal stress of largest absolute value.

    Runge-Kutta method of fourth order, in both senses from each start; the sign is that of the
    previous step. The direction is that of the linearly interpolated stress, in double-angle form.
    Eigenvectors are never averaged, and where the larger of tension and compression changes, the
    direction jumps within a triangle.

    Parameters
    ----------
    points : (n, 2) array, mm
    triangles : (t, 3) int array
    plane_stress : (n, 3) array, MPa
        s11, s22, s12 at the points.
    starts : (k, 2) array, mm
        Starts outside the triangles give an empty line.
    step : float, mm
        Length of a step.
    least : float in [0, 1), default 0.02
        A line stops where the difference of the two principal stresses, or the larger of their
        absolute values, is below this share of the value that a twentieth of the area exceeds. The
        peak at a point load, which grows with mesh refinement, therefore has no influence.

    Returns
    -------
    list of (m, 2) arrays, mm
        From one end to the other; m = 0 if there is no direction at the start. A line that returns
        to its start within one step is closed: its last point is its first. Other lines end inside
        the triangles, less than a step from the border that they would cross.
    """
    check_number("step of streamlines", step, above=0.0, unit="mm")
    starts = np.asarray(starts, dtype=np.float64).reshape(-1, 2)
    if not len(starts) or not len(triangles):
        return [np.zeros((0, 2)) for _ in starts]
    field = line_field(points, triangles, plane_stress, least)
    diagonal = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))
    steps = int(np.ceil(_LONGEST * diagonal / step))
    home, _ = locate(points, triangles, starts, 1e-6)
    lines = []
    for start, cell in zip(starts, home, strict=True):
        if cell < 0:
            lines.append(np.zeros((0, 2)))
            continue
        ahead, closed = _follow_field(field, start, cell, step, steps, 1)
        if closed:
            lines.append(np.concatenate([ahead, ahead[:1]]))
            continue
        back, _ = _follow_field(field, start, cell, step, steps, -1)
        line = np.concatenate([back[:0:-1], ahead])
        lines.append(line if len(line) > 1 else line[:0])
    return lines


class LineField(NamedTuple):
    """Plane stress on triangles, in the form that the compiled loops use.

    Attributes
    ----------
    corners : (t, 3, 2) array, mm
    values : (t, 3, 3) array, MPa
        Mean, half the difference and shear of the stress at the corners: linear in the stress.
    beside : (t, 3) int array
        Triangle across the side opposite to each corner, -1 at the border.
    least : float, MPa
        There is no direction where the difference of the principal stresses, or the larger of their
        absolute values, is below this.
    """

    corners: FloatArray
    values: FloatArray
    beside: IntArray
    least: float


def line_field(
    points: FloatArray, triangles: IntArray, plane_stress: FloatArray, least: float
) -> LineField:
    """Prepare the stress at the points of triangles; parameters as in `streamlines`."""
    s11, s22, s12 = plane_stress.T
    values = np.stack([0.5 * (s11 + s22), 0.5 * (s11 - s22), s12], axis=1)
    sides = triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
    one, other = paired(sides)[0].T
    beside = np.full(len(sides), -1, dtype=np.int64)
    beside[one], beside[other] = other // 3, one // 3
    corners = points[triangles]
    return LineField(
        np.ascontiguousarray(corners),
        np.ascontiguousarray(values[triangles]),
        beside.reshape(-1, 3),
        least * _usual_size(corners, plane_stress[triangles].mean(axis=1)),
    )


def _usual_size(corners: FloatArray, plane_stress: FloatArray) -> float:
    """Absolute principal stress that `_RARE` of the area of triangles exceeds, MPa."""
    size = np.abs(strongest_in_plane(plane_stress)[0])
    a, b = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    order = np.argsort(size, kind="stable")
    area = np.cumsum(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[order])
    return float(size[order[np.searchsorted(area, (1.0 - _RARE) * area[-1])]])


@compiled
def direction_at(
    field: LineField, cell: int, x: float, y: float, sharpest: float, way: FloatArray
) -> tuple[float, float, int, bool]:
    """Return the unit direction at (x, y), the triangle there, and whether there is one.

    The triangle is found by walking from `cell`. `way` is the previous direction, which sets the
    sign, and `sharpest` the least cosine of the turn from it: -1 at the start.
    """
    corners, values, beside, least = field
    for _ in range(len(corners)):
        a, b, c = corners[cell, 0], corners[cell, 1], corners[cell, 2]
        # Barycentric coordinates; the walk goes on across the side that the place is farthest
        # beyond.
        det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        w1 = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / det
        w2 = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / det
        w0 = 1.0 - w1 - w2
        worst = 0
        lowest = w0
        if w1 < lowest:
            worst, lowest = 1, w1
        if w2 < lowest:
            worst, lowest = 2, w2
        if lowest >= -1e-9:
            break
        cell = beside[cell, worst]
        if cell < 0:
            return 0.0, 0.0, cell, False
    # Stress there: mean + radius and mean - radius are the principal stresses.
    v = values[cell]
    mean = w0 * v[0, 0] + w1 * v[1, 0] + w2 * v[2, 0]
    half = w0 * v[0, 1] + w1 * v[1, 1] + w2 * v[2, 1]
    shear = w0 * v[0, 2] + w1 * v[1, 2] + w2 * v[2, 2]
    radius = np.sqrt(half * half + shear * shear)
    if 2.0 * radius < least or abs(mean) + radius < least or radius == 0.0:
        return 0.0, 0.0, cell, False
    if mean < 0.0:
        half, shear = -half, -shear
    # Half the angle of (half, shear), by roots: the larger component first avoids cancellation.
    if half >= 0.0:
        dx = np.sqrt(0.5 * (1.0 + half / radius))
        dy = 0.5 * shear / (radius * dx)
    else:
        dy = np.sqrt(0.5 * (1.0 - half / radius))
        dx = 0.5 * shear / (radius * dy)
        if dx < 0.0:
            dx, dy = -dx, -dy
    along = dx * way[0] + dy * way[1]
    if along < 0.0:
        dx, dy, along = -dx, -dy, -along
    return dx, dy, cell, along >= sharpest


@compiled
def streamline_step(
    field: LineField, cell: int, x: float, y: float, step: float, way: FloatArray
) -> tuple[float, float, int, bool]:
    """Point one step on, the triangle there, and whether there is one; updates `way`."""
    h = 0.5 * step
    ax, ay, cell, fine = direction_at(field, cell, x, y, _SHARPEST, way)
    if not fine:
        return x, y, cell, False
    way[0], way[1] = ax, ay
    bx, by, near, fine = direction_at(field, cell, x + h * ax, y + h * ay, _SHARPEST, way)
    if not fine:
        return x, y, cell, False
    cx, cy, near, fine = direction_at(field, near, x + h * bx, y + h * by, _SHARPEST, way)
    if not fine:
        return x, y, cell, False
    ex, ey, near, fine = direction_at(field, near, x + step * cx, y + step * cy, _SHARPEST, way)
    if not fine:
        return x, y, cell, False
    x += step * (ax + 2.0 * bx + 2.0 * cx + ex) / 6.0
    y += step * (ay + 2.0 * by + 2.0 * cy + ey) / 6.0
    return x, y, near, True


@compiled
def _follow_field(
    field: LineField, start: FloatArray, cell: int, step: float, most: int, sense: int
) -> tuple[FloatArray, bool]:
    """Points (m, 2) from `start` in one sense, and whether they come back to it."""
    line = np.empty((most + 1, 2))
    x, y = start[0], start[1]
    line[0, 0], line[0, 1] = x, y
    # The first sense follows the corners of the triangle, so that it turns with the part.
    a, b, c = field.corners[cell, 0], field.corners[cell, 1], field.corners[cell, 2]
    way = b - a + _SKEW * (c - a)
    dx, dy, cell, fine = direction_at(field, cell, x, y, -1.0, way)
    if not fine:
        return line[:1].copy(), False
    way[0], way[1] = sense * dx, sense * dy
    count = 1
    while count <= most:
        x, y, cell, fine = streamline_step(field, cell, x, y, step, way)
        if not fine:
            break
        line[count, 0], line[count, 1] = x, y
        count += 1
        # Back at the start: closed, without a last point that lies on the first.
        gap = np.sqrt((x - start[0]) ** 2 + (y - start[1]) ** 2)
        if count > 6 and gap < 0.75 * step:
            if gap < 0.5 * step:
                count -= 1
            return line[:count].copy(), True
    return line[:count].copy(), False
