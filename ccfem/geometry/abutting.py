"""Ends of strands that abut the side of another strand, cut back to a width from its middle."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import (
    along_line,
    is_closed,
    line_length,
    points_along,
    straight_pieces,
)

_MOST = 1.25
"""Largest length cut off an end, in distances: a strand that meets another at less than about 25
degrees runs along it, not into it."""
_STEPS = 26
_ENOUGH = 0.995
"""Share of the distance that is sufficient: strands are laid to half a per cent of their width."""
_END = 1e-6
"""Distance, mm, up to which the nearest point of a strand counts as its end."""


def clear_ends(lines: Sequence[FloatArray], distance: float, first: int = 0) -> list[FloatArray]:
    """Lines whose open ends stop at a given distance from the sides of others.

    An end is cut back only as far as needed, and not at all if a cut of little more than the
    distance is not enough. Ends of other lines do not matter, since they may be joined to it.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        Closed ones repeat their first point and are not changed.
    distance : float, mm
        From the end to the middle of other lines.
    first : int, default 0
        Lines before this one are not changed.
    """
    cut = list(lines)
    tips = [
        (k, end)
        for k in range(first, len(lines))
        if not is_closed(lines[k]) and line_length(lines[k]) > 4.0 * distance
        for end in (0, -1)
    ]
    if not tips:
        return cut
    back = np.linspace(0.0, _MOST * distance, _STEPS)
    places = np.stack([_places(lines[k], end, back) for k, end in tips])
    gap = _gaps(lines, places, np.array([k for k, _ in tips]), distance)
    far = gap >= _ENOUGH * distance
    for (k, end), reached, room in zip(tips, far, gap, strict=True):
        step = int(np.argmax(reached))
        if reached[step] and step:
            share = (_ENOUGH * distance - room[step - 1]) / (room[step] - room[step - 1])
            length = back[step - 1] + share * (back[step] - back[step - 1])
            cut[k] = _without_end(cut[k], end, float(length))
    return cut


def _places(line: FloatArray, end: int, back: FloatArray) -> FloatArray:
    """Points (n, 2) of a line at lengths before one of its ends."""
    head = line if end == 0 else line[::-1]
    return points_along(head, along_line(head), back)


def _without_end(line: FloatArray, end: int, length: float) -> FloatArray:
    """Line without a given length at one of its ends."""
    head = line if end == 0 else line[::-1]
    along = along_line(head)
    start = points_along(head, along, np.array([length]))
    rest = np.concatenate([start, head[along > length + _END]])
    return rest if end == 0 else rest[::-1]


def _gaps(
    lines: Sequence[FloatArray], places: FloatArray, owner: FloatArray, distance: float
) -> FloatArray:
    """Distance (t, n) of places (t, n, 2) to the sides of other lines, at most twice `distance`."""
    sides = straight_pieces(lines)
    sizes = np.array([len(line) - 1 for line in lines])
    of_side = np.repeat(np.arange(len(lines)), sizes)
    last = np.cumsum(sizes) - 1
    opened = np.array([not is_closed(line) for line in lines])
    starts, stops = np.zeros((2, len(sides)), dtype=bool)
    starts[(last - sizes + 1)[opened]], stops[last[opened]] = True, True
    flat = places.reshape(-1, 2)
    at, side = shapely.STRtree(shapely.linestrings(sides)).query(
        shapely.points(flat), predicate="dwithin", distance=2.0 * distance
    )
    foreign = of_side[side] != owner[at // places.shape[1]]
    at, side = at[foreign], side[foreign]
    way, off = sides[side, 1] - sides[side, 0], flat[at] - sides[side, 0]
    size = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    run = np.einsum("ij,ij->i", off, way) / size
    beyond = (starts[side] & (run < _END)) | (stops[side] & (run > size - _END))
    foot = sides[side, 0] + (np.clip(run, 0.0, size) / size)[:, None] * way
    gap = np.full(len(flat), 2.0 * distance)
    near = np.linalg.norm(flat[at] - foot, axis=1)
    np.minimum.at(gap, at[~beyond], near[~beyond])
    return gap.reshape(places.shape[:2])
