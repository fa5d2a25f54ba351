"""Curvature of polylines by arc length."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.polylines import inner_points, lengths, resample, turning_angles


def curvature_samples(
    points: FloatArray, offsets: IntArray, closed: BoolArray, step: float
) -> FloatArray:
    """Curvature of polylines at points equally far apart, (s,), 1/mm.

    Parameters
    ----------
    points, offsets
        The polylines, in 2 or 3 dimensions, mm.
    closed : (K,) bool array
        Closed ones are also sampled where they close; the ends of open ones have no curvature.
    step : float, mm
        Wanted distance h of the samples; a polyline of length L gets ``max(1, round(L / h))`` equal
        steps. The curvature is the angle between the chords before and behind a point, over h.
    """
    samples, ends = resample(points, offsets, step)
    count = np.diff(ends)
    angle = turning_angles(samples, ends, closed)
    size = np.repeat(lengths(points, offsets), count) / np.repeat(np.maximum(count - 1, 1), count)
    return np.asarray((angle / size)[inner_points(ends, closed)])
