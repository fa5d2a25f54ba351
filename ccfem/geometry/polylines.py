"""Polylines as arrays: arc length, resampling, turning.

Many polylines at once are held as in CSR: ``points`` (P, d) with ``offsets`` (K + 1,), polyline k
being ``points[offsets[k]:offsets[k + 1]]``, in d = 2 or 3 dimensions. A closed polyline repeats its
first point at its end.
"""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, repeated
from ccfem.base.compiled import compiled


def pack(lines: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Points (P, d) and offsets (K + 1,) of a list of (n_i, d) polylines."""
    sizes = [len(line) for line in lines]
    offsets = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)]).astype(np.int64)
    points = np.concatenate(lines) if len(lines) else np.zeros((0, 2))
    return np.asarray(points, dtype=np.float64), offsets


def straight_pieces(lines: Sequence[FloatArray]) -> FloatArray:
    """Both ends (s, 2, 2) of the straight pieces of (n_i, 2) polylines, one after the other."""
    pairs = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    return np.concatenate([np.zeros((0, 2, 2)), *pairs])


def starts_segment(offsets: IntArray) -> BoolArray:
    """Mask (P,) of the points that start a segment: all but the last one of each polyline."""
    mask = np.ones(int(offsets[-1]), dtype=bool)
    mask[offsets[1:][np.diff(offsets) > 0] - 1] = False
    return mask


def inner_points(offsets: IntArray, closed: BoolArray) -> BoolArray:
    """Mask (P,) of the points with a segment on both sides: of closed ones also the first."""
    mask = starts_segment(offsets)
    held = np.diff(offsets) > 0
    mask[offsets[:-1][held]] &= np.asarray(closed, dtype=bool)[held]
    return mask


def _steps(points: FloatArray, offsets: IntArray) -> FloatArray:
    """Distance of each point to the one before it, (P,); 0 at the start of a polyline."""
    steps = np.zeros(len(points))
    if len(points):
        steps[1:] = np.sqrt(np.einsum("ij,ij->i", *[np.diff(points, axis=0)] * 2))
        starts = offsets[:-1]
        steps[starts[starts < len(points)]] = 0.0
    return steps


_TOGETHER = 200_000
"""Points whose differences are taken at a time: those of a large print fill memory."""


def step_lengths(points: FloatArray, out: FloatArray | None = None) -> FloatArray:
    """Distance from each point (P, d) to the next one, (P - 1,), in an array that may be given."""
    count = max(len(points) - 1, 0)
    steps = np.empty(count) if out is None else out
    for first in range(0, count, _TOGETHER):
        some = slice(first, min(first + _TOGETHER, count))
        steps[some] = sizes(points[some.start + 1 : some.stop + 1] - points[some])
    return steps


def sizes(vectors: FloatArray) -> FloatArray:
    """Lengths (n,) of vectors (n, d): those of `numpy.linalg.norm`, which takes twice as long."""
    total, *more = (vectors * vectors).T
    for squares in more:
        total = total + squares
    return np.sqrt(total)


def extent(
    points: FloatArray, axes: FloatArray | None = None, among: BoolArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates of points (P, d), or along axes (d, k).

    `among` (P,) tells which count, by default all; infinite where none does.
    """
    low: FloatArray = np.full(points.shape[1] if axes is None else axes.shape[1], np.inf)
    high = -low
    for first in range(0, len(points), _TOGETHER):
        piece = points[first : first + _TOGETHER]
        if among is not None:
            piece = piece[among[first : first + _TOGETHER]]
            if not len(piece):
                continue
        piece = piece if axes is None else piece @ axes
        # Column by column: a reduction along rows as short as these takes several times as long.
        low = np.minimum(low, [column.min() for column in piece.T])
        high = np.maximum(high, [column.max() for column in piece.T])
    return low, high


def arc_lengths(points: FloatArray, offsets: IntArray) -> FloatArray:
    """Arc length from the start of its polyline to each point, (P,)."""
    along = np.cumsum(_steps(points, offsets))
    sizes = np.diff(offsets)
    starts = offsets[:-1][sizes > 0]
    return along - np.repeat(along[starts], sizes[sizes > 0])


def lengths(points: FloatArray, offsets: IntArray) -> FloatArray:
    """Length of each polyline, (K,)."""
    along = np.concatenate([[0.0], np.cumsum(_steps(points, offsets))])
    return along[offsets[1:]] - along[offsets[:-1]]


def sample_at(
    points: FloatArray, offsets: IntArray, line: IntArray, position: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Points of polylines at given arc lengths.

    Parameters
    ----------
    points, offsets
        The polylines, each with at least one point.
    line : (s,) int array
        Polyline of each sample.
    position : (s,) array
        Arc length from the start of that polyline; clipped to it.

    Returns
    -------
    points : (s, d) array
    segment : (s,) int array
        Index of the point that starts the segment on which each sample lies. Segments of no length
        are never named, unless the whole polyline has none.
    """
    if not len(line):
        return np.zeros((0, points.shape[1])), np.zeros(0, dtype=np.int64)
    total = lengths(points, offsets)
    # One axis for all polylines, with gaps of 1 so that they cannot meet.
    base = np.cumsum(total + 1.0) - (total + 1.0)
    axis = arc_lengths(points, offsets) + np.repeat(base, np.diff(offsets))
    wanted = np.clip(position, 0.0, total[line]) + base[line]
    segment = np.searchsorted(axis, wanted, side="right") - 1
    # Polyline ends belong to the last segment that has a length.
    last = np.searchsorted(axis, axis[offsets[1:] - 1], side="left") - 1
    segment = np.clip(segment, offsets[line], np.maximum(last, offsets[:-1])[line])
    following = np.minimum(segment + 1, offsets[line + 1] - 1)
    size = axis[following] - axis[segment]
    share = np.divide(wanted - axis[segment], size, out=np.zeros(len(wanted)), where=size > 0.0)
    share = np.clip(share, 0.0, 1.0)[:, None]
    return (1.0 - share) * points[segment] + share * points[following], segment


def resample(points: FloatArray, offsets: IntArray, step: float) -> tuple[FloatArray, IntArray]:
    """Resample polylines in equal steps of arc length.

    Each polyline of length L is cut into ``max(1, round(L / step))`` equal parts, so that both ends
    stay and a closed polyline stays closed.

    Parameters
    ----------
    points, offsets
        The polylines, each with at least one point.
    step : float, mm
        Wanted distance along the curve between neighbouring points.

    Returns
    -------
    points, offsets
        The resampled polylines; arc length is the one of the polylines given.
    """
    total = lengths(points, offsets)
    parts = np.maximum(1, np.round(total / step).astype(np.int64))
    ends = np.concatenate([[0], np.cumsum(parts + 1)])
    line, number = repeated(parts + 1)
    samples, _ = sample_at(points, offsets, line, number * (total / parts)[line])
    if len(total):
        samples[ends[:-1]], samples[ends[1:] - 1] = points[offsets[:-1]], points[offsets[1:] - 1]
    return samples, ends


def sample_midpoints(
    points: FloatArray, offsets: IntArray, step: float
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Cut polylines into equal parts and sample the middle of each part.

    Parts are those of `resample`. Polylines of no length give no sample.

    Returns
    -------
    points : (s, d) array
    tangents : (s, d) array
        Unit vectors along the segment on which each sample lies.
    weights : (s,) array
        Length of the part; they sum to the length of the polylines.
    line : (s,) int array
        Polyline of each sample.
    """
    total = lengths(points, offsets)
    parts = np.where(total > 0.0, np.maximum(1, np.round(total / step)), 0).astype(np.int64)
    line, number = repeated(parts)
    size = np.divide(total, parts, out=np.zeros(len(total)), where=parts > 0)[line]
    middle = np.asarray((number + 0.5) * size, dtype=np.float64)
    samples, segment = sample_at(points, offsets, line, middle)
    tangent = points[np.minimum(segment + 1, len(points) - 1)] - points[segment]
    norm = np.linalg.norm(tangent, axis=1)
    return samples, tangent / np.maximum(norm, 1e-300)[:, None], size, line


def subdivide(
    points: FloatArray, offsets: IntArray, longest: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Cut segments longer than `longest` into equal pieces; every given point stays.

    Returns points and offsets, and the given point that starts the segment of each new one, (P',).
    """
    steps = _steps(points, offsets)
    # Pieces of the segment that each point starts; the last point of a polyline starts none.
    pieces = np.ones(len(points), dtype=np.int64)
    pieces[:-1] = np.maximum(1, np.ceil(steps[1:] / longest - 1e-9))
    segment, number = repeated(pieces)
    first = np.concatenate([[0], np.cumsum(pieces)])
    share = (number / pieces[segment])[:, None]
    following = np.minimum(segment + 1, len(points) - 1)
    return (1.0 - share) * points[segment] + share * points[following], first[offsets], segment


def merge_repeated(
    points: FloatArray, offsets: IntArray, tolerance: float = 0.0
) -> tuple[FloatArray, IntArray, IntArray]:
    """Drop every point that lies within `tolerance` of the one before it.

    First points always stay, so a polyline of no length keeps one point. Returns points and
    offsets, and the numbers of the points kept, (P',).
    """
    keep = _steps(points, offsets) > tolerance
    starts = offsets[:-1][np.diff(offsets) > 0]
    keep[starts] = True
    kept = np.concatenate([[0], np.cumsum(keep)])
    return points[keep], kept[offsets], np.flatnonzero(keep)


def turning_angles(points: FloatArray, offsets: IntArray, closed: BoolArray) -> FloatArray:
    """Angle by which polylines turn at each point, (P,), radians in [0, pi].

    Parameters
    ----------
    points, offsets
        The polylines, without repeated neighbouring points (`merge_repeated`): a step of no length
        turns by 0.
    closed : (K,) bool array
        Closed polylines also turn at their first point; the angle is given there, and the repeated
        last point has 0. Ends of open polylines have 0.
    """
    count = len(points)
    if count == 0:
        return np.zeros(0)
    index = np.arange(count)
    before, after = index - 1, np.minimum(index + 1, count - 1)
    sizes = np.diff(offsets)
    starts, ends = offsets[:-1][sizes > 0], offsets[1:][sizes > 0] - 1
    ring = np.asarray(closed, dtype=bool)[sizes > 0] & (ends > starts)
    before[starts] = np.where(ring, ends - 1, starts)
    after[ends] = ends
    return angles_between(points - points[before], points[after] - points)


def angles_between(into: FloatArray, out: FloatArray) -> FloatArray:
    """Angles (k,), radians in [0, pi], between vectors (k, d); 0 where one has no length."""
    along = np.einsum("ij,ij->i", into, out)
    if into.shape[1] == 2:
        across = np.abs(into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0])
    else:
        across = np.linalg.norm(np.cross(into, out), axis=1)
    return np.arctan2(across, along)


def is_closed(line: FloatArray) -> bool:
    """Whether one polyline (n, d) ends at its first point."""
    return bool((line[0] == line[-1]).all())


def line_length(line: FloatArray) -> float:
    """Length of one polyline (n, d)."""
    return float(sizes(line[1:] - line[:-1]).sum())


def along_line(line: FloatArray) -> FloatArray:
    """Arc length (n,) from the start of one polyline (n, d) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(sizes(line[1:] - line[:-1]))])


def points_along(line: FloatArray, along: FloatArray, positions: FloatArray) -> FloatArray:
    """Columns of one polyline (n, d) at positions (k,) of its arc length `along`: (k, d) array."""
    return np.stack([np.interp(positions, along, column) for column in line.T], axis=1)


def runs(mask: BoolArray) -> IntArray:
    """Start and end (k, 2), the end not included, of each run of true values of a mask (n,)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges).reshape(-1, 2)


def farthest_point(ring: FloatArray) -> int:
    """Index of the point of a closed line (k, d) that is farthest from its middle.

    What begins there turns with a ring, wherever its points begin.
    """
    step = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    middle = step @ (0.5 * (ring[1:] + ring[:-1])) / max(float(step.sum()), 1e-300)
    return int(np.argmax(np.round(np.linalg.norm(ring[:-1] - middle, axis=1), 6)))


def middle_of_longest_run(ring: BoolArray) -> int:
    """Index of the middle of the longest run of true values of a ring (n,) of values."""
    starts, ends = runs(np.concatenate([ring, ring])).T
    longest = int(np.argmax(ends - starts))
    return int(starts[longest] + ends[longest]) // 2 % len(ring)


def point_at(line: FloatArray, position: float) -> FloatArray:
    """Point (d,) of one polyline (n, d) at an arc length from its start."""
    offsets = np.array([0, len(line)])
    samples, _ = sample_at(line, offsets, np.zeros(1, dtype=np.int64), np.array([position]))
    return samples[0]


def between(line: FloatArray, start: float, end: float) -> FloatArray:
    """Part of one polyline (n, d) from arc length `start` to arc length `end` >= `start`."""
    along = arc_lengths(line, np.array([0, len(line)]))
    inside = (along > start) & (along < end)
    return np.concatenate([[point_at(line, start)], line[inside], [point_at(line, end)]])


# Curvature of polylines by arc length.


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
    if not len(points):
        return np.zeros(0)
    samples, ends = resample(points, offsets, step)
    count = np.diff(ends)
    angle = turning_angles(samples, ends, closed)
    size = np.repeat(lengths(points, offsets) / np.maximum(count - 1, 1), count)
    inner = inner_points(ends, closed) & (size > 0.0)
    return np.asarray(angle[inner] / size[inner])


# Lines, cut where they come near themselves.


_OWN = 3.0
"""Length along the seed line, in fibre widths, within which it may be near itself."""


def until_itself(line: FloatArray, start: FloatArray, width: float) -> FloatArray:
    """Cut a line (n, 2), mm, from the point nearest to `start`, where it comes near itself.

    Streamlines may circle a hole many times, slightly displaced each time. A closed line stays
    closed if only its ends meet.
    """
    if len(line) < 2:
        return line
    seed = int(np.argmin(((line - start) ** 2).sum(axis=1)))
    first, last = _own_way(line, seed, is_closed(line), width, _OWN * width)
    return line[first : last + 1]


@compiled
def _own_way(
    line: FloatArray, seed: int, closed: bool, width: float, free: float
) -> tuple[int, int]:
    """First and last point that keep a distance from all others more than `free` mm of arc away."""
    count = len(line)
    along = np.zeros(count)
    for p in range(1, count):
        along[p] = along[p - 1] + np.sqrt(_squared(line, p, p - 1))
    # Ahead and back from the seed, until a point is too near to one of those that are kept.
    first = last = seed
    for sense in (1, -1):
        p = seed + sense
        while 0 <= p < count:
            for q in range(first, last + 1):
                arc = abs(along[p] - along[q])
                if closed:
                    arc = min(arc, along[-1] - arc)
                if arc > free and _squared(line, p, q) < width * width:
                    break
            else:
                first, last = min(first, p), max(last, p)
                p += sense
                continue
            break
    return first, last


@compiled
def _squared(line: FloatArray, p: int, q: int) -> float:
    """Square of the distance of two points."""
    x, y = line[p, 0] - line[q, 0], line[p, 1] - line[q, 1]
    return x * x + y * y
