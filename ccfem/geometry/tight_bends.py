"""Stretches of a line that turn more tightly than a radius."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.polylines import (
    angles_between,
    inner_points,
    line_length,
    points_along,
    resample,
    runs,
    turning_angles,
)

_SAMPLES = 8
"""Number of samples of the curvature a width."""


def tight_bends(
    line: FloatArray, along: FloatArray, closed: bool, radius: float, width: float
) -> FloatArray:
    """Stretches of a line that are bent more tightly than a radius.

    The curvature of a line is the angle between its chords of a width before and behind a place,
    over the width. A corner is a bend of up to two widths.

    Parameters
    ----------
    line : (n, d) array, mm
        In two or three dimensions.
    along : (n,) array, mm
        Arc length at its points.
    closed : bool
        Whether the line also turns where it closes.
    radius, width : float, mm

    Returns
    -------
    (k, 2) array, mm
        Start and end of each stretch by arc length; on a closed line one may end beyond its length.
        Empty for a closed line that is bent all the way round.
    """
    size = float(along[-1])
    step = size / np.ceil(size * _SAMPLES / width)
    at = np.arange(0.0, size - 0.5 * step, step)
    if not closed:
        at = at[(at >= width) & (at <= size - width)]
    if not len(at):
        return np.zeros((0, 2))

    def places(positions: FloatArray) -> FloatArray:
        return points_along(line, along, positions % size if closed else positions)

    # Turn of the chords over a width, against that of an arc of the radius.
    here = places(at)
    angle = angles_between(here - places(at - width), places(at + width) - here)
    over = angle - width * (1.0 - 1e-6) / radius
    tight = over >= 0.0
    if closed and tight.all():
        return np.zeros((0, 2))
    # Bends are runs of samples over the limit; their ends lie between samples.
    first = int(np.argmin(tight)) if closed else 0  # no bend extends over the start
    over = np.roll(over, -first)
    over_limit = runs(over >= 0.0)

    def crossing(outside: IntArray, inside: IntArray) -> FloatArray:
        """Places between two samples where the limit is met, independent of the sampling."""
        last = len(over) - 1
        o, i = np.clip(outside, 0, last), np.clip(inside, 0, last)
        share = np.divide(over[i], over[i] - over[o], out=np.zeros(len(o)), where=over[o] < 0.0)
        place: FloatArray = inside + (outside - inside) * share
        return place

    if closed:
        over = np.append(over, over[0])
    a = crossing(over_limit[:, 0] - 1, over_limit[:, 0])
    b = crossing(over_limit[:, 1], over_limit[:, 1] - 1)
    return np.column_stack([a, b]) * step + (first * step + at[0])


def tight_samples(line: FloatArray, closed: bool, radius: float, width: float) -> FloatArray:
    """Places (k,), mm, at which the evaluator finds a line to be as tight as a radius, or tighter.

    It checks the ends of equal steps of about a width; their number is nearest to the length.
    """
    points, offsets = resample(line, np.array([0, len(line)]), width)
    number = np.flatnonzero(inner_points(offsets, np.array([closed])))
    step = line_length(line) / (len(points) - 1)
    angle = turning_angles(points, offsets, np.array([closed]))[number]
    return np.asarray(step * number[angle * radius >= step])
