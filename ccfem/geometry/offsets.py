"""Offsets of a section from its border, and rings joined into one path."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import along_line, line_length
from ccfem.geometry.shapes import Region

_QUARTER = 8
"""Segments per quarter turn where an opened corner is rounded."""

_SAME = 1e-9
"""Points nearer than this, mm, are one."""

_RAMPS = (2.0, 1.0, 0.0)
"""Lengths that are tried for the ramp between rings, over their spacing: turns of 27, 45 and 90
degrees."""


def inset(section: Region, distance: float, width: float = 0.0) -> Region:
    """Part of a section that keeps a distance from its border.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    distance : float, mm
        Distance to the border, >= 0. Corners are kept (mitre joins).
    width : float, mm, default 0
        With a width, only what a disc of that diameter reaches is kept (morphological opening).
        Opposite sides of the result are then at least that far apart. The tolerance of 0.1 % keeps
        parts of exactly that width.

    Returns
    -------
    shapely (Multi)Polygon, mm
        Empty where nothing is left.
    """
    radius = 0.4995 * width
    inner = shapely.buffer(section, -(distance + radius), join_style="mitre")
    if width > 0.0:
        inner = shapely.buffer(inner, radius, quad_segs=_QUARTER)
    return inner


def rings(section: Region) -> list[FloatArray]:
    """Border rings of a (Multi)Polygon as closed (k, 2) polylines, material on the left, mm."""
    boundaries = []
    for part in shapely.get_parts(section):
        if part.is_empty:
            continue
        part = orient(part)
        boundaries += [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
    return boundaries


def offset_rings(
    section: Region, first: float, spacing: float, width: float, count: int | None = None
) -> list[list[FloatArray]]:
    """Rings parallel to the border of a section, each measured from the border itself.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
    first : float, mm
        Distance of the first ring to the border.
    spacing : float, mm
        Distance of neighbouring rings, > 0.
    width : float, mm
        Least distance between opposite sides of one ring; a gap remains where the section is
        narrower.
    count : int, optional
        Number of rings; by default as many as fit.

    Returns
    -------
    list of lists of (k, 2) arrays, mm
        Closed rings of each offset, from the border inward.
    """
    levels: list[list[FloatArray]] = []
    while count is None or len(levels) < count:
        level = rings(inset(section, first + len(levels) * spacing, width))
        if not level:
            break
        levels.append(level)
    return levels


def ring_from(ring: FloatArray, start: FloatArray) -> FloatArray:
    """Return a closed ring (k, 2) that starts at its point nearest to `start` (2,), mm."""
    a, step = ring[:-1], np.diff(ring, axis=0)
    squared = np.maximum(np.einsum("ij,ij->i", step, step), 1e-300)
    t = np.clip(np.einsum("ij,ij->i", start - a, step) / squared, 0.0, 1.0)
    foot = a + t[:, None] * step
    k = int(np.argmin(np.einsum("ij,ij->i", foot - start, foot - start)))
    turned = np.concatenate([foot[k : k + 1], ring[k + 1 :], ring[1 : k + 1], foot[k : k + 1]])
    keep = np.ones(len(turned), dtype=bool)
    keep[1:-1] = (np.abs(turned[1:-1] - turned[:-2]) > _SAME).any(axis=1)
    keep[1:-1] &= (np.abs(turned[1:-1] - turned[-1]) > _SAME).any(axis=1)
    return turned[keep]


def join_rings(
    levels: Sequence[Sequence[FloatArray]], start: FloatArray, spacing: float, gap: float
) -> list[FloatArray]:
    """Join nested rings by ramps, so that one strand lays several of them.

    Each ring is opened for a `gap` before its start and for the ramp to the ring one level further
    in. A ring without a partner stays closed. Ramps that would touch a ring are left out.

    Parameters
    ----------
    levels : sequence of sequences of (k, 2) arrays, mm
        As from `offset_rings`.
    start : (2,) array, mm
        The outermost rings start at their points nearest to it.
    spacing : float, mm
        Distance of neighbouring levels.
    gap : float, mm
        Distance kept between the end and the start of a ring.

    Returns
    -------
    list of (k, 2) arrays, mm
        Single rings are closed.
    """
    chains: list[list[FloatArray]] = []
    growing: list[list[FloatArray]] = []
    # Each chain goes on to a ring of the next level that it has not been given; others begin
    # chains.
    for depth, level in enumerate(levels):
        near = [ring for rung in levels[max(depth - 1, 0) : depth + 1] for ring in rung]
        walls = shapely.multilinestrings([shapely.linestrings(ring) for ring in near])
        free = list(level)
        following = []
        for chain in growing:
            ramp = _ramp(chain[-1], free, spacing, gap, walls)
            if ramp is None:
                continue
            opened, inner, taken = ramp
            chain[-1:] = [opened, inner]
            del free[taken]
            following.append(chain)
        fresh = [[ring_from(ring, start)] for ring in free]
        chains += fresh
        growing = following + fresh
    return [
        chain[0]
        if len(chain) == 1
        else np.concatenate([*chain[:-1], _until(chain[-1], line_length(chain[-1]) - gap)])
        for chain in chains
    ]


def _ramp(
    ring: FloatArray,
    inner: Sequence[FloatArray],
    spacing: float,
    gap: float,
    walls: shapely.MultiLineString,
) -> tuple[FloatArray, FloatArray, int] | None:
    """`ring` opened, the nearest ring of the next level from its start, and its position there."""
    length, longest = line_length(ring), gap + _RAMPS[0] * spacing
    if not inner or length < 2.0 * longest:
        return None
    landing = _until(ring, length - gap)[-1]
    curves = [shapely.linestrings(other) for other in inner]
    distances = shapely.distance(curves, shapely.points(landing))
    nearest = int(np.argmin(distances))
    partner = ring_from(inner[nearest], landing)
    if distances[nearest] > 1.5 * spacing or line_length(partner) < 2.0 * longest:
        return None
    for ramp in _RAMPS:
        opened = _until(ring, length - gap - ramp * spacing)
        ends = np.stack([opened[-1], partner[0]])
        between = ends + np.array([[1e-3], [-1e-3]]) * (ends[1] - ends[0])
        if not shapely.intersects(shapely.linestrings(between), walls):
            return opened, partner, nearest
    return None


def _until(line: FloatArray, distance: float) -> FloatArray:
    """Part of a polyline up to a distance along it."""
    along = along_line(line)
    k = int(np.searchsorted(along, distance))
    t = (distance - along[k - 1]) / (along[k] - along[k - 1])
    return np.concatenate([line[:k], [line[k - 1] + t * (line[k] - line[k - 1])]])
