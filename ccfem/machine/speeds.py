"""Speed of every step of polylines by a table of curvature, length and angle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.polylines import (
    arc_lengths,
    inner_points,
    lengths,
    merge_repeated,
    sample_at,
    starts_segment,
    turning_angles,
)
from ccfem.machine.ranges import check_ranges

# Fibre speed by curvature, length and angle of a path: table 2 of Wang et al. 2021.


@dataclass(frozen=True)
class SpeedTable:
    """Three speeds of the fibre, and the pieces of a path that each is for.

    The defaults are table 2 of Wang et al. 2021. A piece gets the lowest of the three speeds that
    its curvature, its length and its angle allow.

    Attributes
    ----------
    speed : tuple of 3 floats, mm/s
        Slow, middle and fast.
    curvature : tuple of 2 floats, 1/mm
        Slow above the first, fast below the second, middle in between.
    length : tuple of 2 floats, mm
        Slow below the first, fast above the second.
    angle : tuple of 2 floats, degrees
        Between a piece and its neighbour, 180 where the path goes straight on: slow below the
        first, fast from the second on. Paths are cut into pieces at angles below the second.
    """

    speed: tuple[float, float, float] = (7.0, 15.0, 35.0)
    curvature: tuple[float, float] = (0.2, 0.05)
    length: tuple[float, float] = (15.0, 25.0)
    angle: tuple[float, float] = (90.0, 135.0)

    def __post_init__(self) -> None:
        for name, size, order in (
            ("speed", 3, "rising numbers above 0"),
            ("curvature", 2, "falling numbers >= 0"),
            ("length", 2, "rising numbers >= 0"),
            ("angle", 2, "rising numbers from 0 to 180"),
        ):
            given = getattr(self, name)
            rising = np.asarray(given[::-1] if name == "curvature" else given, dtype=np.float64)
            good = rising.shape == (size,) and np.isfinite(rising).all()
            if good:
                good = (np.diff(rising) >= 0.0).all() and rising[0] >= 0.0
                good &= name != "speed" or rising[0] > 0.0
                good &= name != "angle" or rising[-1] <= 180.0
            if not good:
                raise InputError(
                    f"the speed table needs {size} {order} as {name}; got {list(given)}: "
                    "sort them, one a row of the table"
                )
        check_ranges(self)

    def at(self, curvature: ArrayLike, length: ArrayLike, angle: ArrayLike) -> FloatArray:
        """Speed, mm/s, of pieces of a path: by curvature, 1/mm, length, mm, and angle, degrees.

        The angle is the smallest one to a neighbour.
        """
        length, angle = np.asarray(length), np.asarray(angle)
        by_length = 1 - (length < self.length[0]) + (length > self.length[1])
        by_angle = 1 - (angle < self.angle[0]) + (angle >= self.angle[1])
        row = np.minimum(np.minimum(by_length, by_angle), self.row_of(curvature))
        return np.asarray(self.speed)[row]

    def row_of(self, curvature: ArrayLike) -> IntArray:
        """Row of the table, 0 (slow) to 2 (fast), that each curvature, 1/mm, stands in."""
        given = np.asarray(curvature)
        row: IntArray = 1 - (given > self.curvature[0]) + (given < self.curvature[1])
        return row


_DIGITS = 9
"""Decimals that curvature and length are rounded to."""
_ANGLE_DIGITS = 0
"""Decimals that angles, degrees, are rounded to: a right angle between steps of 1 mm is one, though
their points are written to 0.001 mm."""


def table_speeds(
    points: FloatArray, offsets: IntArray, table: SpeedTable, shortest: float
) -> FloatArray:
    """Speed of every step of polylines by a table.

    Polylines are cut into pieces at corners (angles below the table's last one), and where the
    curvature of the steps changes from one row of the table to another. Both ends of a polyline
    are ends of a piece, of a closed one too: there the machine starts and stops.

    Parameters
    ----------
    points, offsets
        The polylines, as in `ccfem.geometry.polylines`.
    shortest : float, mm
        Curvature is taken over no less than this length on either side.

    Returns
    -------
    (P,) array, mm/s
        Speed of the step from each point to the next. Meaningless at the last point of a
        polyline and before a repeated one.

    Notes
    -----
    Wang et al. 2021, section 3.2, give the curvature of a point by the angle between its two
    direction vectors and their length. These are here the chords to the neighbouring points, or to
    the points `shortest` before and behind where the neighbours are nearer; they do not reach
    across corners. On a circle through the points it is that of the circle. A step has the larger
    curvature of its two ends.
    """
    count = len(points)
    points, offsets, kept = merge_repeated(points, offsets)
    open_ended = np.zeros(len(offsets) - 1, dtype=bool)
    turn = np.degrees(turning_angles(points, offsets, open_ended))
    angle = (180.0 - turn).round(_ANGLE_DIGITS)
    corner = angle < table.angle[1]
    start = np.flatnonzero(starts_segment(offsets))
    if not len(start):
        return np.full(count, table.speed[0])
    curvature = step_curvatures(points, offsets, corner, shortest)
    row = table.row_of(curvature)
    new = corner[start]
    new[0] = True
    new[1:] |= (row[1:] != row[:-1]) | (np.diff(start) > 1)
    piece = np.cumsum(new) - 1
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(start)) - 1
    length = np.bincount(piece, np.linalg.norm(points[start + 1] - points[start], axis=1))
    least = np.minimum(angle[start[first]], angle[start[last] + 1])
    speeds = np.full(len(points), table.speed[0])
    speeds[start] = table.at(curvature[first], length, least)[piece]
    return np.repeat(speeds, np.diff(np.append(kept, count)))


def step_curvatures(
    points: FloatArray, offsets: IntArray, corner: BoolArray, shortest: float
) -> FloatArray:
    """Curvature of each step, in the order of the points they start from."""
    # Pieces from corner to corner: corners are there twice, as the end and as the start of one.
    index = np.repeat(np.arange(len(points)), 1 + corner)
    ends = np.cumsum(1 + corner)
    bounds = np.sort(np.concatenate([[0], ends[offsets[1:] - 1], ends[corner] - 1]))
    pieces = points[index]
    curvature = _curvatures(pieces, bounds, shortest)
    start = np.flatnonzero(starts_segment(bounds))
    return np.maximum(curvature[start], curvature[start + 1])


def _curvatures(points: FloatArray, offsets: IntArray, shortest: float) -> FloatArray:
    """Curvature at every point of smooth polylines; 0 at their ends."""
    line = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    along = arc_lengths(points, offsets)
    total = lengths(points, offsets)[line]
    k = np.flatnonzero(inner_points(offsets, np.zeros(len(offsets) - 1, dtype=bool)))
    before = np.minimum(along[k] - shortest, along[k - 1])
    after = np.maximum(along[k] + shortest, along[k + 1])
    into = points[k] - sample_at(points, offsets, line[k], np.maximum(before, 0.0))[0]
    out = sample_at(points, offsets, line[k], np.minimum(after, total[k]))[0] - points[k]
    reach, on = np.linalg.norm(into, axis=1), np.linalg.norm(out, axis=1)
    # |u - v| of the unit vectors along both chords is 2 sin(half the angle between them).
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = np.linalg.norm(into / reach[:, None] - out / on[:, None], axis=1)
        estimate = 2.0 * bend / (reach + on)
    # A loop that closes within `shortest` has no chord: its curvature is infinite.
    curvature = np.zeros(len(points))
    curvature[k] = np.where(np.isnan(estimate), np.inf, estimate)
    return curvature.round(_DIGITS)
