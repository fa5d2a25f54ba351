"""Weighted averages over a ball round each of many points, and the transposed operation."""

from typing import NamedTuple

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray

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
    boxes = _boxes(points, radius)
    order, result = boxes.order, np.zeros((len(judged), values.shape[1]))
    _average(
        points[order], values[order], weights[order], points[judged], boxes.number[judged],
        boxes.offsets, boxes.shape, radius, result,
    )  # fmt: skip
    return result


def ball_shares(
    points: FloatArray, values: FloatArray, weights: FloatArray, judged: IntArray, radius: float
) -> FloatArray:
    """Apply the transpose of `ball_averages`: turn derivatives by averages into those by values.

    Parameters
    ----------
    points, weights, judged, radius
        As there.
    values : (k, c) array
        Derivatives by the averages of the judged points.

    Returns
    -------
    (n, c) array
        Derivatives by the values of all points.
    """
    boxes = _boxes(points, radius)
    order, spread = boxes.order, np.zeros((len(points), values.shape[1]))
    _share(
        points[order], weights[order], points[judged], boxes.number[judged], boxes.offsets,
        boxes.shape, radius, values, spread,
    )  # fmt: skip
    result = np.empty_like(spread)
    result[order] = spread
    return result


class _Boxes(NamedTuple):
    """Points in boxes of a grid: order, number of the box of each, where each box begins."""

    order: IntArray
    number: IntArray
    offsets: IntArray
    shape: IntArray


def _boxes(points: FloatArray, size: float) -> _Boxes:
    """Sort points into boxes of a given size, with a margin of empty boxes on every side."""
    first = points.min(axis=0)
    box = np.floor((points - first) / size).astype(np.int64) + 1
    shape = box.max(axis=0) + 2
    number = (box[:, 0] * shape[1] + box[:, 1]) * shape[2] + box[:, 2]
    order = np.argsort(number, kind="stable")
    offsets = np.searchsorted(number[order], np.arange(int(np.prod(shape)) + 1))
    return _Boxes(order, number, offsets, shape)


@njit(cache=True)
def _average(points, values, weights, centres, box, offsets, shape, radius, result):  # type: ignore[no-untyped-def]  # pragma: no cover
    columns = values.shape[1]
    for k in range(len(centres)):
        weight = 0.0
        for i in range(-1, 2):
            for j in range(-1, 2):
                row = box[k] + (i * shape[1] + j) * shape[2]
                for p in range(offsets[row - 1], offsets[row + 2]):
                    if _near(points, p, centres, k, radius):
                        for c in range(columns):
                            result[k, c] += weights[p] * values[p, c]
                        weight += weights[p]
        for c in range(columns):
            result[k, c] /= weight


@njit(cache=True)
def _share(points, weights, centres, box, offsets, shape, radius, values, result):  # type: ignore[no-untyped-def]  # pragma: no cover
    columns = values.shape[1]
    inside = np.empty(len(points), np.int64)
    for k in range(len(centres)):
        weight, count = 0.0, 0
        for i in range(-1, 2):
            for j in range(-1, 2):
                row = box[k] + (i * shape[1] + j) * shape[2]
                for p in range(offsets[row - 1], offsets[row + 2]):
                    if _near(points, p, centres, k, radius):
                        inside[count] = p
                        count += 1
                        weight += weights[p]
        for q in range(count):
            share = weights[inside[q]] / weight
            for c in range(columns):
                result[inside[q], c] += share * values[k, c]


@njit(cache=True)
def _near(points, p, centres, k, radius):  # type: ignore[no-untyped-def]  # pragma: no cover
    x = points[p, 0] - centres[k, 0]
    y = points[p, 1] - centres[k, 1]
    z = points[p, 2] - centres[k, 2]
    return x * x + y * y + z * z <= radius * radius
