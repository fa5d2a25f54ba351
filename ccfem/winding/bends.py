"""Closed curves made smoother where they bend too sharply, and only there."""

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from ccfem.arrays import FloatArray
from ccfem.geometry.polylines import resample

__all__ = ["limit_bends"]

_STEP = 0.5
"""Distance of points, mm."""
_ROUNDS = 200
_SLACK, _LEFT = 1.05, 0.01
"""Done when no more than this share of the points bends by more than this times the limit."""


def limit_bends(curve: FloatArray, largest: float, smoothing: float = 0.5) -> FloatArray:
    """Smooth a closed curve where its curvature is above a limit.

    Points there move against the fourth differences of the curve, which bend it less and, unlike
    second differences, hardly shorten it.

    Parameters
    ----------
    curve : (n, 3) array, mm
        Its last point is its first.
    largest : float, 1/mm
        Curvature.
    smoothing : float, mm, default 0.5
        Standard deviation of a Gaussian filter before that: crossings of triangles' edges do not
        lie evenly.

    Returns
    -------
    (m, 3) array
        Closed, at steps of half a millimetre; of the space near the surface, no longer on it.
    """
    points, _ = resample(curve, np.array([0, len(curve)]), _STEP)
    if len(points) < 12:
        return points
    points = points[:-1]
    if smoothing > 0.0:
        points = gaussian_filter1d(points, smoothing / _STEP, axis=0, mode="wrap")
    for _ in range(_ROUNDS):
        before, after = points - np.roll(points, 2, 0), np.roll(points, -2, 0) - points
        a, b = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
        sine = np.linalg.norm(np.cross(before, after), axis=1) / np.maximum(a * b, 1e-9)
        bend = sine / (0.5 * (a + b))
        if (bend > _SLACK * largest).mean() < _LEFT:
            break
        where = np.clip(bend / largest - 1.0, 0.0, 1.0)
        where = gaussian_filter1d(maximum_filter1d(where, 5, mode="wrap"), 2, mode="wrap")
        off = 0.5 * (np.roll(points, 1, 0) + np.roll(points, -1, 0)) - points
        step = off - 0.5 * (np.roll(off, 1, 0) + np.roll(off, -1, 0))
        points = points + 0.5 * where[:, None] * step
    return np.vstack([points, points[:1]])
