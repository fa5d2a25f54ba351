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
    boxes, result = _boxes(points, weights, radius), np.zeros((len(judged), values.shape[1]))
    _average(boxes, values[boxes.order], points[judged], boxes.number[judged], result)
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
    boxes, spread = _boxes(points, weights, radius), np.zeros((len(points), values.shape[1]))
    _share(boxes, points[judged], boxes.number[judged], values, spread)
    result = np.empty_like(spread)
    result[boxes.order] = spread
    return result


class _Boxes(NamedTuple):
    """Points in boxes of a grid, whose size is the radius of the ball.

    `points` (n, 3), mm, and `weights` (n,) in the order of the boxes, `order` (n,); `number` (n,)
    of the box of each in the order that they were given in; `offsets` where each box begins;
    `shape` (3,), boxes along each axis, numbered with the last axis fastest.
    """

    points: FloatArray
    weights: FloatArray
    order: IntArray
    number: IntArray
    offsets: IntArray
    shape: IntArray
    radius: float


def _boxes(points: FloatArray, weights: FloatArray, size: float) -> _Boxes:
    """Sort points into boxes of a given size, with a margin of empty boxes on every side."""
    first = points.min(axis=0)
    box = np.floor((points - first) / size).astype(np.int64) + 1
    shape = box.max(axis=0) + 2
    number = (box[:, 0] * shape[1] + box[:, 1]) * shape[2] + box[:, 2]
    order = np.argsort(number, kind="stable")
    offsets = np.searchsorted(number[order], np.arange(int(np.prod(shape)) + 1))
    return _Boxes(points[order], weights[order], order, number, offsets, shape, float(size))


@njit(cache=True)
def _points_in_ball(
    boxes: _Boxes, centre: FloatArray, box: int, inside: IntArray
) -> int:  # pragma: no cover
    """Write the points in the ball round a centre, which lies in a box; return their number."""
    points, shape, offsets = boxes.points, boxes.shape, boxes.offsets
    count, square = 0, boxes.radius * boxes.radius
    for i in range(-1, 2):
        for j in range(-1, 2):
            # The three boxes beside each other along the last axis follow one another.
            row = box + (i * shape[1] + j) * shape[2]
            for p in range(offsets[row - 1], offsets[row + 2]):
                x = points[p, 0] - centre[0]
                y = points[p, 1] - centre[1]
                z = points[p, 2] - centre[2]
                if x * x + y * y + z * z <= square:
                    inside[count] = p
                    count += 1
    return count


@njit(cache=True)
def _average(
    boxes: _Boxes, values: FloatArray, centres: FloatArray, box: IntArray, result: FloatArray
) -> None:  # pragma: no cover
    weights, inside = boxes.weights, np.empty(len(boxes.points), np.int64)
    for k in range(len(centres)):
        weight = 0.0
        for q in range(_points_in_ball(boxes, centres[k], box[k], inside)):
            p = inside[q]
            for c in range(values.shape[1]):
                result[k, c] += weights[p] * values[p, c]
            weight += weights[p]
        for c in range(values.shape[1]):
            result[k, c] /= weight


@njit(cache=True)
def _share(
    boxes: _Boxes, centres: FloatArray, box: IntArray, values: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    weights, inside = boxes.weights, np.empty(len(boxes.points), np.int64)
    for k in range(len(centres)):
        count, weight = _points_in_ball(boxes, centres[k], box[k], inside), 0.0
        for q in range(count):
            weight += weights[inside[q]]
        for q in range(count):
            share = weights[inside[q]] / weight
            for c in range(values.shape[1]):
                result[inside[q], c] += share * values[k, c]
