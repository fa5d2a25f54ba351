"""How bands of strands overlap, across each of their parts."""

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.buckets import Buckets

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
    found = np.empty((len(middle), 4))
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
            found[k, 0], found[k, 1] = 1.0 / often[k], 1.0 / often[k]
            found[k, 2], found[k, 3] = fold[k], 1.0
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
        found[k, 0], found[k, 1] = alone / width, every / width
        found[k, 2], found[k, 3] = fill / width, most
    return found


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
