"""Nested closed strands joined to one spiral, so that the fibre is cut once instead of for each."""

from collections.abc import Callable, Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import is_closed
from ccfem.geometry.shapes import Region
from ccfem.paths.linking.possible_links import ring_arc

_STRIDE = 4
"""Distance, in points, between the places of a ring that are tried for the seam."""


def spiral(
    lines: Sequence[FloatArray],
    limit: float,
    cost: Callable[[FloatArray], FloatArray],
    section: Region,
) -> list[FloatArray]:
    """Join nested closed lines to spirals.

    Each ring is opened beside the next, and a slanted piece leads from one to the other. The place
    is where `cost` along the outermost ring is least. The gap is two and a half times the local
    distance between the rings, so that the path turns by about 20 degrees only.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        Open ones are returned as they are.
    limit : float, mm
        Largest distance between rings that are joined.
    cost : callable
        Maps points (k, 2) to values (k,): the cost of disturbing the strand there.
    section : shapely (Multi)Polygon
        The connecting pieces stay inside it.

    Returns
    -------
    list of (n, 2) arrays
        First open lines in their order, then rings and spirals from the outside in.
    """
    closed = [k for k, line in enumerate(lines) if is_closed(line)]
    rings = [_counter_clockwise(lines[k]) for k in closed]
    kept = [line for k, line in enumerate(lines) if k not in set(closed)]
    obstacles = [shapely.linestrings(line) for line in kept]
    for chain in _nested_chains(rings, limit):
        left = []
        while chain:  # drop the innermost ring until the rest can be wound
            joined = _wind([rings[k] for k in chain], limit, cost)
            if joined is not None and _fits(joined, obstacles, section):
                kept.append(joined)
                break
            left.append(rings[chain.pop()])
        kept += left
    return kept


def _counter_clockwise(ring: FloatArray) -> FloatArray:
    x, y = ring.T
    return ring if float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) > 0.0 else ring[::-1]


def _nested_chains(rings: list[FloatArray], limit: float) -> list[list[int]]:
    """Chains of rings, each inside the one before and near to it, from the outside in."""
    areas = [shapely.Polygon(ring) for ring in rings]
    shapely.prepare(areas)
    chains: list[list[int]] = []
    for k in sorted(range(len(rings)), key=lambda k: -areas[k].area):
        around = [
            chain
            for chain in chains
            if shapely.contains(areas[chain[-1]], areas[k])
            and shapely.dwithin(areas[chain[-1]].exterior, areas[k].exterior, limit)
        ]
        if around:
            min(around, key=lambda chain: areas[chain[-1]].area).append(k)
        else:
            chains.append([k])
    return chains


def _wind(
    rings: list[FloatArray], limit: float, cost: Callable[[FloatArray], FloatArray]
) -> FloatArray | None:
    """Return one open line through all rings, or None if they are nowhere near enough."""
    if len(rings) < 2:
        return None
    strings = [shapely.LinearRing(ring) for ring in rings]
    places = rings[0][::_STRIDE]
    near = shapely.dwithin(strings[1], shapely.points(places), limit)
    if not near.any():
        return None
    seam = shapely.points(places[near][np.argmin(cost(places[near]))])
    pieces = []
    for k, string in enumerate(strings):
        neighbour = strings[k + 1] if k + 1 < len(strings) else strings[k - 1]
        gap = 2.5 * float(shapely.distance(neighbour, seam))
        if gap > 2.5 * limit or gap > 0.5 * string.length:
            return None
        place = float(shapely.line_locate_point(string, seam))
        start = (place + 0.5 * gap) % string.length
        pieces.append(ring_arc(string, start, string.length - gap))
        if k + 1 < len(strings):
            seam = shapely.points(
                shapely.get_coordinates(shapely.shortest_line(strings[k + 1], seam))[0]
            )
    return np.concatenate(pieces)


def _fits(line: FloatArray, obstacles: list[shapely.LineString], section: Region) -> bool:
    string = shapely.linestrings(line)
    return bool(
        shapely.is_simple(string)
        and shapely.covers(section, string)
        and not shapely.intersects(string, obstacles).any()
    )
