"""Strands that cross themselves or each other on a layer."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.locate import bucket
from ccfem.geometry.polylines import lengths, starts_segment, subdivide
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths

# Where polylines of the plane cross themselves and each other.


_TOUCH = 1e-9
"""Distance, mm, within which a point lies on a segment."""


def find_crossings(points: FloatArray, offsets: IntArray, closed: BoolArray) -> IntArray:
    """Pairs of segments at which polylines cross from one side of a polyline to the other.

    Counted are proper crossings of two segments, and crossings through points of the polylines: of
    a segment through a point, or of two polylines through a common point. Not counted are ends that
    touch, corners that touch without crossing, and stretches on top of each other. Points within
    1e-9 mm of a segment lie on it.

    Parameters
    ----------
    points : (P, 2) array, mm
        Without repeated neighbouring points.
    offsets : (K + 1,) int array
    closed : (K,) bool array

    Returns
    -------
    (c, 2) int array
        Index of the point that starts each of the two segments, the smaller one first, sorted. A
        crossing through a point names the segments that end at it.
    """
    total = float(lengths(points, offsets).sum())
    if total == 0.0:
        return np.zeros((0, 2), dtype=np.int64)
    extent = points.max(axis=0) - points.min(axis=0)
    # At most one cell a point, so that few points share a cell even if they are dense on a line.
    spread = float(np.sqrt(extent[0] * extent[1] / len(points)))
    longest = max(spread, 2.0 * total / len(points))
    pieces, ends, segment = subdivide(points, offsets, longest)
    first = np.flatnonzero(starts_segment(ends))
    a, b = pieces[first], pieces[first + 1]
    grid = bucket(np.minimum(a, b) - _TOUCH, np.maximum(a, b) + _TOUCH, longest)
    following = np.arange(len(points)) + 1
    following[offsets[1:] - 1] = np.where(closed, offsets[:-1] + 1, -1)
    pairs = np.unique(_near(grid.starts, grid.items, segment[first], points, _TOUCH), axis=0)
    return pairs[_crosses(pairs[:, 0], pairs[:, 1], points, following)]


@compiled
def _near(
    starts: IntArray, items: IntArray, segment: IntArray, points: FloatArray, touch: float
) -> IntArray:
    """Pairs of segments of a cell, not neighbours in their polyline, that meet or nearly do.

    Their boxes overlap, and neither has both ends clearly on one side of the other. A pair is
    listed once for every cell that it shares.
    """
    count = 0
    pairs = np.empty((64, 2), np.int64)
    side = np.empty(4)
    for cell in range(len(starts) - 1):
        for m in range(starts[cell], starts[cell + 1]):
            for n in range(m + 1, starts[cell + 1]):
                i, j = segment[items[m]], segment[items[n]]
                if abs(i - j) < 2:
                    continue
                # Boxes first.
                apart = False
                for d in range(2):
                    low = max(
                        min(points[i, d], points[i + 1, d]), min(points[j, d], points[j + 1, d])
                    )
                    high = min(
                        max(points[i, d], points[i + 1, d]), max(points[j, d], points[j + 1, d])
                    )
                    apart = apart or low > high + touch
                if apart:
                    continue
                # Side of each end on the line of the other segment; 0 within rounding.
                for k in range(4):
                    a, p = (i, j + k) if k < 2 else (j, i + k - 2)
                    dx, dy = points[a + 1, 0] - points[a, 0], points[a + 1, 1] - points[a, 1]
                    across = dx * (points[p, 1] - points[a, 1]) - dy * (points[p, 0] - points[a, 0])
                    limit = touch * (abs(dx) + abs(dy))
                    side[k] = 0.0 if abs(across) <= limit else across
                if side[0] * side[1] > 0.0 or side[2] * side[3] > 0.0:
                    continue
                if count == len(pairs):
                    longer = np.empty((2 * count, 2), np.int64)
                    for k in range(count):
                        longer[k, 0], longer[k, 1] = pairs[k, 0], pairs[k, 1]
                    pairs = longer
                pairs[count, 0], pairs[count, 1] = min(i, j), max(i, j)
                count += 1
    return pairs[:count]


def _crosses(i: IntArray, j: IntArray, points: FloatArray, following: IntArray) -> BoolArray:
    """Whether the segments from points i and j cross, at their inside or at their last point."""

    def side(a: IntArray, b: IntArray, p: IntArray) -> IntArray:
        """1 where point p lies left of the line from a to b, -1 right of it, 0 on it."""
        x, y = (points[b] - points[a]).T
        u, v = (points[p] - points[a]).T
        across = x * v - y * u
        return np.where(np.abs(across) <= _TOUCH * np.hypot(x, y), 0, np.sign(across)).astype(int)

    def side_of_bend(a: IntArray, b: IntArray, c: IntArray, p: IntArray) -> IntArray:
        """1 where point p lies left of the bend a-b-c (seen from b), -1 right of it, 0 on it."""
        into, out = side(a, b, p), side(b, c, p)
        return np.where(side(a, b, c) >= 0, np.minimum(into, out), np.maximum(into, out))

    a, b, c, d = i, i + 1, j, j + 1
    after_b, after_d = following[b], following[d]
    goes_on_b, goes_on_d = after_b >= 0, after_d >= 0
    side_a, side_b, side_c, side_d = side(c, d, a), side(c, d, b), side(a, b, c), side(a, b, d)
    straddles_i, straddles_j = side_c * side_d < 0, side_a * side_b < 0
    # Through the point b of the first polyline, at the inside of the second segment; and so on.
    through_b = (side_b == 0) & straddles_i & goes_on_b & (side_a * side(c, d, after_b) < 0)
    through_d = (side_d == 0) & straddles_j & goes_on_d & (side_c * side(a, b, after_d) < 0)
    meet = np.hypot(*(points[b] - points[d]).T) <= _TOUCH
    turns = side_of_bend(a, b, after_b, c) * side_of_bend(a, b, after_b, after_d) < 0
    through_both = meet & goes_on_b & goes_on_d & turns
    return (straddles_i & straddles_j) | (~meet & (through_b | through_d)) | through_both


PLACE = 130
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


COLUMNS = (
    Column(
        "crossings",
        "1",
        "Number of places at which two different paths of a layer cross: one goes from one side "
        "of the other to its other side. Touching is no crossing.",
        ">= 0, 0 is best",
    ),
    Column(
        "self_crossings", "1", "Number of places at which a path crosses itself.", ">= 0, 0 is best"
    ),
)


@dataclass(frozen=True)
class CrossingSamples:
    """Crossings between paths (1,) and of paths with themselves (1,) on a layer."""

    between: FloatArray
    own: FloatArray


def sample_crossings(paths: PlanePaths) -> CrossingSamples:
    """Count the crossings on a layer (see `find_crossings`)."""
    pairs = find_crossings(paths.points, paths.offsets, paths.closed)
    line = np.searchsorted(paths.offsets, pairs, side="right")
    with_itself = int((line[:, 0] == line[:, 1]).sum())
    return CrossingSamples(
        np.array([float(len(pairs) - with_itself)]), np.array([float(with_itself)])
    )


def crossing_indices(samples: CrossingSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return {"crossings": float(samples.between.sum()), "self_crossings": float(samples.own.sum())}


def sample(paths: LayerPaths) -> CrossingSamples:
    """Take the samples of one layer."""
    return sample_crossings(paths.plane)


indices = crossing_indices
