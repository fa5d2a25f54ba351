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

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, seen_only
from ccfem.base.compiled import compiled
from ccfem.geometry.locate import Buckets, bucket
from ccfem.geometry.polylines import lengths, resample, starts_segment

SAME_DIRECTION = np.radians(30.0)
"""Largest angle, radians, between strands that lie side by side and do not cross."""
_SAME_COSINE = float(np.cos(SAME_DIRECTION))

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
    shared: bool = True,
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
    shared : bool, default True
        Whether the room is found, which takes most of the time; else it is NaN.
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
    # Direction of each part in the plane of its layer.
    normal = _layer_normals(points, normals, offsets, middle, line)
    chord = nodes[start + 1] - nodes[start]
    direction, straight, often = np.empty_like(chord), np.empty(len(line)), np.empty(len(line))
    _chords(chord, length, line, first, seen_only(closed), direction, straight, often)
    direction = direction - np.einsum("ij,ij->i", direction, normal)[:, None] * normal
    direction /= np.maximum(np.linalg.norm(direction, axis=1), 1e-300)[:, None]
    if not shared:
        unknown = np.full((4, len(line)), np.nan)
        return Beads(line, first, length, middle, direction, normal, *unknown)
    steps = np.ceil(width * (1.0 - 1e-9) / np.maximum(length, 1e-300)).clip(1, 1e9)
    bands = _Bands(
        middle,
        direction,
        normal,
        np.cross(normal, direction),
        length * straight,
        often,
        1.0 / straight,
        layer[line],
        line,
        steps.astype(np.int64),
        np.where(closed, count, 0)[line],
    )
    # Largest distance of a middle whose rectangle can meet the line across a part.
    half, longest = 0.5 * width, bands.ahead.max(initial=0.0)
    reach = float(half + np.sqrt(half * half + 0.25 * longest**2)) * (1.0 + 1e-9)
    shares = _shared(bucket(middle, middle, 1.05 * width), bands, width, height, reach)
    return Beads(line, first, length, middle, direction, normal, *shares.T)


def _layer_normals(
    points: FloatArray, normals: FloatArray, offsets: IntArray, middle: FloatArray, line: IntArray
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


@compiled
def _chords(
    chord: FloatArray,
    length: FloatArray,
    line: IntArray,
    first: IntArray,
    closed: BoolArray,
    direction: FloatArray,
    straight: FloatArray,
    often: FloatArray,
) -> None:  # pragma: no cover
    """Write directions (s, 3), shares of the length that go ahead, and passes of the chord (s,)."""
    for k in range(len(line)):
        low, high = first[line[k]], first[line[k] + 1]
        ring = closed[line[k]] and high - low > 2 * _AHEAD
        # The chord over a width: what the strand gets ahead by, of the whole length that it runs.
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
        # Its passes: the length along the chord, forth and back, over what it gets ahead by.
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


# How bands of strands overlap, across each of their parts.


_SLIVER = 1e-9
"""Share of a width below which an overlap counts as rounding error."""


class _Bands(NamedTuple):
    """Parts of strands with the rectangles that they cover: a width wide, about their middles.

    `middle`, `direction`, `normal` and `across` (s, 3), mm and unit vectors; `ahead` (s,), mm, the
    length of the rectangle; `often` and `fold` (s,), the strands that lie along the band and those
    that the length of the part is equivalent to; `layer` and `line` (s,) of each part, the parts of
    a line one after the other; `apart` (s,), the number of parts of its line, to either side, that
    are its own band; `ring` (s,), the number of parts of a closed line, else 0.
    """

    middle: FloatArray
    direction: FloatArray
    normal: FloatArray
    across: FloatArray
    ahead: FloatArray
    often: FloatArray
    fold: FloatArray
    layer: IntArray
    line: IntArray
    apart: IntArray
    ring: IntArray


@compiled
def _shared(
    grid: Buckets, bands: _Bands, width: float, height: float, reach: float
) -> FloatArray:  # pragma: no cover
    """Columns alone, every, fill and stack of `Beads`, (s, 4)."""
    count = len(bands.middle)
    shares = np.empty((count, 4))
    # A band begins and ends at most once across a part. Memory that is not written costs nothing.
    at, change = np.empty(2 * count), np.empty((2 * count, 4))
    order = np.empty(2 * count, np.int64)
    for k in range(count):
        events = _edges(k, grid, bands, width, height, reach, at, change)
        for e in range(events):
            order[e] = e
        _sort(order[:events], at)
        _integrate(bands.often[k], bands.fold[k], width, at, change, order[:events], shares[k])
    return shares


@compiled
def _edges(
    k: int,
    grid: Buckets,
    bands: _Bands,
    width: float,
    height: float,
    reach: float,
    at: FloatArray,
    change: FloatArray,
) -> int:  # pragma: no cover
    """Places across a part where bands begin and end, and what changes there; their number.

    Changes are of the strands of its direction, the strands, the length and the bands over it.
    """
    half, events, middle = 0.5 * width, 0, bands.middle
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    for i in range(3):
        low[i] = max(int(np.floor((middle[k, i] - reach - grid.origin[i]) / grid.cell)), 0)
        last = int(np.floor((middle[k, i] + reach - grid.origin[i]) / grid.cell))
        high[i] = min(last, grid.shape[i] - 1)
    for a in range(low[0], high[0] + 1):
        for b in range(low[1], high[1] + 1):
            # Boxes along the third axis are numbered one after the other.
            row = (a * grid.shape[1] + b) * grid.shape[2]
            for item in range(grid.starts[row + low[2]], grid.starts[row + high[2] + 1]):
                other = grid.items[item]
                square, cosine = 0.0, 0.0
                for i in range(3):
                    square += (middle[k, i] - middle[other, i]) ** 2
                    cosine += bands.direction[k, i] * bands.direction[other, i]
                if square > reach * reach or _same_band(k, other, bands):
                    continue
                begin, end = _covered(k, other, bands, half, height)
                if end - begin <= _SLIVER * width:
                    continue
                beside = bands.often[other] if abs(cosine) >= _SAME_COSINE else 0.0
                for i in range(2):
                    sign = 1.0 - 2.0 * i
                    at[events] = end if i else begin
                    change[events, 0] = sign * beside
                    change[events, 1] = sign * bands.often[other]
                    change[events, 2] = sign * bands.fold[other]
                    change[events, 3] = sign
                    events += 1
    return events


@compiled
def _same_band(k: int, other: int, bands: _Bands) -> bool:  # pragma: no cover
    """Whether two parts lie so near each other along one line that they are the same band."""
    if bands.line[other] != bands.line[k]:
        return False
    between = abs(other - k)
    if bands.ring[k]:
        between = min(between, bands.ring[k] - between)
    return between < bands.apart[k]


@compiled
def _covered(
    k: int, other: int, bands: _Bands, half: float, height: float
) -> tuple[float, float]:  # pragma: no cover
    """Interval across a part, about its middle, within the rectangle of another; or none."""
    # Position of the middle of k along, across and above the other part, and how the first two
    # change along the way across k.
    along, side, above, turned, shift = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        d = bands.middle[k, i] - bands.middle[other, i]
        along += d * bands.direction[other, i]
        side += d * bands.across[other, i]
        above += d * bands.normal[k, i]
        turned += bands.across[k, i] * bands.direction[other, i]
        shift += bands.across[k, i] * bands.across[other, i]
    if bands.layer[other] != bands.layer[k] and abs(above) >= height:
        return 0.0, 0.0
    begin, end = _clipped(-half, half, along, turned, 0.5 * bands.ahead[other])
    return _clipped(begin, end, side, shift, half)


@compiled
def _integrate(
    often: float,
    fold: float,
    width: float,
    at: FloatArray,
    change: FloatArray,
    order: IntArray,
    shares: FloatArray,
) -> None:  # pragma: no cover
    """Write the shares of a part: its room is the mean of 1 / m(x) over its width."""
    half = 0.5 * width
    if not len(order):
        shares[0], shares[1], shares[2], shares[3] = 1.0 / often, 1.0 / often, fold, 1.0
        return
    # What lies over the part at `here`: strands of its direction, strands, length and bands.
    beside, strands, length, bands = often, often, fold, 1.0
    alone, every, fill, most, here = 0.0, 0.0, 0.0, 1.0, -half
    for e in range(len(order) + 1):
        following = half if e == len(order) else min(at[order[e]], half)
        step = following - here
        if step > 0.0:
            alone += step / beside
            every += step / strands
            fill += step * length
            if step > _SLIVER * width:
                most = max(most, bands)
            here = following
        if e < len(order):
            beside += change[order[e], 0]
            strands += change[order[e], 1]
            length += change[order[e], 2]
            bands += change[order[e], 3]
    shares[0], shares[1], shares[2], shares[3] = alone / width, every / width, fill / width, most


@compiled
def _clipped(
    low: float, high: float, value: float, slope: float, limit: float
) -> tuple[float, float]:  # pragma: no cover
    """Part of [low, high] where ``|value + x slope| < limit``; empty where low is not below."""
    if abs(slope) < 1e-12:
        return (low, high) if -limit <= value < limit else (1.0, 0.0)
    a, b = (-limit - value) / slope, (limit - value) / slope
    return max(low, min(a, b)), min(high, max(a, b))


@compiled
def _sort(order: IntArray, at: FloatArray) -> None:  # pragma: no cover
    """Sort indices by the values they refer to, by insertion: there are few, nearly sorted."""
    for e in range(1, len(order)):
        index = order[e]
        place = e
        while place > 0 and at[order[place - 1]] > at[index]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = index
