"""Free ends of strands, extended straight to the strand or the border ahead of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import is_closed, line_length, straight_pieces
from ccfem.geometry.shapes import Region

_STEEPEST = 25.0
"""Least angle, degrees, at which an extended strand may meet what is ahead. A strip between strands
that run side by side gets another strand along its middle instead."""
_LEAST = 0.3
"""Minimum length, in pitches, by which an end is extended."""


def strips(lines: Sequence[FloatArray], pitch: float) -> Region:
    """Area of strands a pitch wide each, with ends cut square: a (Multi)Polygon, mm."""
    found = shapely.buffer(
        shapely.multilinestrings([shapely.LineString(line) for line in lines]),
        0.5 * pitch,
        cap_style="flat",
        join_style="mitre",
        mitre_limit=1.5,
    )
    if shapely.is_valid(found):
        return found
    # Mitred corners may leave a border that touches itself, for which differences would fail.
    parts = shapely.get_parts(shapely.make_valid(found))
    areas = parts[shapely.get_dimensions(parts) == 2]
    return shapely.union_all(areas)


def extend_free_ends(
    lines: Sequence[FloatArray], region: Region, pitch: float, closest: float, reach: float
) -> tuple[list[FloatArray], Region]:
    """Extend the free ends of strands straight to what lies ahead, if that is near.

    If two extensions compete for the same place, the longer strand goes first.

    Parameters
    ----------
    lines : sequence of (k, 2) arrays, mm
        Closed ones repeat their first point, and stay as they are.
    region : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Width that each strand takes.
    closest : float
        Minimum distance of the sides of strands, in pitches.
    reach : float, mm
        Maximum length by which an end is extended.

    Returns
    -------
    lines : list of (k, 2) arrays, mm
        In the order of those given.
    rest : shapely (Multi)Polygon, mm
        Region without the strips of the strands.
    """
    led = list(lines)
    rest = shapely.difference(region, strips(lines, pitch)) if led else region
    ends = _free_ends(lines, pitch)
    if not ends:
        return led, rest
    here = np.array([lines[number][end] for number, end in ends])
    along = here - np.array([lines[number][1 if end == 0 else -2] for number, end in ends])
    along /= np.linalg.norm(along, axis=1)[:, None]
    slack = (closest - 0.5) * pitch
    room = shapely.buffer(rest, -slack, join_style="mitre")
    start = here + 1.01 * slack * along
    rays = shapely.linestrings(np.stack([start, here + reach * along], axis=1))
    ahead = _Obstacles.of(lines, region, pitch)
    ways: list[shapely.LineString] = []
    whole = _parts_round(rest, start)
    for k, space in _parts_round(room, start).items():
        free = whole.get(k, shapely.Polygon())
        rivals = [way for way in ways if way.distance(rays[k]) < (closest + 0.5) * pitch]
        if rivals:
            taken = shapely.buffer(shapely.union_all(rivals), 0.5 * pitch, cap_style="flat")
            free = shapely.difference(free, taken)
            space = shapely.buffer(free, -slack, join_style="mitre")
        stop = _first_exit(rays[k], space)
        if stop is not None:
            # The sides of a strand keep their distance; its end may reach what is ahead.
            tail = shapely.LineString([start[k], stop + 1.4 * slack * along[k]])
            stop = _first_exit(tail, free)
        if stop is None or np.linalg.norm(stop - here[k]) < _LEAST * pitch:
            continue
        number, end = ends[k]
        if ahead.angle(stop, along[k], number) >= np.radians(_STEEPEST):
            ways.append(shapely.LineString([here[k], stop]))
            led[number] = np.insert(led[number], 0 if end == 0 else len(led[number]), stop, axis=0)
    tails = [shapely.get_coordinates(way) for way in ways]
    return led, shapely.difference(rest, strips(tails, pitch)) if tails else rest


def _free_ends(lines: Sequence[FloatArray], pitch: float) -> list[tuple[int, int]]:
    """Line and index (0 or -1) of every end of the open lines, the longest line first."""
    size = np.array([line_length(line) for line in lines])
    order = np.argsort(-np.round(size / pitch, 3), kind="stable")
    return [(int(k), end) for k in order if not is_closed(lines[k]) for end in (0, -1)]


def _parts_round(area: Region, points: FloatArray) -> dict[int, shapely.Polygon]:
    """Part of an area round each of several points (k, 2) that has one."""
    parts = shapely.get_parts(area)
    point, part = shapely.STRtree(parts).query(shapely.points(points), predicate="within")
    return dict(zip(point.tolist(), parts[part], strict=True))


def _first_exit(ray: shapely.LineString, space: Region) -> FloatArray | None:
    """Point where a straight ray first leaves a region; None if it starts outside."""
    start = shapely.get_point(ray, 0)
    for part in shapely.get_parts(shapely.intersection(ray, space)):
        if part.geom_type == "LineString" and part.distance(start) < 1e-9:
            ends = shapely.get_coordinates(part)[[0, -1]]
            gap = np.linalg.norm(ends - shapely.get_coordinates(start), axis=1)
            return np.asarray(ends[np.argmax(gap)], dtype=np.float64)
    return None


@dataclass(frozen=True)
class _Obstacles:
    """Straight pieces of strands and of the border, with the strand of each, -1 for the border."""

    tree: shapely.STRtree
    along: FloatArray
    owner: IntArray
    half: float

    @classmethod
    def of(cls, lines: Sequence[FloatArray], region: Region, pitch: float) -> "_Obstacles":
        border = rings(region)
        curves = [*lines, *border]
        pairs = straight_pieces(curves)
        owner = np.concatenate([np.arange(len(lines)), np.full(len(border), -1)])
        along = pairs[:, 1] - pairs[:, 0]
        along = along / np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
        sizes = [len(c) - 1 for c in curves]
        tree = shapely.STRtree(shapely.linestrings(pairs))
        return cls(tree, along, np.repeat(owner, sizes), 0.5 * pitch)

    def angle(self, point: FloatArray, way: FloatArray, own: int) -> float:
        """Acute angle, radians, between a way and the nearest piece ahead; 0 where none is near."""
        here = shapely.Point(point)
        found = self.tree.query(here, predicate="dwithin", distance=1.2 * self.half)
        found = found[self.owner[found] != own]
        if not len(found):
            return 0.0
        gap = shapely.distance(self.tree.geometries[found], here)
        # The border is the edge of a strand, half a pitch before its middle.
        gap = gap + np.where(self.owner[found] < 0, self.half, 0.0)
        x, y = self.along[found[np.argmin(gap)]]
        return float(abs(np.arcsin(np.clip(way[0] * y - way[1] * x, -1.0, 1.0))))
