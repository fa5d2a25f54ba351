"""Mirror symmetry of plane regions."""

from typing import NamedTuple

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import Region

_ALIKE = 1e-3
"""Share of its area by which a symmetric region may differ from its mirror image."""
_EQUAL = 1e-3
"""Relative difference of principal moments of inertia below which they define no axis."""
_STEPS = 24
"""Number of directions that are then tried, over half a turn."""


class Mirror(NamedTuple):
    """A line in the plane: a point on it, (2,), mm, and its direction, (2,), a unit vector."""

    point: FloatArray
    direction: FloatArray


def mirrors_of(region: Region) -> tuple[int, ...]:
    """Find the axes, 0 for x and 1 for y, along which a region equals its mirror image.

    The mirror passes through the middle of its extent.
    """
    axes = []
    for axis in (0, 1):
        image = shapely.transform(region, lambda p, a=axis: mirror_image(p, region, a))
        if shapely.symmetric_difference(region, image).area <= _ALIKE * region.area:
            axes.append(axis)
    return tuple(axes)


def mirror_image(points: FloatArray, region: Region, axis: int) -> FloatArray:
    """Points (n, 2) mirrored along an axis about the middle of a region's extent."""
    image = np.array(points)
    image[:, axis] = region.bounds[axis] + region.bounds[2 + axis] - image[:, axis]
    return image


def mirror_lines(region: Region) -> tuple[Mirror, ...]:
    """Find lines through the centroid, at most two, in which a region equals its mirror image.

    They are principal axes of inertia. If both moments are equal, as for a square or a gear, lines
    every 7.5 degrees from the border points farthest from and nearest to the centroid are tried
    instead.
    """
    if region.is_empty or not region.area > 0.0:
        return ()
    centre = shapely.get_coordinates(shapely.centroid(region))[0]
    xx, yy, xy = _moments(shapely.transform(region, lambda points: points - centre))
    apart = np.hypot(xx - yy, 2.0 * xy)
    if apart > _EQUAL * (xx + yy):
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        # A section along the axes of the plane is so to the last digit.
        angle = 0.0 if abs(np.sin(2.0 * angle)) < _EQUAL else angle
        angles = angle + np.array([0.0, 0.5 * np.pi])
    else:
        border = shapely.get_coordinates(region) - centre
        away = np.linalg.norm(border, axis=1)
        x, y = border[[np.argmax(away), np.argmin(away)]].T
        angles = (np.arctan2(y, x)[:, None] + np.pi * np.arange(_STEPS) / _STEPS).ravel()
    mirrors: list[Mirror] = []
    for angle in angles:
        along = np.array([np.cos(angle), np.sin(angle)]).round(15)
        mirror = Mirror(_middle(region, centre, along), along)
        if len(mirrors) == 2:
            break
        image = shapely.transform(region, lambda points, m=mirror: reflected(points, m))
        across = all(abs(other.direction @ mirror.direction) < 1e-6 for other in mirrors)
        if across and shapely.symmetric_difference(region, image).area <= _ALIKE * region.area:
            mirrors.append(mirror)
    return tuple(mirrors)


def _middle(region: Region, centre: FloatArray, along: FloatArray) -> FloatArray:
    """Point on a line through the centroid; for a line along x or y, the middle of the extent."""
    left, bottom, right, top = region.bounds
    box = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
    return np.where(along == 0.0, box, centre) if (along == 0.0).any() else centre


def reflected(points: FloatArray, mirror: Mirror) -> FloatArray:
    """Points (n, 2) mirrored at a line."""
    away = points - mirror.point
    along = (away @ mirror.direction)[:, None] * mirror.direction
    return np.asarray(mirror.point + 2.0 * along - away)


def _moments(region: Region) -> tuple[float, float, float]:
    """Integrals of x x, y y and x y over a region, mm^4."""
    total = np.zeros(3)
    for part in shapely.get_parts(region):
        for k, ring in enumerate((part.exterior, *part.interiors)):
            x, y = shapely.get_coordinates(ring).T
            cross = x[:-1] * y[1:] - x[1:] * y[:-1]
            ahead_x, ahead_y = np.roll(x, -1)[:-1], np.roll(y, -1)[:-1]
            x, y = x[:-1], y[:-1]
            sums = np.array(
                [
                    cross @ (x * x + x * ahead_x + ahead_x * ahead_x) / 12.0,
                    cross @ (y * y + y * ahead_y + ahead_y * ahead_y) / 12.0,
                    cross @ (2.0 * (x * y + ahead_x * ahead_y) + x * ahead_y + ahead_x * y) / 24.0,
                ]
            )
            # Holes count less, whichever way their rings go round.
            total += np.sign(cross.sum()) * (1.0 if k == 0 else -1.0) * sums
    return float(total[0]), float(total[1]), float(total[2])
