"""Borders of sections along the round walls that they cut, in place of the mesh's chords."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.round_walls import RoundWall, moved_onto
from ccfem.slicing.layers.plane import Plane

_SAGITTA = 0.005
"""Largest distance, mm, of the sides of a ring from the wall that they follow."""
_LEAST = 24
"""Sides of a full circle, at least."""
_ALONG = 1e-9
"""Sine of the angle between the axis of a cylinder and the normal of the plane, up to which the
section is a circle."""
_MOST = 64
"""Pieces that a side is cut into, at most."""


def rounded_rings(
    plane: Plane,
    points: FloatArray,
    loops: Sequence[IntArray],
    walls: Sequence[tuple[RoundWall, IntArray]],
) -> tuple[FloatArray, ...]:
    """Boundary loops of a section with the runs on round walls as the walls have them.

    Parameters
    ----------
    points : (n, 2) array, mm
        Plane coordinates of the section's points.
    loops : sequence of (k,) int arrays
        Boundary loops as point indices.
    walls : sequence of RoundWall and (k, 2) int array
        Round walls, and the boundary edges that are chords of each.

    Returns
    -------
    tuple of (k, 2) arrays, mm
        Plane coordinates of each loop, within 0.005 mm of its walls; the first point is not
        repeated. Their points turn with the part, and are equal for equal walls on all layers.
    """
    of_edge = _by_edge(walls)
    rings = []
    for loop in loops:
        sides = zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True)
        wall = np.array([of_edge.get(side, -1) for side in sides])
        rings.append(points[loop] if (wall < 0).all() else _ring(plane, points[loop], wall, walls))
    return tuple(rings)


def charted_rings(
    points: FloatArray,
    image: FloatArray,
    triangles: IntArray,
    turns: FloatArray,
    loops: Sequence[IntArray],
    walls: Sequence[tuple[RoundWall, IntArray]],
) -> tuple[FloatArray, ...]:
    """Boundary loops of a curved layer in its chart, along the round walls where they lie on some.

    Places between the points of a chord are moved onto the wall within the triangle's plane, and
    into the chart as the triangle is.

    Parameters
    ----------
    points : (n, 3) array, mm
        Of the layer.
    image : (n, 2) array, mm
        The same in the chart.
    triangles : (t, 3) int array
    turns : (t, 3, 3) array
        First two rows: what the map of each triangle makes x and y of; last: its unit normal.
    loops, walls
        As of `rounded_rings`.

    Returns
    -------
    tuple of (k, 2) arrays, mm
        Each loop in the chart; the first point is not repeated.
    """
    sides = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    triangle_of = dict(zip(map(tuple, sides.tolist()), np.arange(len(sides)) // 3, strict=True))
    round_walls = [wall for wall, _ in walls]
    of_edge = _by_edge(walls)
    rings = []
    for loop in loops:
        edges = list(zip(loop.tolist(), np.roll(loop, -1).tolist(), strict=True))
        wall = np.array([of_edge.get(edge, -1) for edge in edges])
        if (wall < 0).all():
            rings.append(image[loop])
            continue
        turn = turns[[triangle_of[edge] for edge in edges]]
        # Points with chords of one wall on both sides lie on mesh edges, which are chords too.
        inner = (wall >= 0) & (wall == np.roll(wall, 1))
        corners = points[loop].copy()
        corners[inner] = moved_onto(round_walls, wall[inner], corners[inner], flat=turn[inner, 2])
        following = np.roll(corners, -1, axis=0)
        middle = 0.5 * (corners + following)
        sagitta = np.linalg.norm(
            moved_onto(round_walls, wall, middle, flat=turn[:, 2]) - middle, axis=1
        )
        count = np.where(wall < 0, 1, np.clip(np.ceil(np.sqrt(sagitta / _SAGITTA)), 1, _MOST))
        first = np.repeat(np.arange(len(loop)), count.astype(int))
        share = np.concatenate([np.arange(n) / n for n in count.astype(int)])[:, None]
        places = (1.0 - share) * corners[first] + share * following[first]
        between = share[:, 0] > 0.0
        places[between] = moved_onto(
            round_walls, wall[first[between]], places[between], flat=turn[first[between], 2]
        )
        away = places - points[loop[first]]
        rings.append(image[loop[first]] + np.einsum("kij,kj->ki", turn[first, :2], away))
    return tuple(rings)


def _by_edge(walls: Sequence[tuple[RoundWall, IntArray]]) -> dict[tuple[int, int], int]:
    """Return the number of the wall of each boundary edge, in both senses."""
    return {
        (start, end): k
        for k, (_, edges) in enumerate(walls)
        for start, end in np.concatenate([edges, edges[:, ::-1]]).tolist()
    }


def _ring(
    plane: Plane,
    corners: FloatArray,
    wall: IntArray,
    walls: Sequence[tuple[RoundWall, IntArray]],
) -> FloatArray:
    """Ring of corners (k, 2) whose sides lie on walls (k,), -1 for none."""
    changes = np.flatnonzero(wall != np.roll(wall, 1))
    if not len(changes):
        return _wall_curve(plane, np.concatenate([corners, corners[:1]]), walls[wall[0]][0])[:-1]
    pieces = []
    # From one change of wall to the next; each run leaves its last point to the next one.
    for start, stop in zip(changes, np.append(changes[1:], changes[0] + len(corners)), strict=True):
        run = corners[np.arange(start, stop + 1) % len(corners)]
        k = wall[start]
        pieces.append((run if k < 0 else _wall_curve(plane, run, walls[k][0]))[:-1])
    return np.concatenate(pieces)


def _wall_curve(plane: Plane, run: FloatArray, wall: RoundWall) -> FloatArray:
    """Curve (k, 2) of a wall from the first to the last point of a run (k, 2) of chords."""
    along = np.linalg.norm(np.cross(wall.direction, plane.frame[2]))
    if wall.slope == 0.0 and wall.direction.any() and along < _ALONG:
        start = run[0] if wall.start is None else plane.project(wall.start)
        return _arc(run, plane.project(wall.centre), wall.radius, start)
    closed = np.array_equal(run[0], run[-1])
    inner = _onto_wall(plane, run[:-1] if closed else run[1:-1], wall)
    run = np.concatenate([inner, inner[:1]] if closed else [run[:1], inner, run[-1:]])
    # As many points between two as keep the sides near the wall: their distance falls by squares.
    middle = 0.5 * (run[1:] + run[:-1])
    sagitta = np.linalg.norm(_onto_wall(plane, middle, wall) - middle, axis=1)
    count = np.clip(np.ceil(np.sqrt(sagitta / _SAGITTA)), 1, _MOST).astype(int)
    share = np.concatenate([np.arange(n) / n for n in count])[:, None]
    first = np.repeat(np.arange(len(count)), count)
    between = _onto_wall(plane, (1.0 - share) * run[first] + share * run[first + 1], wall)
    between[share[:, 0] == 0.0] = run[:-1]
    return np.concatenate([between, run[-1:]])


def _arc(run: FloatArray, centre: FloatArray, radius: float, start: FloatArray) -> FloatArray:
    """Arc (k, 2) of a circle along a run: even steps from end to end, or round from a start."""
    half = np.arccos(max(1.0 - _SAGITTA / radius, np.cos(np.pi / _LEAST)))
    if np.array_equal(run[0], run[-1]):
        arm = start - centre
        ring = shapely.Polygon(run)
        turn = 2.0 * np.pi if ring.exterior.is_ccw else -2.0 * np.pi
        count = 4 * int(np.ceil(np.pi / 4.0 / half))
        # Half a step on: at the start itself corners meet ties of patterns along the axes.
        angle = np.arctan2(arm[1], arm[0]) + turn * (np.arange(count + 1) + 0.5) / count
        return np.asarray(centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    arm = run - centre
    angle = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    count = max(int(np.ceil(abs(angle[-1] - angle[0]) / (2.0 * half) - 1e-9)), 1)
    inner = np.linspace(angle[0], angle[-1], count + 1)[1:-1]
    places = centre + radius * np.stack([np.cos(inner), np.sin(inner)], axis=1)
    return np.concatenate([run[:1], places, run[-1:]])


def _onto_wall(plane: Plane, places: FloatArray, wall: RoundWall) -> FloatArray:
    """Places (k, 2) moved onto a wall within the plane."""
    flat = np.tile(plane.frame[2], (len(places), 1))
    space = plane.to_space(places)
    moved = moved_onto([wall], np.zeros(len(places), dtype=np.int64), space, flat=flat)
    return np.asarray(plane.project(moved))
