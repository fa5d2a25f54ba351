"""Beads: the bands that strands of a layer fill, and how much room each has.

A strand fills a band one width W wide. Where bands of strands of about the same direction overlap,
they share the room equally: at a point of the layer covered by m of them, each gets the m-th part.
Across a strand, with x from -W/2 to W/2,

    room = 1/W integral of 1 / m(x) dx.

The room of all strands, times the width, is thus the area of the union of their bands: N copies of
a line have the room of one line, two strands W/2 apart that of one and a half, and strands W apart
or more have full room. Strands that cross at a larger angle lie over each other and take no room
from each other, except in `Beads.every`.

A strand that goes back and forth along its own line shares its room as often as it passes, so that
no more fibre has room in a band than fits. A strand that winds has the direction of its chord over
a width.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.buckets import Buckets, bucket
from ccfem.geometry.polylines import lengths, resample, starts_segment

SAME_DIRECTION = np.radians(30.0)
"""Largest angle, radians, between strands that lie side by side and do not cross."""

_PARTS = 4
"""Number of parts a width that a strand is cut into."""

_AHEAD = _PARTS // 2
"""Parts on either side over which the direction of a strand is measured."""


class Beads(NamedTuple):
    """Parts of strands, and how much room their bands have.

    Attributes
    ----------
    line : (s,) int array
        Polyline of each part; parts come in the order of the polylines.
    first : (K + 1,) int array
        First part of each polyline, with their number at the end.
    length : (s,) array, mm
        Of the strand; the parts of a line are equal, about a quarter of a width.
    middle, direction, normal : (s, 3) arrays, mm and 1
        Middle of the part, unit vector along its chord over a width, unit normal of the layer.
    alone : (s,) array in (0, 1]
        Share of the strand that has room among strands of its direction; ``1 - alone`` lies on
        other fibre.
    every : (s,) array in (0, 1]
        As `alone`, among strands of any direction.
    fill : (s,) array
        Mean number of strands, of any direction, over the width of the band; a strand that winds
        counts by its length.
    stack : (s,) array
        Largest number of strands, of any direction, on top of each other in the band.
    """

    line: IntArray
    first: IntArray
    length: FloatArray
    middle: FloatArray
    direction: FloatArray
    normal: FloatArray
    alone: FloatArray
    every: FloatArray
    fill: FloatArray
    stack: FloatArray


def beads(
    points: FloatArray,
    normals: FloatArray,
    offsets: IntArray,
    closed: BoolArray,
    layer: IntArray,
    width: float,
    height: float,
) -> Beads:
    """Cut strands into parts and find the room of each.

    Parameters
    ----------
    points, normals : (P, 3) arrays, mm and 1
        Of the strands and of the layers that they lie on.
    offsets : (K + 1,) int array
        Polylines of at least one point; those of no length have one part of no length.
    closed : (K,) bool array
    layer : (K,) int array
    width, height : float, mm
        Of a strand. Strands on different layers share room where the layers are nearer than
        `height`.
    """
    nodes, ends = resample(points, offsets, width / _PARTS)
    count = np.diff(ends) - 1
    start = np.flatnonzero(starts_segment(ends))
    line = np.repeat(np.arange(len(count)), count)
    first = np.concatenate([[0], np.cumsum(count)])
    if not len(line):
        none, triples = np.zeros(0), np.zeros((0, 3))
        return Beads(line, first, none, triples, triples, triples, none, none, none, none)
    length = (lengths(points, offsets) / count)[line]
    middle = 0.5 * (nodes[start] + nodes[start + 1])
    normal = _normals(points, normals, offsets, middle, line)
    chord = nodes[start + 1] - nodes[start]
    direction, straight, often = _chords(chord, length, line, first, closed)
    direction = direction - np.einsum("ij,ij->i", direction, normal)[:, None] * normal
    direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-300)[:, None]
    shares = share_room(
        bucket(middle, middle, 1.05 * width),
        middle,
        direction,
        normal,
        length * straight,
        often,
        1.0 / straight,
        layer[line],
        line,
        np.ceil(width * (1.0 - 1e-9) / np.maximum(length, 1e-300)).clip(1, 1e9).astype(np.int64),
        np.where(closed, count, 0)[line],
        width,
        height,
        float(np.cos(SAME_DIRECTION)),
    )
    return Beads(line, first, length, middle, direction, normal, *shares.T)


def _normals(
    points: FloatArray,
    normals: FloatArray,
    offsets: IntArray,
    middle: FloatArray,
    line: IntArray,
) -> FloatArray:
    """Find the normal of the layer at each part: that of the nearest point of its polyline."""
    first = normals[offsets[:-1]]
    path = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    bent = np.zeros(len(offsets) - 1, dtype=bool)
    bent[path[(np.abs(normals - first[path]) > 1e-12).any(axis=1)]] = True
    normal = first[line]
    for k in np.flatnonzero(bent).tolist():
        at = slice(offsets[k], offsets[k + 1])
        mine = np.flatnonzero(line == k)
        apart = np.linalg.norm(middle[mine][:, None] - points[at][None], axis=2)
        normal[mine] = normals[at][apart.argmin(axis=1)]
    return normal


@njit(cache=True, nogil=True)
def _chords(chord, length, line, first, closed):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Direction (s, 3), share of the length that goes ahead (s,), and passes of the chord (s,)."""
    direction = np.empty((len(line), 3))
    straight, often = np.empty(len(line)), np.empty(len(line))
    for k in range(len(line)):
        low, high = first[line[k]], first[line[k] + 1]
        ring = closed[line[k]] and high - low > 2 * _AHEAD
        x, y, z, whole = 0.0, 0.0, 0.0, 0.0
        for near in range(k - _AHEAD, k + _AHEAD + 1):
            at = low + (near - low) % (high - low) if ring else near
            if low <= at < high:
                x, y, z = x + chord[at, 0], y + chord[at, 1], z + chord[at, 2]
                whole += length[at]
        size = np.sqrt(x * x + y * y + z * z)
        # A strand that turns back within a width takes the direction of its own piece.
        lost = size < 1e-3 * whole
        if lost:
            x, y, z = chord[k, 0], chord[k, 1], chord[k, 2]
        unit = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        x, y, z = x / unit, y / unit, z / unit
        passed = 0.0
        for near in range(k - _AHEAD, k + _AHEAD + 1):
            at = low + (near - low) % (high - low) if ring else near
            if low <= at < high:
                a, b, c = chord[at, 0], chord[at, 1], chord[at, 2]
                piece = max(np.sqrt(a * a + b * b + c * c), 1e-300)
                passed += abs(a * x + b * y + c * z) / piece * length[at]
        direction[k, 0], direction[k, 1], direction[k, 2] = x, y, z
        straight[k] = min(max(size / max(whole, 1e-300), 1e-3), 1.0)
        often[k] = 1e3 if lost else min(max(passed / max(size, 1e-300), 1.0), 1e3)
    return direction, straight, often


# How bands of strands overlap, across each of their parts.


_SLIVER = 1e-9
"""Share of a width below which an overlap counts as rounding error."""


def share_room(
    grid: Buckets,
    middle: FloatArray,
    direction: FloatArray,
    normal: FloatArray,
    ahead: FloatArray,
    often: FloatArray,
    fold: FloatArray,
    layer: IntArray,
    line: IntArray,
    apart: IntArray,
    ring: IntArray,
    width: float,
    height: float,
    same_cosine: float,
) -> FloatArray:
    """Share the room across each part among the bands that cover it.

    A neighbouring part covers a rectangle about its middle: one width wide, and as long as the part
    goes ahead. Parts of the same line count from `apart` parts on; nearer ones are the same band.

    Parameters
    ----------
    grid : Buckets
        The middles.
    middle, direction, normal : (s, 3) arrays
        Of each part, mm and unit vectors.
    ahead : (s,) array, mm
        Distance by which each part goes ahead.
    often, fold : (s,) arrays
        Strands that lie along the band of the part, and strands that its length is equivalent to.
    layer, line : (s,) int arrays
        Of each part; parts come in the order of the lines.
    apart : (s,) int array
        Parts of the same line that are the part's own band, to either side.
    ring : (s,) int array
        Number of parts of the line where it is closed, else 0.
    width, height : float, mm
        Of a strand. Strands of different layers share room where they lie nearer than `height`.
    same_cosine : float
        Cosine of the largest angle between strands of the same direction.

    Returns
    -------
    (s, 4) array
        alone, every, fill and stack of `ccfem.geometry.beads.Beads`.
    """
    half = 0.5 * width
    # Largest distance of a middle whose rectangle can meet the line across a part.
    reach = float(half + np.sqrt(half * half + 0.25 * ahead.max(initial=0.0) ** 2)) * (1.0 + 1e-9)
    return np.asarray(
        _shared(grid.origin, grid.cell, grid.shape, grid.starts, grid.items, middle, direction,
                normal, np.cross(normal, direction), ahead, often, fold, layer, line, apart, ring,
                width, height, same_cosine, reach)
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _shared(  # type: ignore[no-untyped-def]
    origin, cell, shape, starts, items, middle, direction, normal, across, ahead, often, fold,
    layer, line, apart, ring, width, height, same_cosine, reach
):  # fmt: skip  # pragma: no cover
    half = 0.5 * width
    shares = np.empty((len(middle), 4))
    room = 64
    at, change, order = np.empty(room), np.empty((room, 4)), np.empty(room, np.int64)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    current = np.empty(4)
    for k in range(len(middle)):
        for i in range(3):
            low[i] = max(int(np.floor((middle[k, i] - reach - origin[i]) / cell)), 0)
            high[i] = min(int(np.floor((middle[k, i] + reach - origin[i]) / cell)), shape[i] - 1)
        events = 0
        for a in range(low[0], high[0] + 1):
            for b in range(low[1], high[1] + 1):
                for c in range(low[2], high[2] + 1):
                    box = (a * shape[1] + b) * shape[2] + c
                    for item in range(starts[box], starts[box + 1]):
                        other = items[item]
                        square = 0.0
                        for i in range(3):
                            square += (middle[k, i] - middle[other, i]) ** 2
                        if square > reach * reach:
                            continue
                        if line[other] == line[k]:
                            between = abs(other - k)
                            if ring[k]:
                                between = min(between, ring[k] - between)
                            if between < apart[k]:
                                continue
                        # Position of the middle of k along, across and above the other part, and
                        # how these and the direction change along the way across k.
                        along, side, above, turned, shift, cosine = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                        for i in range(3):
                            d = middle[k, i] - middle[other, i]
                            along += d * direction[other, i]
                            side += d * across[other, i]
                            above += d * normal[k, i]
                            turned += across[k, i] * direction[other, i]
                            shift += across[k, i] * across[other, i]
                            cosine += direction[k, i] * direction[other, i]
                        if layer[other] != layer[k] and abs(above) >= height:
                            continue
                        begin, end = _clipped(-half, half, along, turned, 0.5 * ahead[other])
                        begin, end = _clipped(begin, end, side, shift, half)
                        if end - begin <= _SLIVER * width:
                            continue
                        if events + 2 > room:
                            room *= 2
                            at, change, order = _longer(at, change, order, room)
                        beside = often[other] if abs(cosine) >= same_cosine else 0.0
                        for i in range(2):
                            sign = 1.0 - 2.0 * i
                            at[events] = end if i else begin
                            change[events, 0] = sign * beside
                            change[events, 1] = sign * often[other]
                            change[events, 2] = sign * fold[other]
                            change[events, 3] = sign
                            order[events] = events
                            events += 1
        if events == 0:
            shares[k, 0], shares[k, 1] = 1.0 / often[k], 1.0 / often[k]
            shares[k, 2], shares[k, 3] = fold[k], 1.0
            continue
        _sort(order[:events], at)
        current[0], current[1], current[2], current[3] = often[k], often[k], fold[k], 1.0
        alone, every, fill, most, here = 0.0, 0.0, 0.0, 1.0, -half
        for e in range(events + 1):
            following = half if e == events else min(at[order[e]], half)
            step = following - here
            if step > 0.0:
                alone += step / current[0]
                every += step / current[1]
                fill += step * current[2]
                if step > _SLIVER * width:
                    most = max(most, current[3])
                here = following
            if e < events:
                for i in range(4):
                    current[i] += change[order[e], i]
        shares[k, 0], shares[k, 1] = alone / width, every / width
        shares[k, 2], shares[k, 3] = fill / width, most
    return shares


@njit(cache=True, nogil=True)
def _clipped(low, high, value, slope, limit):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Part of [low, high] where ``|value + x slope| < limit``; empty where low is not below."""
    if abs(slope) < 1e-12:
        return (low, high) if -limit <= value < limit else (1.0, 0.0)
    a, b = (-limit - value) / slope, (limit - value) / slope
    return max(low, min(a, b)), min(high, max(a, b))


@njit(cache=True, nogil=True)
def _sort(order, at):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Sort indices by the values they refer to, by insertion: there are few, nearly sorted."""
    for e in range(1, len(order)):
        index = order[e]
        place = e
        while place > 0 and at[order[place - 1]] > at[index]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = index


@njit(cache=True, nogil=True)
def _longer(at, change, order, room):  # type: ignore[no-untyped-def]  # pragma: no cover
    longer, wider = np.empty(room), np.empty((room, 4))
    more = np.empty(room, np.int64)
    for e in range(len(at)):
        longer[e], more[e] = at[e], order[e]
        for i in range(4):
            wider[e, i] = change[e, i]
    return longer, wider, more
