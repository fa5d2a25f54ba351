"""Which groups of points lie in cones: a head above its tip, and what stands round it."""

from itertools import pairwise

import numpy as np
from numba import njit

from ccfem.arrays import BoolArray, FloatArray, IntArray

__all__ = ["groups_in_cones"]


def groups_in_cones(
    tips: FloatArray,
    axes: FloatArray,
    points: FloatArray,
    offsets: IntArray,
    half_angle: float,
    length: float,
) -> BoolArray:
    """Whether a point of a group lies in a cone.

    Parameters
    ----------
    tips, axes : (n, 3) arrays, mm
        Tips of the cones, and unit vectors along which they open.
    points : (p, 3) array, mm
        Group after group.
    offsets : (g + 1,) int array
        Where each group begins, and the last one ends.
    half_angle : float, degrees
        Below 90.
    length : float, mm
        Height of the cones.

    Returns
    -------
    (n, g) bool array
    """
    groups = [points[a:b] for a, b in pairwise(offsets.tolist())]
    low = np.array([each.min(axis=0) if len(each) else np.full(3, np.inf) for each in groups])
    high = np.array([each.max(axis=0) if len(each) else np.full(3, np.inf) for each in groups])
    return np.asarray(
        _in_cones(
            *(np.ascontiguousarray(each, dtype=np.float64) for each in (tips, axes, points)),
            np.ascontiguousarray(offsets, dtype=np.int64),
            low.reshape(-1, 3),
            high.reshape(-1, 3),
            float(np.tan(np.radians(half_angle))),
            length,
        )
    )


@njit(cache=True, nogil=True)
def _in_cones(  # type: ignore[no-untyped-def]
    tips, axes, points, offsets, low, high, slope, length
):  # pragma: no cover, compiled
    """Do the same number by number, slope radius over height: boxes round groups first."""
    found = np.zeros((len(tips), len(offsets) - 1), dtype=np.bool_)
    reach = length * length * (1.0 + slope * slope)
    for k in range(len(tips)):
        for g in range(len(offsets) - 1):
            away = 0.0
            for d in range(3):
                off = max(low[g, d] - tips[k, d], tips[k, d] - high[g, d], 0.0)
                away += off * off
            if not away < reach:
                continue
            for p in range(offsets[g], offsets[g + 1]):
                a = points[p, 0] - tips[k, 0]
                b = points[p, 1] - tips[k, 1]
                c = points[p, 2] - tips[k, 2]
                up = a * axes[k, 0] + b * axes[k, 1] + c * axes[k, 2]
                if up <= 0.0 or up > length:
                    continue
                if a * a + b * b + c * c < up * up * (1.0 + slope * slope):
                    found[k, g] = True
                    break
    return found
