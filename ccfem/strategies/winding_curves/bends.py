"""Smoothing of closed curves, only where they bend too sharply."""

import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter1d

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import resample

_STEP = 0.5
"""Distance between points, mm."""
_ROUNDS = 600
_SLACK, _LEFT = 1.05, 0.01
"""Smoothing stops when at most this share of points bends by more than this times the limit."""
_SPREAD = np.exp(-0.5 * (np.arange(-8, 9) / 2.0) ** 2)
"""Gaussian, a millimetre in standard deviation, over which the movement fades out."""


def limit_bends(curve: FloatArray, largest: float, smoothing: float = 0.5) -> FloatArray:
    """Smooth a closed curve where its curvature is above a limit.

    Points there move against the fourth differences of the curve. This reduces bends and, unlike
    second differences, hardly shortens the curve.

    Parameters
    ----------
    curve : (n, 3) array, mm
        Its last point is its first.
    largest : float, 1/mm
        Curvature.
    smoothing : float, mm, default 0.5
        Standard deviation of a Gaussian filter applied first, since crossings with triangle edges
        are unevenly spaced.

    Returns
    -------
    (m, 3) array
        Closed, in steps of half a millimetre; near the surface, but no longer on it.
    """
    points, _ = resample(curve, np.array([0, len(curve)]), _STEP)
    if len(points) < 12:
        return points
    points = points[:-1]
    if smoothing > 0.0:
        points = gaussian_filter1d(points, smoothing / _STEP, axis=0, mode="wrap")
    points = _straightened(np.ascontiguousarray(points), largest, _SPREAD / _SPREAD.sum(), _ROUNDS)
    return np.vstack([points, points[:1]])


@njit(cache=True, nogil=True)
def _straightened(  # type: ignore[no-untyped-def]
    points, largest, spread, rounds
):  # pragma: no cover, compiled
    """Points of a closed curve after a number of rounds, or once its bends are small enough."""
    n, half = len(points), len(spread) // 2
    over, wide, step = np.zeros(n), np.zeros(n + 2 * half), np.zeros((n, 3))
    for _ in range(rounds):
        sharp = 0
        for k in range(n):
            before, after, dot = 0.0, 0.0, 0.0
            for i in range(3):
                one = points[k, i] - points[k - 2, i]
                two = points[(k + 2) % n, i] - points[k, i]
                before += one * one
                after += two * two
                dot += one * two
            before, after = np.sqrt(before), np.sqrt(after)
            square = max((before * after) ** 2 - dot * dot, 0.0)
            bend = np.sqrt(square) / max(before * after, 1e-9) / (0.5 * (before + after))
            over[k] = min(max(bend / largest - 1.0, 0.0), 1.0)
            sharp += bend > _SLACK * largest
        if sharp < _LEFT * n:
            break
        for k in range(n):
            wide[half + k] = max(
                over[k - 2], over[k - 1], over[k], over[(k + 1) % n], over[(k + 2) % n]
            )
        for k in range(half):
            wide[k] = wide[n + k]
            wide[half + n + k] = wide[half + k]
        for k in range(n):
            for i in range(3):
                step[k, i] = 0.5 * (points[k - 1, i] + points[(k + 1) % n, i]) - points[k, i]
        for k in range(n):
            much = 0.0
            for j in range(len(spread)):
                much += spread[j] * wide[k + j]
            over[k] = 0.5 * much
        for i in range(3):
            last, first = step[n - 1, i], step[0, i]
            before = last
            for k in range(n):
                own = step[k, i]
                after = first if k == n - 1 else step[k + 1, i]
                points[k, i] += over[k] * (own - 0.5 * (before + after))
                before = own
    return points
