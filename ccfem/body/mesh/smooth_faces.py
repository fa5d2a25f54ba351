"""Smooth faces of a boundary, as a designer sees them: planes, round walls, others."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.body.mesh.round_walls import RoundWall
from ccfem.geometry.facets import areas_and_normals, connected, facet_keys

FEATURE_ANGLE = 30.0
"""Angle between facets, degrees, from which an edge separates two faces."""
COARSE_ANGLE = 40.0
"""Feature angle, degrees, at which a bore of 9 facets is a round wall, and an octagon is none."""
_FLAT = 1.0
"""Root mean square angle, degrees, of the normals of a plane to their mean."""
_SEAM = 0.5
"""Angle between facets, degrees, up to which they lie in one plane."""
_ROUND = 0.02
"""Distance of the nodes of a round wall from a cylinder, in radii."""
_STRAIGHT = 0.15
"""Root mean square share of the normals of a round wall along its axis: a coarse mesh of 12 edges a
turn has 0.05. What is a cone or a torus is told by the distance of its nodes."""
_COLUMNS = 4
"""Places round the axis at which a wall has nodes, at least: three lie on a circle anyway."""
_EXACT, _MANY, _ALIKE = 5e-3, 12, 0.97
"""Largest distance of the nodes of a cone or a sphere from it, in radii, their least number, and
least mean cosine between its normals and those of its facets: a free-form face is neither."""
_DEPTH, _FEW = 0.05, 0.02
"""Largest distance of nodes from a wall over its depth, and the share of it that fewer nodes than
these may use: a cylinder passes through any five."""
_STEPS = 4
"""Steps towards the nearest cylinder: each doubles the digits."""
_CLOSED = 0.02
"""Resultant of the normals of a wall, over its area, below which it goes all round."""
_WIDE = 4.0
"""Area of a plane that runs smoothly into a round wall, in areas of the wall's flat strips."""
_LARGE = 0.03
"""Least area of such a plane, as a share of the face: a free-form face has small flat places."""
_DIGITS = 6
"""Digits of area and centre by which faces are ordered, so that rounding orders none."""


@dataclass(frozen=True)
class Face:
    """A smooth face.

    Attributes
    ----------
    facets : (k,) int array
        Rows of the triangles that were given.
    kind : {"plane", "cylinder", "cone", "sphere", "other"}
    area : float, mm^2
    centre : (3,) array, mm
        Of the area; of a cylinder, the point of its axis at the middle of its length; of a cone, a
        point of its axis; of a sphere, its centre.
    direction : (3,) array
        Of length 1: the outward normal of a plane, the axis of a cylinder (its first component
        that is not zero is positive) or a cone, the mean normal of another face (zero where it
        closes, and of a sphere).
    radius : float, mm
        Of a cylinder, of a sphere, of a cone at its centre; NaN for other faces.
    hollow : bool
        Whether a round face is the wall of a hole, not of a pin.
    turn : float, degrees
        How far a cylinder goes round its axis: 360 for a whole wall; NaN for other faces.
    slope : float
        Growth of the radius of a cone along its direction; 0 for other faces.
    """

    facets: IntArray
    kind: Literal["plane", "cylinder", "cone", "sphere", "other"]
    area: float
    centre: FloatArray
    direction: FloatArray
    radius: float = np.nan
    hollow: bool = False
    turn: float = np.nan
    slope: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, facets=int, centre=float, direction=float)

    @property
    def wall(self) -> RoundWall | None:
        """The cylinder, cone or sphere that the face lies on; None where it lies on none."""
        if self.kind not in ("cylinder", "cone", "sphere"):
            return None
        return RoundWall(self.centre, self.direction, self.radius, self.slope, self.hollow)

    def normals_at(self, places: FloatArray) -> FloatArray | None:
        """Outward unit normals (k, 3) of a round face at places (k, 3), mm, on it or near it.

        They point from the axis or the centre, wherever a place lies between it and the wall, as
        the middle of a chord does. None for a face that is not round.
        """
        wall = self.wall
        return None if wall is None else wall.normals_at(places)

    @property
    def about(self) -> str:
        """One phrase: what it is, how large, and where."""
        if self.kind == "cylinder":
            return self.shape
        normal = f", normal {self.along}" if self.kind == "plane" else ""
        at = place_text(self.centre, 4)
        what = {"other": "face"}.get(self.kind, self.kind)
        return f"{what} of {self.area:.4g} mm^2{normal}, centre {at}"

    @property
    def shape(self) -> str:
        """One phrase: what it is."""
        if self.kind == "cylinder":
            at = place_text(self.centre, 4)
            what = "wall of a hole" if self.hollow else "wall of a pin"
            if self.turn < 180.0:
                what = "hollow round" if self.hollow else "outer round"
            part = "" if self.turn > 359.0 else f", {self.turn:.0f} degrees of it"
            return f"{what} of radius {self.radius:.3g} mm{part}, axis {self.along} through {at}"
        if self.kind == "sphere":
            at = place_text(self.centre, 4)
            hollow = "hollow " if self.hollow else ""
            return f"{hollow}sphere of radius {self.radius:.3g} mm about {at}"
        if self.kind == "cone":
            half = np.degrees(np.arctan(abs(self.slope)))
            hollow = "hollow " if self.hollow else ""
            return f"{hollow}cone of half angle {half:.3g} degrees, axis {self.along}"
        return f"plane, normal {self.along}" if self.kind == "plane" else "free-form face"

    @property
    def along(self) -> str:
        """Direction as a part file has it: x, -y, or three numbers."""
        return direction_text(self.direction)


def smooth_faces(
    points: ArrayLike, triangles: ArrayLike, angle: float = FEATURE_ANGLE
) -> tuple[Face, ...]:
    """Split a closed surface into its smooth faces.

    Two triangles belong to one face where the surface turns by less than the feature angle from one
    to the other. A face that is neither a plane nor a round wall gives up the wide planes in it: so
    a plane that runs smoothly into a fillet, as in a slot, is a face of its own.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Outward.
    angle : float, degrees, default 30
        Feature angle, above 0 and below 180.

    Returns
    -------
    tuple of Face
        The largest first, those of equal area by their centres: the order depends on the shape
        alone.
    """
    check_number("feature angle", angle, above=0.0, below=180.0, unit="degrees")
    points = np.asarray(points, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    surface = _surface(points, triangles)
    area = surface.area
    pairs = _adjacent_triangles(triangles)
    cosine = np.einsum("ij,ij->i", surface.normal[pairs[:, 0]], surface.normal[pairs[:, 1]])
    label = connected(pairs[cosine > np.cos(np.radians(angle))], len(triangles))
    flat = connected(pairs[cosine > np.cos(np.radians(_SEAM))], len(triangles))
    faces: list[Face] = []
    for group in _rows_by_label(label):
        face = _face(surface, group)
        if face.kind != "other":
            faces.append(face)
            continue
        wide = _wide_planes(flat[group], area[group])
        smooth = pairs[np.isin(pairs, group[~wide]).all(axis=1)]
        smooth = smooth[np.isin(smooth[:, 0], group)]
        parts = connected(smooth, len(triangles))
        faces += [_face(surface, piece) for piece in _rows_by_label(flat, group[wide])]
        faces += [_face(surface, piece) for piece in _rows_by_label(parts, group[~wide])]
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    return tuple(sorted(faces, key=lambda face: _order(face, size)))


def given_faces(
    points: ArrayLike, triangles: ArrayLike, groups: Iterable[ArrayLike]
) -> tuple[Face, ...]:
    """Find what kind faces are whose triangles are known, as those of a CAD file.

    Triangles (t, 3) are outward; groups are the rows of those of each face, at least one.
    """
    surface = _surface(np.asarray(points, dtype=float), np.asarray(triangles, dtype=np.int64))
    return tuple(_face(surface, np.asarray(rows, dtype=np.int64)) for rows in groups)


def round_walls(
    points: ArrayLike, triangles: ArrayLike, faces: Iterable[Face]
) -> tuple[RoundWall, ...]:
    """Round walls among the faces of a surface, as large as these.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    faces : iterable of Face
        Those of another shape that is nearly round, as an oval hole has, are left out.

    Returns
    -------
    tuple of RoundWall
        The tolerance of each is the largest distance of its triangles from it, at their corners and
        at the middles of their sides: what is meshed anew lies on these triangles.
    """
    points, triangles = np.asarray(points, dtype=float), np.asarray(triangles, dtype=np.int64)
    fitted = (_true_wall(face, points[triangles[face.facets]]) for face in faces)
    return tuple(wall for wall in fitted if wall is not None)


def _true_wall(face: Face, corners: FloatArray) -> RoundWall | None:
    """Wall that triangles with corners (k, 3, 3) are chords of; None where there is none."""
    wall = face.wall
    if wall is None:
        return None
    nodes = np.unique(corners.reshape(-1, 3), axis=0)
    distance, normal = wall.distances(nodes)
    # Nodes lie on the wall or, where triangles were cut, on its chords: inside, never outside.
    beyond = max(float(np.quantile(distance, 0.9)), 0.0)
    distance -= beyond
    # A shallow wall of a large radius is near to many faces, one of few nodes to any.
    mean = normal.mean(axis=0)
    mean /= max(float(np.linalg.norm(mean)), 0.5)
    depth = wall.radius * (1.0 - float((normal @ mean).min()))
    slack = min(_EXACT * wall.radius, _DEPTH * depth) * (1.0 if len(nodes) >= _MANY else _FEW)
    near = np.abs(distance) <= slack
    if not near.all() and ((distance > slack).any() or face.kind != "cylinder"):
        return None
    if not near.all() and not _chords(face, nodes - wall.centre, distance, near, slack):
        return None
    places = np.concatenate([corners, 0.5 * (corners + np.roll(corners, 1, axis=1))])
    height = (nodes - wall.centre) @ wall.direction
    wall = replace(wall, radius=wall.radius + beyond)
    return replace(
        wall,
        tolerance=float(np.abs(wall.distances(places.reshape(-1, 3))[0]).max()),
        low=float(height.min()),
        high=float(height.max()),
        area=face.area,
    )


def _chords(
    face: Face, arm: FloatArray, distance: FloatArray, near: BoolArray, slack: float
) -> bool:
    """Whether nodes off a cylinder lie on chords between columns of nodes that are on it.

    Where the corner between two chords has no node, they are half as long as their columns tell, at
    most, and so are as near to the wall as such a chord.

    Parameters
    ----------
    arm : (k, 3) array, mm
        Of the nodes, from a point of the axis.
    distance : (k,) array, mm
        Of the nodes from the wall; negative inside.
    near : (k,) bool array
        Nodes on the wall.
    slack : float, mm
        Largest distance of a node from its chord.
    """
    axes = np.linalg.svd(face.direction[None])[2][1:]
    across, along = axes @ arm.T
    turn, away = np.arctan2(along, across), np.hypot(along, across)
    order = np.flatnonzero(near)[np.argsort(turn[near], kind="stable")]
    column = turn[order]
    if 1 + (np.diff(column) > 1e-3).sum() < _COLUMNS:
        return False
    # Columns stand close together, and no node is farther off than the longest chord.
    gaps = np.sort(np.diff(column, append=column[:1] + 2.0 * np.pi))
    widest = gaps[: len(gaps) - (face.turn < 359.0)][-1]  # an open wall has one gap more
    deepest = face.radius * (1.0 - np.cos(0.5 * widest))
    if widest >= np.radians(COARSE_ANGLE) or not (distance > -1.1 * deepest).all():
        return False
    # Columns before and behind each node off the wall; the first follows the last.
    place = np.searchsorted(column, turn[~near])
    before, after = order[place - 1], order[place % len(order)]
    half = 0.5 * ((turn[after] - turn[before]) % (2.0 * np.pi))
    middle = turn[before] + half
    radius = 0.5 * (away[before] + away[after])
    on_chord = np.abs(radius * np.cos(half) - away[~near] * np.cos(turn[~near] - middle)) <= slack
    on_half = (away[~near] <= radius) & (away[~near] >= radius * np.cos(0.5 * half))
    return bool((half < np.radians(0.5 * COARSE_ANGLE)).all() and (on_chord | on_half).all())


def guessed_walls(points: FloatArray, boundary: IntArray) -> tuple[tuple[RoundWall, ...], IntArray]:
    """Round walls of a mesh that nothing is known of, and the wall (b,) of each outward facet."""
    walls: list[RoundWall] = []
    wall_of = np.full(len(boundary), -1)
    rest = np.arange(len(boundary))
    for angle in (COARSE_ANGLE, FEATURE_ANGLE):
        for face in smooth_faces(points, boundary[rest], angle):
            for wall in round_walls(points, boundary[rest], [face]):
                wall_of[rest[face.facets]] = len(walls)
                walls.append(wall)
        rest = np.flatnonzero(wall_of < 0)
    return tuple(walls), wall_of


@dataclass(frozen=True)
class _Surface:
    """Triangles with their areas (t,) and normals (t, 3)."""

    points: FloatArray
    triangles: IntArray
    area: FloatArray
    normal: FloatArray


def _surface(points: FloatArray, triangles: IntArray) -> _Surface:
    return _Surface(points, triangles, *areas_and_normals(points, triangles))


def _order(face: Face, size: float) -> tuple[float, ...]:
    """Return what faces are ordered by."""
    place = np.round(face.centre / size, _DIGITS - 2) + 0.0
    return (-round(face.area / size**2, _DIGITS), *place.tolist())


def _adjacent_triangles(triangles: IntArray) -> IntArray:
    """Pairs (k, 2) of triangles that share an edge."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    (key,) = facet_keys(edges)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    return np.stack([order[same], order[same + 1]], axis=1) // 3


def _rows_by_label(label: IntArray, among: IntArray | None = None) -> list[IntArray]:
    """Rows of each label, among some rows or all."""
    rows = np.arange(len(label)) if among is None else among
    order = rows[np.argsort(label[rows], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1) if len(order) else []


def _wide_planes(flat: IntArray, area: FloatArray) -> BoolArray:
    """Which triangles lie in flat pieces much larger than most flat pieces of their face."""
    _, piece = np.unique(flat, return_inverse=True)
    size = np.bincount(piece, weights=area)
    least = max(_WIDE * float(np.median(size)), _LARGE * float(size.sum()))
    return np.asarray(size > least)[piece]


def _face(surface: _Surface, rows: IntArray) -> Face:
    """Face of some triangles, with what kind it is."""
    area, normal = surface.area[rows], surface.normal[rows]
    total = float(area.sum())
    middles = surface.points[surface.triangles[rows]].mean(axis=1)
    centre = np.average(middles, axis=0, weights=area) if total > 0.0 else middles.mean(axis=0)
    mean = area @ normal
    size = float(np.linalg.norm(mean))
    direction = mean / size if size > 1e-6 * total else np.zeros(3)
    if size > 0.5 * total:
        away = 2.0 * (1.0 - np.clip(normal @ direction, -1.0, 1.0))  # angle^2
        if area @ away <= np.radians(_FLAT) ** 2 * total:
            return Face(rows, "plane", total, centre, direction)
    if total == 0.0:  # triangles whose corners lie on a line
        return Face(rows, "other", total, centre, direction)
    # Two rings of nodes lie on a sphere too: of facets between them a cone has the normals.
    round_face = _cylinder(surface, rows) or _cone(surface, rows) or _sphere(surface, rows)
    return round_face or Face(rows, "other", total, centre, direction)


def _cylinder(surface: _Surface, rows: IntArray) -> Face | None:
    """Face of triangles that lie on a cylinder; None where they do not."""
    area, normal = surface.area[rows], surface.normal[rows]
    spread, axes = np.linalg.eigh((area * normal.T) @ normal / area.sum())
    if spread[0] > _STRAIGHT**2 or spread[1] < 1e-3:
        return None
    nodes = np.unique(surface.triangles[rows])
    plane = surface.points[nodes] @ axes[:, 1:]
    # The circle |p|^2 = 2 m p + c through the nodes, by least squares.
    shift = plane.mean(axis=0)
    system = np.column_stack([2.0 * (plane - shift), np.ones(len(plane))])
    squares = ((plane - shift) ** 2).sum(axis=1)
    (*middle, constant), _, rank, _ = np.linalg.lstsq(system, squares)
    radius = float(np.sqrt(max(constant + np.dot(middle, middle), 0.0)))
    if rank < 3 or not radius > 0.0:
        return None
    through, axes, radius = fitted_cylinder(
        surface.points[nodes], axes[:, 1:] @ (shift + middle), axes, radius
    )
    arm = (surface.points[nodes] - through) @ axes[:, 1:]
    if np.abs(np.linalg.norm(arm, axis=1) - radius).max() > _ROUND * radius:
        return None
    axis = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0]) > _STRAIGHT), 0])
    height = (surface.points[nodes] - through) @ axis
    centre = through + 0.5 * (height.min() + height.max()) * axis
    outward = surface.points[surface.triangles[rows]].mean(axis=1) - centre
    inward = float(np.einsum("i,ij,ij->", area, normal, outward)) < 0.0
    turn = np.sort(np.arctan2(arm[:, 1], arm[:, 0]))
    if 1 + (np.diff(turn) > 1e-3 * np.ptp(turn)).sum() < _COLUMNS:
        return None
    gap = float(np.diff(np.append(turn, turn[0] + 2.0 * np.pi)).max())
    step = float(np.median(np.diff(np.unique(np.round(turn, 6)))))
    closed = gap < 2.5 * step or np.linalg.norm(area @ normal) < _CLOSED * area.sum()
    degrees = 360.0 if closed else 360.0 - float(np.degrees(gap))
    return Face(rows, "cylinder", float(area.sum()), centre, axis, radius, inward, degrees)


def _sphere(surface: _Surface, rows: IntArray) -> Face | None:
    """Face of triangles that lie on a sphere; None where they do not."""
    nodes = surface.points[np.unique(surface.triangles[rows])]
    if len(nodes) < _MANY:
        return None
    shift = nodes.mean(axis=0)
    # The sphere |p|^2 = 2 m p + c through the nodes, by least squares.
    system = np.column_stack([2.0 * (nodes - shift), np.ones(len(nodes))])
    (*middle, constant), _, rank, _ = np.linalg.lstsq(system, ((nodes - shift) ** 2).sum(axis=1))
    radius = float(np.sqrt(max(constant + np.dot(middle, middle), 0.0)))
    centre = shift + middle
    off = np.abs(np.linalg.norm(nodes - centre, axis=1) - radius).max()
    if rank < 4 or not off <= _EXACT * radius:
        return None
    return _agreeing(surface, Face(rows, "sphere", 0.0, centre, np.zeros(3), radius))


def _cone(surface: _Surface, rows: IntArray) -> Face | None:
    """Face of triangles that lie on a cone; None where they do not."""
    area, normal = surface.area[rows], surface.normal[rows]
    nodes = surface.points[np.unique(surface.triangles[rows])]
    if len(nodes) < _MANY:
        return None
    # The normals make one angle with the axis.
    away = normal - area @ normal / area.sum()
    spread, axes = np.linalg.eigh((area * away.T) @ away / area.sum())
    if spread[0] > _STRAIGHT**2 or spread[1] < 1e-3:
        return None
    origin = nodes.mean(axis=0)
    height, *plane = ((nodes - origin) @ axes).T
    # (x - m)^2 + (y - n)^2 = (r + k h)^2 is linear in m, n, r^2 - m^2 - n^2, r k and k^2.
    system = np.column_stack([*(2.0 * x for x in plane), np.ones(len(nodes)), height, height**2])
    x, y, constant, mixed, _ = np.linalg.lstsq(system, plane[0] ** 2 + plane[1] ** 2)[0]
    radius = float(np.sqrt(max(constant + x**2 + y**2, 0.0)))
    if not radius > 0.0:
        return None
    through = origin + axes[:, 1:] @ np.array([x, y])
    slope = 0.5 * float(mixed) / radius
    through, axes, radius, slope = _revolved(nodes, through, axes, radius, slope)
    arm = (nodes - through) @ axes
    distance = np.linalg.norm(arm[:, 1:], axis=1)
    if not np.abs(distance - radius - slope * arm[:, 0]).max() <= _EXACT * distance.max():
        return None
    return _agreeing(surface, Face(rows, "cone", 0.0, through, axes[:, 0], radius, slope=slope))


def _agreeing(surface: _Surface, face: Face) -> Face | None:
    """Face with its area and its side, where normals of its facets are those of its shape."""
    area, normal = surface.area[face.facets], surface.normal[face.facets]
    places = surface.points[surface.triangles[face.facets]].mean(axis=1)
    exact = face.normals_at(places)
    assert exact is not None
    along = float(area @ np.einsum("ij,ij->i", exact, normal)) / float(area.sum())
    if abs(along) < _ALIKE:
        return None
    return replace(face, area=float(area.sum()), hollow=along < 0.0)


def fitted_cylinder(
    nodes: FloatArray, through: FloatArray, axes: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray, float]:
    """Fit a cylinder to nodes (n, 3), mm, by least squares of their distances from it.

    Returns a point of its axis, axes (3, 3) as columns with that of the cylinder first, and its
    radius, from a first guess of them. Normals of facets give the axis to some degrees; nodes on
    the wall give it to rounding. Gauss and Newton's steps for the distances of the nodes start
    where the normals lead, and are given up where they lead away.
    """
    return _revolved(nodes, through, axes, radius)[:3]


def _revolved(
    nodes: FloatArray,
    through: FloatArray,
    axes: FloatArray,
    radius: float,
    growth: float | None = None,
) -> tuple[FloatArray, FloatArray, float, float]:
    """Fit a cylinder, or a cone from a first guess of the growth of its radius along its axis.

    The radius that is returned is that at the point of the axis.
    """
    middle = nodes.mean(axis=0)
    nodes = nodes - middle
    through, slope = through - middle, growth or 0.0
    radius = radius - slope * float(through @ axes[:, 0])
    through = axes[:, 1:] @ (through @ axes[:, 1:])

    def distances() -> FloatArray:
        arm = (nodes - through) @ axes
        return np.asarray(np.linalg.norm(arm[:, 1:], axis=1) - radius - slope * arm[:, 0])

    start, best = (through, axes, radius, slope), (distances() ** 2).sum()
    length = max(float(np.ptp(nodes @ axes[:, 0])), 1e-9 * radius)
    for _ in range(_STEPS):
        arm = (nodes - through) @ axes
        radial = arm[:, 1:] / np.maximum(np.linalg.norm(arm[:, 1:], axis=1), 1e-300)[:, None]
        # Unknowns, all in mm: shift across the axis, its tilt over the wall's length, radius, and
        # its growth over that length.
        height = arm[:, :1] / length
        tilt = radial * height + slope * arm[:, 1:] / length
        system = np.column_stack(
            [radial, tilt, np.ones(len(nodes)), height][: 3 + (growth is not None)]
        )
        step = np.linalg.lstsq(system, distances(), rcond=1e-6)[0]
        through = through + axes[:, 1:] @ step[:2]
        turned = np.column_stack([axes[:, 0] + axes[:, 1:] @ step[2:4] / length, axes[:, 1:]])
        radius, slope = radius + float(step[4]), slope + float(step[5:].sum()) / length
        axis, axes = axes[:, 0], np.linalg.qr(turned)[0]
        axes[:, 0] *= np.sign(axes[:, 0] @ axis)
    if not (distances() ** 2).sum() <= best:
        through, axes, radius, slope = start
    return middle + through, axes, radius, slope


def direction_text(direction: FloatArray) -> str:
    """Write a unit vector as a part file has it: x, -y, or three numbers."""
    for name, axis in zip("xyz", np.eye(3), strict=True):
        cosine = float(direction @ axis)
        if abs(cosine) > 1.0 - 1e-6:
            return name if cosine > 0.0 else f"-{name}"
    return "[" + ", ".join(f"{x:.4g}" for x in np.round(direction, 5) + 0.0) + "]"


def place_text(place: FloatArray, digits: int = 8) -> str:
    """Write a place, mm, as a part file has it."""
    return "[" + ", ".join(f"{x:.{digits}g}" for x in np.round(place, 4) + 0.0) + "]"
