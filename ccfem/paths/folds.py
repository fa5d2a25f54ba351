"""Folds: turns of a strand that the machine's least radius does not allow.

A tow that is led round a far tighter turn than the machine allows is not bent but folded over. The
turn is measured as a printer feels it: over an arc length, not at a point. With the machine's least
radius r a strand *folds* where its tangent turns by more than 90 degrees within

    window = (4 / 3.85) r,

4 mm by default; on a circle of radius r it turns by 59.5 degrees there. A circle folds if its
radius is less than r / 1.512. A square corner is no fold.

Judging is mild where points decide: it averages the tangent over some tenths of a millimetre, and a
vertex spreads its turn as if a curve had been there. Planners are strict: they take the polyline as
it is, in a window that is `MARGIN` times as long, so that whoever counts folds finds none.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, repeated
from ccfem.geometry.polylines import (
    arc_lengths,
    farthest_point,
    lengths,
    line_length,
    merge_repeated,
    turning_angles,
)
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths

WINDOW = 4.0 / 3.85
"""Arc length over which a turn is measured, in least radii of the machine."""

ANGLE = np.pi / 2.0
"""Turn of the tangent within the window beyond which a strand folds, radians."""

MARGIN = 1.08
"""Factor on the machine's radius by which planners look for folds: what follows moves points by
some hundredths of a width, and whoever counts folds may take other points of a strand."""

_SAMPLES = 40
"""Samples of the tangent in a window."""
_BATCH = 2_000_000
"""Samples that are looked at together: about 300 MB."""
_LAGS = 8
"""Numbers of samples ahead that are looked at together, where memory allows."""
_FINEST = 0.02
"""Least distance of the samples, mm: with radii below .8 mm fewer of them lie in a window."""
_SMOOTH = 2
"""Samples before and behind one over which the tangent is averaged."""
_SLACK = 2e-3
"""By how much a turn may exceed the angle, radians: a square corner in rounded coordinates."""
_SPREAD = 0.25
"""Largest length, in windows, over which a vertex of a polyline spreads its turn to each side."""
_SHARP = 1e-3
"""That length where nothing is averaged: a vertex turns on the spot."""
_SURELY = 0.999
"""Share of the angle up to which the turns of vertices in a window may add up without a fold."""
_STRAIGHT = 2e-4
"""Distance, mm, up to which points lie on a straight piece and decide nothing: more than that by
which coordinates move that are rounded to 1e-4 mm, as in files."""


_NONE = (np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Folds:
    """Where polylines fold, by arc length.

    Attributes
    ----------
    line : (f,) int array
        Polyline of each fold; folds are in the order of the polylines, then of the arc length.
    start, stop : (f,) arrays, mm
        Ends of each folded stretch: the shortest ones over which the tangent turns by more than the
        angle, and all that overlap as one. On a closed polyline, `stop` may exceed the length.
    lengths : (K,) array, mm
        Length of each polyline.
    closed : (K,) bool array
    """

    line: IntArray
    start: FloatArray
    stop: FloatArray
    lengths: FloatArray
    closed: BoolArray

    def __post_init__(self) -> None:
        freeze(self, line=int, start=float, stop=float, lengths=float, closed=bool)

    @property
    def counts(self) -> IntArray:
        """Number of folds of each polyline, (K,)."""
        return np.bincount(self.line, minlength=len(self.lengths))

    @property
    def places(self) -> FloatArray:
        """Middle of each fold by arc length, (f,), mm."""
        return 0.5 * (self.start + self.stop) % np.maximum(self.lengths[self.line], 1e-300)

    def free(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Parts of the polylines without folds.

        Returns
        -------
        line : (m,) int array
            Polyline of each part.
        start, stop : (m,) arrays, mm
            Its ends by arc length. On a closed polyline with a fold, `stop` may exceed the length:
            the part runs on over the start.
        """
        count = len(self.lengths)
        # Between two stops of folds, or ends of the line: n folds leave n + 1 parts of an open
        # line, and n of a closed one, whose last part runs on to its first fold.
        ring = self.closed & (self.counts > 0)
        opened = np.flatnonzero(~ring)
        line = np.concatenate([opened, self.line])
        start = np.concatenate([np.zeros(len(opened)), self.stop])
        order = np.lexsort((start, line))
        line, start = line[order], start[order]
        shut = np.concatenate([self.line, opened])
        stop = np.concatenate([self.start, self.lengths[opened]])
        order = np.lexsort((stop, shut))
        stop = stop[order]
        first = np.searchsorted(shut[order], np.arange(count))
        # On a ring the part after fold k ends at fold k + 1, after the last one at the first.
        following = np.arange(len(line)) + ring[line]
        over = ring[line] & (following >= first[line] + self.counts[line])
        following = np.where(over, first[line], following)
        stop = stop[following] + np.where(over, self.lengths[line], 0.0)
        kept = stop > start
        return line[kept], start[kept], stop[kept]

    @property
    def longest_free(self) -> FloatArray:
        """Longest part of each polyline without a fold, (K,), mm."""
        line, start, stop = self.free()
        longest = np.zeros(len(self.lengths))
        np.maximum.at(longest, line, stop - start)
        return longest

    @property
    def folded(self) -> FloatArray:
        """Length of each polyline that lies in folds, (K,), mm."""
        folded = np.zeros(len(self.lengths))
        np.add.at(folded, self.line, self.stop - self.start)
        return folded


def joined_folds(of: Sequence[Folds]) -> Folds:
    """Folds of several lots of polylines as those of all, lot after lot."""
    number = np.cumsum([0, *(len(one.lengths) for one in of)])
    return Folds(
        np.concatenate([one.line + first for one, first in zip(of, number, strict=False)]),
        *(
            np.concatenate([getattr(one, name) for one in of])
            for name in ("start", "stop", "lengths", "closed")
        ),
    )


def folds(
    points: FloatArray, offsets: IntArray, closed: BoolArray, radius: float, strict: bool = False
) -> Folds:
    """Find the folds of polylines.

    The tangent is that of the polyline in the space of its points: of strands on a curved layer
    give the points in space, for so the printer lays them. Unless `strict`, each vertex spreads its
    turn over half a segment to each side, and over a quarter of the window at most, so that a curve
    folds alike whether its points lie .05 or 2 mm apart.

    Parameters
    ----------
    points : (P, d) array, mm
        In two or three dimensions.
    offsets : (K + 1,) int array
        As in CSR.
    closed : (K,) bool array
        Closed polylines repeat their first point at their end, and are measured across it.
    radius : float, mm
        Least radius of the machine, at least 0, which allows every turn.
    strict : bool, default False
        Whether to take the polyline as it is, as planners do: its pieces are straight, its vertices
        turn on the spot, and no tangents are averaged. A fold then takes half a window at least,
        about its middle, so that the pieces of a strand that is cut at a corner do not meet.
    """
    offsets, closed = np.asarray(offsets), np.asarray(closed)
    points, begin = _begun_alike(np.array(points, dtype=float), offsets, closed)
    window = WINDOW * radius
    size = lengths(points, offsets)
    if radius == 0.0:  # the machine turns on the spot
        return Folds(*_NONE, lengths=size, closed=closed)
    turning = np.flatnonzero(_may_turn(points, offsets, closed, window))
    count = np.diff(offsets)[turning]
    owner, number = repeated(count)
    points = points[offsets[turning][owner] + number]
    # As many lines at a time as the memory for their samples allows.
    batch = np.floor(np.cumsum(size[turning]) / (_BATCH * _spacing(window))).astype(np.int64)
    ends = np.flatnonzero(np.diff(batch, append=-1)) + 1
    offsets = np.concatenate([[0], np.cumsum(count)])
    parts: list[tuple[IntArray, FloatArray, FloatArray]] = []
    for first, last in pairwise([0, *ends.tolist()]):
        some, turns = slice(offsets[first], offsets[last]), turning[first:last]
        lines = (points[some], offsets[first : last + 1] - offsets[first], closed[turns])
        k, start, stop = _fold_stretches(*lines, begin[turns], size[turns], window, strict)
        parts.append((turns[k], start, stop))
    line, start, stop = (np.concatenate(column) for column in zip(_NONE, *parts, strict=True))
    return Folds(line, start, stop, lengths=size, closed=closed)


def _may_turn(points: FloatArray, offsets: IntArray, closed: BoolArray, window: float) -> BoolArray:
    """Mask of the polylines whose vertices turn by the angle within a window, (K,).

    The mean tangents of a window lie between those of the segments in it, so others cannot fold.
    Closed ones always may: they turn all the way round.
    """
    may: BoolArray = np.array(closed)
    points, offsets, _ = merge_repeated(points, offsets)
    turn = turning_angles(points, offsets, np.zeros_like(closed))
    # What a window can hold: itself, how far vertices spread their turn, and the samples over which
    # tangents are averaged. On one axis for all lines, they lie farther apart than that.
    reach = window * (1.0 + 2.0 * _SPREAD) + 2.0 * (2 * _SMOOTH + 1) * _spacing(window)
    size = lengths(points, offsets)
    line = np.repeat(np.arange(len(size)), np.diff(offsets))
    along = arc_lengths(points, offsets) + (np.cumsum(size + reach) - size)[line]
    total = np.concatenate([[0.0], np.cumsum(turn)])
    last = np.searchsorted(along, along + reach, side="right")
    may[line[total[last] - total[:-1] > _SURELY * ANGLE]] = True
    return may


def _spacing(window: float) -> float:
    """Distance of the samples in a window, mm."""
    return max(window / _SAMPLES, _FINEST)


def _fold_stretches(
    points: FloatArray,
    offsets: IntArray,
    closed: BoolArray,
    begin: FloatArray,
    size: FloatArray,
    window: float,
    strict: bool,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Polyline, start and stop, mm, of every fold of polylines that begin at `begin` (K,), mm."""
    along = arc_lengths(points, offsets)
    if not strict:
        kept = _off_straight_pieces(points, offsets)
        points, along = points[kept], along[kept]
        offsets = np.searchsorted(kept, offsets)
    spread = (_SHARP if strict else _SPREAD) * window
    line, position, tangent, step = _tangents(points, offsets, closed, window, spread)
    # Places are those of the polyline as it was given; found on one axis for all lines.
    base, short = np.cumsum(size + 1.0) - (size + 1.0), arc_lengths(points, offsets)
    axis = short + np.repeat(base, np.diff(offsets))
    position = position + np.interp(position + base[line], axis, along - short)
    # From each sample the nearest one ahead to which the tangent turns by more than the angle.
    samples = np.bincount(line, minlength=len(size))
    ahead = np.zeros(len(line), dtype=np.int64)
    first = np.cumsum(samples) - samples
    number = np.arange(len(line)) - first[line]
    if not strict:
        tangent = _mean_tangents(tangent, first[line], number, samples[line], closed[line])
    # A ring goes on behind its last sample with its first one.
    most = np.minimum(np.floor(window / step + 1e-9), samples - 1).astype(np.int64)[line]
    most = np.where(closed[line], most, np.minimum(most, samples[line] - 1 - number))
    limit = np.cos(ANGLE + _SLACK)
    pending = np.flatnonzero(_may_fold(tangent, first[line], number, samples[line], most))
    least = 1
    while len(pending):
        lag = np.arange(least, least + (_LAGS if _LAGS * len(pending) < _BATCH else 1))
        after = (number[pending, None] + lag) % samples[line[pending], None]
        there = tangent.take(first[line[pending], None] + after, axis=0)
        turned = np.einsum("ij,ikj->ik", tangent.take(pending, axis=0), there) < limit
        turned &= lag <= most[pending, None]
        turns = turned.any(axis=1)
        ahead[pending[turns]] = lag[turned[turns].argmax(axis=1)]
        least += len(lag)
        pending = pending[~turns & (most[pending] >= least)]
    reach = ahead * step[line]
    # Shortest stretches: those that hold no other, which would start at the next sample.
    following = ahead[first[line] + (number + 1) % np.maximum(samples[line], 1)]
    shortest = (following == 0) | (following >= ahead)
    at = np.flatnonzero((ahead > 0) & shortest)
    line, start, reach = line[at], (position + begin[line])[at], reach[at]
    if strict:
        longer = np.maximum(2.0 * _SPREAD * window - reach, 0.0)
        start, reach = start - 0.5 * longer, reach + longer
    ring, whole = closed[line], size[line]
    stop = np.minimum(start + reach, whole)
    start = np.where(ring, start % whole, np.maximum(start, 0.0))
    stop = np.where(ring, start + np.minimum(reach, whole), stop)
    order = np.lexsort((start, line))
    return _merged_stretches(line[order], start[order], stop[order], size, closed)


def folds_in(toolpaths: Toolpaths, machine: Machine) -> Folds:
    """Folds of toolpaths of any kind, in space, by the machine's least radius."""
    paths = toolpaths
    return folds(paths.points, paths.offsets, paths.closed, machine.minimum_radius)


def _begun_alike(
    points: FloatArray, offsets: IntArray, closed: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Begin closed polylines at their point farthest from their middle, wherever they began.

    Points are changed in place; the arc length (K,), mm, of that point as it was is returned too.
    """
    begin = np.zeros(len(offsets) - 1)
    for k in np.flatnonzero(closed & (np.diff(offsets) > 2)):
        ring = points[offsets[k] : offsets[k + 1]]
        first = farthest_point(ring)
        begin[k] = line_length(ring[: first + 1])
        ring[:] = np.concatenate([ring[first:-1], ring[: first + 1]])
    return points, begin


def _off_straight_pieces(points: FloatArray, offsets: IntArray) -> IntArray:
    """Points of polylines that are not within straight pieces, in their order."""
    ends = np.zeros(len(points), dtype=bool)
    some = np.diff(offsets) > 0
    ends[offsets[:-1][some]] = ends[offsets[1:][some] - 1] = True
    kept, passes = np.arange(len(points)), 0
    # Every second point goes that lies on the chord of its neighbours, until none does.
    while passes < 2:
        middle = np.arange(1 + passes % 2, len(kept) - 1, 2)
        start, here, stop = (points[kept[middle + k]] for k in (-1, 0, 1))
        way, chord = here - start, stop - start
        square = np.maximum(np.einsum("ij,ij->i", chord, chord), 1e-300)
        share = np.clip(np.einsum("ij,ij->i", way, chord) / square, 0.0, 1.0)
        straight = np.linalg.norm(way - share[:, None] * chord, axis=1) < _STRAIGHT
        straight &= ~ends[kept[middle]]
        kept = np.delete(kept, middle[straight])
        passes = 0 if straight.any() else passes + 1
    return kept


def _tangents(
    points: FloatArray, offsets: IntArray, closed: BoolArray, window: float, spread: float
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Tangents of polylines in equal steps.

    Parameters
    ----------
    spread : float, mm
        Largest length over which a vertex spreads its turn to each side.

    Returns
    -------
    line : (s,) int array
    position : (s,) array, mm
        Middle of each step by arc length.
    tangent : (s, d) array
        Unit vector of the mean tangent over the step.
    step : (K,) array, mm
        Length of the steps of each polyline.
    """
    points, offsets, _ = merge_repeated(points, offsets)
    size, along = lengths(points, offsets), arc_lengths(points, offsets)
    parts = np.maximum(1, np.round(size / _spacing(window))).astype(np.int64)
    parts[size == 0.0] = 0
    step: FloatArray = np.divide(size, parts, out=np.ones(len(size)), where=parts > 0)
    line, number = repeated(parts)
    if not len(line):
        return line, np.zeros(0), np.zeros((0, points.shape[1])), step
    # The direction of a segment holds between two knots, and is linear from there to the next.
    owner = np.repeat(np.arange(len(size)), np.diff(offsets))
    segment = np.flatnonzero(owner[1:] == owner[:-1])
    vector = points[segment + 1] - points[segment]
    long = np.linalg.norm(vector, axis=1)
    direction, off = vector / long[:, None], np.minimum(0.5 * long, spread)
    knot = np.stack([along[segment] + off, along[segment] + long - off], axis=1).ravel()
    knot_line, at_knot = np.repeat(owner[segment], 2), np.repeat(direction, 2, axis=0)
    # Ends: an open line goes on as it is, a ring between its last knot and its first.
    some = np.flatnonzero(parts > 0)
    begin = np.searchsorted(knot_line, some)
    end = np.searchsorted(knot_line, some, side="right") - 1
    before, after = (size[some] - knot[end])[:, None], knot[begin][:, None]
    seam = (after * at_knot[end] + before * at_knot[begin]) / (before + after)
    ring = closed[some][:, None]
    ends = [np.where(ring, seam, at_knot[k]) for k in (begin, end)]
    place = np.stack([begin, end + 1], axis=1).ravel()
    knot = np.insert(knot, place, np.stack([0.0 * size[some], size[some]], axis=1).ravel())
    at_knot = np.insert(at_knot, place, np.stack(ends, axis=1).reshape(len(place), -1), axis=0)
    knot_line = np.insert(knot_line, place, np.repeat(some, 2))
    # Mean over a step: difference of the integral, on one axis for all lines.
    base = np.cumsum(size + 1.0) - (size + 1.0)
    axis = knot + base[knot_line]
    gap = np.diff(axis)
    integral = np.zeros_like(at_knot)
    integral[1:] = np.cumsum(0.5 * gap[:, None] * (at_knot[1:] + at_knot[:-1]), axis=0)
    # A step ends where the next one of its line begins.
    of_end, end = repeated(np.where(parts > 0, parts + 1, 0))
    place = end * step[of_end] + base[of_end]
    k = np.clip(np.searchsorted(axis, place, side="right") - 1, 0, len(axis) - 2)
    way, begun = (place - axis[k])[:, None], at_knot.take(k, axis=0)
    slope = (at_knot.take(k + 1, axis=0) - begun) / np.maximum(gap[k], 1e-300)[:, None]
    value = integral.take(k, axis=0) + way * (begun + 0.5 * way * slope)
    last = np.append(of_end[1:] != of_end[:-1], True)
    mean = np.diff(value, axis=0)[~last[:-1]]
    tangent: FloatArray = mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-300)[:, None]
    position: FloatArray = (number + 0.5) * step[line]
    return line, position, tangent, step


def _mean_tangents(
    tangent: FloatArray, first: IntArray, number: IntArray, samples: IntArray, closed: BoolArray
) -> FloatArray:
    """Average tangents over some samples: a printer does not feel a waver of a tenth of a mm.

    At the ends of open polylines the average is over the samples that there are.
    """
    total = np.zeros_like(tangent)
    for off in range(-_SMOOTH, _SMOOTH + 1):
        place = number + off
        inside = (closed | ((place >= 0) & (place < samples))).astype(float)
        total += inside[:, None] * tangent[first + place % np.maximum(samples, 1)]
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None])


def _may_fold(
    tangent: FloatArray, first: IntArray, number: IntArray, samples: IntArray, most: IntArray
) -> BoolArray:
    """Mask of the samples from which the sum of all turns ahead reaches the angle."""
    following = first + (number + 1) % np.maximum(samples, 1)
    cosine = np.einsum("ij,ij->i", tangent, tangent[following])
    total = np.concatenate([[0.0], np.cumsum(np.arccos(np.clip(cosine, -1.0, 1.0)))])
    here = np.arange(len(number))
    beyond = np.maximum(number + most - samples, 0)  # samples of a ring that lie over its start
    turn = total[here + most - beyond] - total[here] + total[first + beyond] - total[first]
    return np.asarray((most > 0) & (turn >= ANGLE))


def _merged_stretches(
    line: IntArray, start: FloatArray, stop: FloatArray, size: FloatArray, closed: BoolArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Stretches of polylines, by ascending starts, with those that overlap as one."""
    if not len(line):
        return line, start, stop
    room = 2.0 * size + 1.0
    base = (np.cumsum(room) - room)[line]
    reach = np.maximum.accumulate(stop + base)
    new = np.concatenate([[True], start[1:] + base[1:] > reach[:-1]])
    number = np.flatnonzero(new)
    line, start = line[number], start[number]
    stop = np.maximum.reduceat(stop, number)
    # The last stretch of a ring may run over the start into the first ones.
    kept = np.ones(len(line), dtype=bool)
    for k in np.flatnonzero(closed[line] & (stop >= size[line])):
        for other in np.flatnonzero((line == line[k]) & kept):
            if other != k and start[other] + size[line[k]] <= stop[k]:
                stop[k] = max(stop[k], stop[other] + size[line[k]])
                kept[other] = False
        if stop[k] - start[k] >= size[line[k]]:
            start[k], stop[k] = 0.0, size[line[k]]
    return line[kept], start[kept], stop[kept]
