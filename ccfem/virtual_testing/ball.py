"""Averages over a ball about each of many points."""

import numpy as np
from numba import njit

from ccfem.arrays import FloatArray, IntArray

__all__ = ["BALL", "ball_averages"]

BALL = 2.0
"""Radius, mm, of the ball over which stress is averaged."""


def ball_averages(
    points: FloatArray, values: FloatArray, weights: FloatArray, judged: IntArray, radius: float
) -> FloatArray:
    """Weighted averages over the points within a radius of each judged point.

    Parameters
    ----------
    points : (n, 3) array, mm
    values : (n, c) array
    weights : (n,) array
    judged : (k,) int array
        Points whose averages are wanted.
    radius : float, mm

    Returns
    -------
    (k, c) array
    """
    first = points.min(axis=0)
    box = np.floor((points - first) / radius).astype(np.int64) + 1
    shape = box.max(axis=0) + 2
    number = (box[:, 0] * shape[1] + box[:, 1]) * shape[2] + box[:, 2]
    order = np.argsort(number, kind="stable")
    offsets = np.searchsorted(number[order], np.arange(int(np.prod(shape)) + 1))
    return np.asarray(
        _ball(points[order], values[order], weights[order], points[judged], number[judged], offsets,
              shape, radius)
    )  # fmt: skip


@njit(cache=True)
def _ball(points, values, weights, centres, box, offsets, shape, radius):  # type: ignore[no-untyped-def]  # pragma: no cover
    columns = values.shape[1]
    result = np.zeros((len(centres), columns))
    for k in range(len(centres)):
        weight = 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                row = box[k] + (i * shape[1] + j) * shape[2]
                for p in range(offsets[row - 1], offsets[row + 2]):
                    x = points[p, 0] - centres[k, 0]
                    y = points[p, 1] - centres[k, 1]
                    z = points[p, 2] - centres[k, 2]
                    if x * x + y * y + z * z <= radius * radius:
                        for c in range(columns):
                            result[k, c] += weights[p] * values[p, c]
                        weight += weights[p]
        for c in range(columns):
            result[k, c] /= weight
    return result
