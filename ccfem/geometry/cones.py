"""Points in cones: a print head is taken as a cone above its tip."""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, seen_only
from ccfem.base.compiled import compiled

_BLOCK = 32
"""Number of consecutive points with a common bounding sphere, which is checked first."""


def groups_in_cones(
    tips: FloatArray,
    axes: FloatArray,
    points: FloatArray,
    group: IntArray,
    half_angle: float,
    length: float,
) -> BoolArray:
    """Mask (n, g) of the cones that a point of each group lies in.

    Parameters
    ----------
    tips, axes : (n, 3) arrays, mm
        Tips of the cones, and unit vectors along which they open.
    points : (p, 3) array, mm
    group : (p,) int array
        Of each point, ascending from 0. Consecutive points should be near each other for speed.
    half_angle : float, degrees
        Below 90.
    length : float, mm
        Height of the cones.
    """
    count = int(group.max(initial=-1)) + 1
    every = np.full(len(tips), count)
    return _in_cones(tips, axes, every, points, group, half_angle, length, count) >= 0


def earlier_in_cones(
    tips: FloatArray,
    axes: FloatArray,
    when: IntArray,
    points: FloatArray,
    step: IntArray,
    half_angle: float,
    length: float,
) -> IntArray:
    """Point of an earlier step in each cone (n,), -1 where there is none.

    Parameters and rules as in `groups_in_cones`. Only points count whose `step` (p,), ascending, is
    below that of the cone, `when` (n,).
    """
    return _in_cones(tips, axes, when, points, step, half_angle, length, 0)[:, 0]


def _in_cones(
    tips: FloatArray,
    axes: FloatArray,
    when: IntArray,
    points: FloatArray,
    group: IntArray,
    half_angle: float,
    length: float,
    columns: int,
) -> IntArray:
    """Find a point in each cone, of each group, or of all where there are no columns."""
    new = np.diff(group, prepend=-1) != 0
    start = np.maximum.accumulate(np.where(new, np.arange(len(group)), 0))
    first = np.flatnonzero((np.arange(len(group)) - start) % _BLOCK == 0)
    ends = np.append(first, len(group))
    centre, radius = np.zeros((0, 3)), np.zeros(0)
    if len(points):
        size = np.diff(ends)
        centre = np.add.reduceat(points, first) / size[:, None]
        off = np.linalg.norm(points - np.repeat(centre, size, axis=0), axis=1)
        radius = np.maximum.reduceat(off, first)
    half = np.radians(half_angle)
    cones = _Cones(
        seen_only(np.asarray(tips, dtype=np.float64)),
        seen_only(np.asarray(axes, dtype=np.float64)),
        seen_only(np.asarray(when, dtype=np.int64)),
        float(np.cos(half)),
        float(np.sin(half)),
        float(length),
    )
    blocks = _Blocks(
        seen_only(np.asarray(points, dtype=np.float64)),
        ends.astype(np.int64),
        seen_only(np.asarray(group[first], dtype=np.int64)),
        centre,
        radius,
    )
    return np.asarray(_point_in_cones(cones, blocks, columns))


class _Cones(NamedTuple):
    """Tips and unit axes (n, 3), the steps (n,) that count before, half angle and height, mm."""

    tips: FloatArray
    axes: FloatArray
    when: IntArray
    cosine: float
    sine: float
    length: float


class _Blocks(NamedTuple):
    """Points (p, 3) in blocks: their ends (b + 1,), groups (b,) and bounding spheres."""

    points: FloatArray
    ends: IntArray
    group: IntArray
    centre: FloatArray
    radius: FloatArray


@compiled
def _point_in_cones(cones: _Cones, blocks: _Blocks, columns: int) -> IntArray:  # pragma: no cover
    """Point in each cone (n, columns), of each group; or (n, 1), of all, without columns."""
    tips, axes, when, cosine, sine, length = cones
    points, ends, group, centre, radius = blocks
    inside = np.full((len(tips), max(columns, 1)), -1)
    for k in range(len(tips)):
        for b in range(len(group)):
            if group[b] >= when[k]:
                break
            g = group[b] if columns else 0
            if inside[k, g] >= 0:
                continue
            # The sphere of the block first: above and beside the cone, and below its tip.
            up, square = _height_in(tips, axes, k, centre, b)
            if up < -radius[b] or up > length + radius[b]:
                continue
            side = np.sqrt(max(square - up * up, 0.0))
            if side * cosine - up * sine > radius[b]:
                continue
            for p in range(ends[b], ends[b + 1]):
                up, square = _height_in(tips, axes, k, points, p)
                if 0.0 < up <= length and square * cosine * cosine < up * up:
                    inside[k, g] = p
                    break
            if columns == 0 and inside[k, 0] >= 0:
                break
    return inside


@compiled
def _height_in(
    tips: FloatArray, axes: FloatArray, k: int, points: FloatArray, p: int
) -> tuple[float, float]:  # pragma: no cover
    """Height of a point above the tip of a cone, along its axis, and its squared distance."""
    a = points[p, 0] - tips[k, 0]
    b = points[p, 1] - tips[k, 1]
    c = points[p, 2] - tips[k, 2]
    return a * axes[k, 0] + b * axes[k, 1] + c * axes[k, 2], a * a + b * b + c * c
