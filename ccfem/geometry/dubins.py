"""Shortest curves between two poses with a least radius of turn (Dubins).

L. E. Dubins, On curves of minimal length with a constraint on average curvature, and with
prescribed initial and terminal positions and tangents, American Journal of Mathematics 79 (1957)
497. The shortest curve is one of six words of three pieces, each an arc of the radius to the left
or right, or a straight line: LSL, RSR, LSR, RSL, LRL, RLR.

A pose is (x, y, heading), mm and radians.
"""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled

WORDS: IntArray = np.array(
    [[1, 0, 1], [-1, 0, -1], [1, 0, -1], [-1, 0, 1], [1, -1, 1], [-1, 1, -1]], dtype=np.int64
)
"""Turns of the three pieces of each word, (6, 3): 1 to the left, -1 to the right, 0 straight."""

_NO_TURN = 1e-6
"""Angle, radians, by which an arc may turn the other way instead of almost a full turn."""
_TOUCHING = 1e-10
"""Distance in radii below which circles coincide, or touch."""


def curve_points(
    start: FloatArray,
    end: FloatArray,
    turns: IntArray,
    sizes: FloatArray,
    radius: float,
    step: float,
) -> FloatArray:
    """Points of a curve from one pose to another.

    Parameters
    ----------
    start, end : (3,) arrays
        Poses: x, y in mm and the heading in radians.
    turns : (3,) int array
        Of the three pieces: 1 an arc to the left, -1 to the right, 0 a straight line.
    sizes : (3,) array, mm
        Length of each piece, >= 0.
    radius : float, mm
        Of the arcs, > 0.
    step : float, mm
        Longest distance along the curve between neighbouring points, > 0.

    Returns
    -------
    (k, 2) array, mm
        The first and the last point are those given, exactly; both ends of every piece are among
        the points. k = 1 where the poses are the same.
    """
    # Pieces shorter than this would only be repeated points.
    parts = np.where(sizes > 1e-9, np.ceil(sizes / step - 1e-9), 0).astype(np.int64)
    line = _sample(np.asarray(start, dtype=np.float64), turns, sizes, parts, float(radius))
    if len(line) > 1:
        line[-1] = end[:2]
    return line


def shortest_curve(start: FloatArray, end: FloatArray, radius: float, step: float) -> FloatArray:
    """Points (k, 2), mm, of the shortest curve of a radius from one pose (3,) to another."""
    sizes = np.empty((6, 3))
    word_sizes(start, end, radius, sizes)
    best = int(np.argmin(np.abs(sizes).sum(axis=1)))
    return curve_points(start, end, WORDS[best], np.maximum(sizes[best], 0.0), radius, step)


@compiled
def _sample(
    pose: FloatArray, turns: IntArray, sizes: FloatArray, parts: IntArray, radius: float
) -> FloatArray:
    line = np.empty((parts[0] + parts[1] + parts[2] + 1, 2))
    x, y, heading = pose[0], pose[1], pose[2]
    line[0, 0], line[0, 1] = x, y
    count = 1
    for piece in range(3):
        for part in range(parts[piece]):
            size = sizes[piece] * (part + 1) / parts[piece]
            px, py, _ = advance(x, y, heading, turns[piece], size, radius)
            line[count, 0], line[count, 1] = px, py
            count += 1
        x, y, heading = advance(x, y, heading, turns[piece], sizes[piece], radius)
    return line


@compiled
def advance(
    x: float, y: float, heading: float, turn: int, size: float, radius: float
) -> tuple[float, float, float]:
    """Pose after a piece; arcs by their chord and its direction, which avoids cancellation."""
    half = 0.5 * turn * size / radius
    chord = size if turn == 0 else 2.0 * radius * np.sin(abs(half)) * np.sign(size)
    return (
        x + chord * np.cos(heading + half),
        y + chord * np.sin(heading + half),
        heading + 2 * half,
    )


@compiled
def _round(angle: float) -> float:
    """Angle in [0, 2 pi), or one that is almost a full turn as a small negative one."""
    turn = 2.0 * np.pi
    angle -= turn * np.floor(angle / turn)
    return angle - turn if angle > turn - _NO_TURN else angle


@compiled
def word_sizes(start: FloatArray, end: FloatArray, radius: float, sizes: FloatArray) -> None:
    """Fill `sizes` (6, 3), mm, with the pieces of each of `WORDS`; inf where there is no curve.

    An arc that would turn almost all the way round is a tiny negative one instead.
    """
    for word in range(6):
        first, middle, last = WORDS[word, 0], WORDS[word, 1], WORDS[word, 2]
        # Centres of the circles at both ends in units of the radius, from one to the other.
        dx = (end[0] - start[0]) / radius - last * np.sin(end[2]) + first * np.sin(start[2])
        dy = (end[1] - start[1]) / radius + last * np.cos(end[2]) - first * np.cos(start[2])
        apart, way = np.hypot(dx, dy), np.arctan2(dy, dx)
        # One by one: compiled code that assigns to a slice takes seconds to compile.
        for piece in range(3):
            sizes[word, piece] = np.inf
        if middle == 0 and first == last:
            if apart < _TOUCHING:
                way = start[2]
            sizes[word, 0] = _round(first * (way - start[2]))
            sizes[word, 1] = apart
            sizes[word, 2] = _round(last * (end[2] - way))
        elif middle == 0:
            if apart < 2.0 - _TOUCHING:
                continue
            straight = np.sqrt(max((apart - 2.0) * (apart + 2.0), 0.0))
            way += first * np.arctan2(2.0, straight)
            sizes[word, 0] = _round(first * (way - start[2]))
            sizes[word, 1] = straight
            sizes[word, 2] = _round(last * (end[2] - way))
        else:
            if apart > 4.0 + _TOUCHING or apart < _TOUCHING:
                continue
            # Headings where the circle between the two touches the first and the last one.
            lean = np.arccos(min(0.25 * apart, 1.0))
            heading = way + first * (lean + 0.5 * np.pi)
            other = way + np.pi - first * (lean - 0.5 * np.pi)
            sizes[word, 0] = _round(first * (heading - start[2]))
            sizes[word, 1] = _round(middle * (other - heading))
            sizes[word, 2] = _round(last * (end[2] - other))
        for piece in range(3):
            sizes[word, piece] *= radius
