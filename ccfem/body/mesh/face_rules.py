"""Rules that choose patches by smooth faces, by place, by number, or all holes of a radius.

Beside the smooth faces stands what other rules may have caught, or missed: a wall taken in part,
facets of other faces, holes forgotten.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.base.plain import plain_dataclass
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.patches import (
    Bounded,
    Box,
    Cylinder,
    PatchRule,
    Plane,
    Vector,
    number_of_face,
    unit_vector,
)
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, Face, given_faces, smooth_faces
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import are_among

_GROUPS = 2
"""Groups of faces that a mesh made of a body has at least: one may be a group of another sort."""
_PARALLEL = 0.02
"""Sine of the largest angle between the axis of a hole and the one that is wanted."""


@plain_dataclass
class Faces:
    """Smooth faces by their places, or by their numbers, as ``ccfem faces`` lists both.

    A place holds whatever mesh is made of the body, and when the body is changed elsewhere; numbers
    change with it.

    Attributes
    ----------
    number : int or tuple of int, optional
        From 1, the largest first; those of equal area from low to high x of their centres, then y,
        then z. In a mirror image equal faces have each other's numbers. Of a CAD file as it has
        them, of a mesh with the faces of its body as groups likewise.
    at : tuple of 3 floats, or tuple of such, mm, optional
        In place of numbers: a point on each face.
    normal : str or tuple of 3 floats, optional
        Outward normal of the faces at these points, within 20 degrees.
    axis : str or tuple of 3 floats, optional
        Axis of round walls, in place of a normal.
    radius : float, mm, optional
        Of the walls, with their axis.
    tolerance : float, mm, optional
        How far a face may be from its point: see `BodyFaces.number_at`.
    angle : float, degrees
        Feature angle of the listing.
    """

    number: int | tuple[int, ...] | None = None
    at: Vector | tuple[Vector, ...] | None = None
    normal: str | Vector | None = None
    axis: str | Vector | None = None
    radius: float | None = None
    tolerance: float | None = None
    angle: float = FEATURE_ANGLE

    def __post_init__(self) -> None:
        if (self.number is None) == (self.at is None):
            raise InputError(
                "rule face needs the place of a face (at, with its normal, or axis and radius), or "
                f"its number; got {'neither' if self.at is None else 'both'}: see ccfem faces"
            )
        if self.at is None:
            extra = [k for k in ("normal", "axis", "radius") if getattr(self, k) is not None]
            if extra:
                raise InputError(f"{', '.join(extra)} of a face goes with at: give a point on it")
        elif not self._places.size:
            raise InputError("at must be a point, or several; got none: see ccfem faces for them")
        elif (self.axis is None) != (self.radius is None) or None not in (self.axis, self.normal):
            raise InputError(
                "a face by its place takes normal, or axis and radius together: see ccfem faces"
            )
        if self.number is not None and min(self._numbers, default=0) < 1:
            raise InputError(
                f"face numbers count from 1; got {self.number}: see ccfem faces for them"
            )
        for name in ("normal", "axis"):
            if getattr(self, name) is not None:
                unit_vector(getattr(self, name), f"face {name}")
        check_fields(self, "radius", above=0.0, unit="mm")
        check_fields(self, "tolerance", at_least=0.0, unit="mm")
        check_fields(self, "angle", above=0.0, below=180.0, unit="degrees")

    @property
    def _numbers(self) -> tuple[int, ...]:
        if self.number is None:
            return ()
        return (self.number,) if isinstance(self.number, int) else self.number

    @property
    def _places(self) -> FloatArray:
        return np.array(self.at, dtype=np.float64).reshape(-1, 3)

    def numbers_on(self, body: BodyFaces) -> tuple[int, ...]:
        """Numbers of the faces on a body."""
        if self.at is None:
            return tuple(number for number in self._numbers if body.face(number))
        normal, axis = (
            None if given is None else unit_vector(given, "face")
            for given in (self.normal, self.axis)
        )
        radius = np.nan if self.radius is None else self.radius
        return tuple(
            body.number_at(place, normal, axis, radius, self.tolerance) for place in self._places
        )

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) of the faces: of a surface's, where they came as groups."""
        body = numbered_faces(mesh, self.angle)
        return _facets(mesh, [body.face(number) for number in self.numbers_on(body)])


@dataclass(frozen=True)
class OnBody:
    """A rule for faces, looked up on the body that a mesh is made of: before, and whatever mesh.

    The mesh has the faces of `body` as groups.
    """

    rule: Faces
    body: BodyFaces

    @property
    def axis(self) -> str | Vector | None:
        """Axis that the rule states."""
        return self.rule.axis

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) of the faces."""
        numbers = self.rule.numbers_on(self.body)
        meshed = numbered_faces(mesh, self.rule.angle)
        for number in numbers:
            if number not in meshed.numbers:
                raise InputError(
                    f"face {number}, a {self.body.face(number).about}, is smaller than the cells, "
                    "and no facet lies on it: shorten edge_length, or leave it out"
                )
        return _facets(mesh, [meshed.face(number) for number in numbers])


@plain_dataclass
class Holes:
    """The walls of all holes of a radius.

    Attributes
    ----------
    radius : float, mm
    axis : str or tuple of 3 floats, optional
        Only holes along this axis.
    tolerance : float, mm, optional
        How far a radius may be off; default 2 % of the radius.
    angle : float, degrees
        Feature angle that ends a wall.
    """

    radius: float
    axis: str | Vector | None = None
    tolerance: float | None = None
    angle: float = FEATURE_ANGLE

    def __post_init__(self) -> None:
        check_fields(self, "radius", above=0.0, unit="mm")
        check_fields(self, "tolerance", at_least=0.0, unit="mm")
        check_fields(self, "angle", above=0.0, below=180.0, unit="degrees")
        if self.axis is not None:
            unit_vector(self.axis, "holes axis")

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) of the walls."""
        faces = numbered_faces(mesh, self.angle).faces
        chosen = self.walls(faces)
        if not chosen:
            walls = [face for face in faces if _is_hole(face)]
            there = "; ".join(face.about for face in walls[:6]) or "none"
            raise InputError(
                f"no hole has radius {self.radius:g} mm"
                f"{'' if self.axis is None else f' and axis {self.axis}'}; there are: {there}: "
                "take one of these radii, or a larger tolerance"
            )
        return mesh.boundary[np.sort(np.concatenate([face.facets for face in chosen]))]

    def numbers_on(self, body: BodyFaces) -> tuple[int, ...]:
        """Numbers of such walls on a body, ascending."""
        pairs = zip(body.numbers, body.faces, strict=True)
        return tuple(number for number, face in pairs if self.walls([face]))

    def walls(self, faces: Iterable[Face]) -> list[Face]:
        """Return those of some faces that are such walls."""
        return [face for face in faces if _is_hole(face) and self._fits(face)]

    def _fits(self, face: Face) -> bool:
        tolerance = 0.02 * self.radius if self.tolerance is None else self.tolerance
        if abs(face.radius - self.radius) > tolerance:
            return False
        if self.axis is None:
            return True
        across = np.cross(face.direction, unit_vector(self.axis, "holes axis"))
        return float(np.linalg.norm(across)) <= _PARALLEL


def _is_hole(face: Face) -> bool:
    return face.kind == "cylinder" and face.hollow


def numbered_faces(mesh: Bounded, angle: float = FEATURE_ANGLE) -> BodyFaces:
    """Faces of what a mesh was made from, where they came with it as groups; else its smooth ones.

    The facets of each are rows of `TetMesh.boundary`. A coarse mesh has corners all round a hole;
    the file that it was made from has not.
    """
    groups = {number_of_face(name): facets for name, facets in mesh.patches.items()}
    rows = {
        number: np.flatnonzero(are_among(mesh.boundary, groups[number]))
        for number in sorted(number for number in groups if number is not None)
    }
    rows = {number: members for number, members in rows.items() if len(members)}
    if len(rows) < _GROUPS:
        return BodyFaces(
            mesh.points, mesh.boundary, smooth_faces(mesh.points, mesh.boundary, angle)
        )
    faces = given_faces(mesh.points, mesh.boundary, rows.values())
    return BodyFaces(mesh.points, mesh.boundary, faces, numbers=tuple(rows))


def _facets(mesh: Bounded, faces: Iterable[Face]) -> IntArray:
    return mesh.boundary[np.unique(np.concatenate([face.facets for face in faces]))]


def without_faces(mesh: TetMesh, kept: Iterable[str]) -> TetMesh:
    """Mesh without the groups of a surface's faces, but for those with a name that is kept."""
    wanted = set(kept)
    patches = {n: f for n, f in mesh.patches.items() if n in wanted or number_of_face(n) is None}
    return replace(mesh, patches=patches)


# Rules that choose cells of a mesh by where their centres lie: in a box, in a cylinder.
#
# The border of what they choose runs along the cells, so it is as fine as they are.


class CellRule(Protocol):
    """Chooses cells of a mesh."""

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,), k >= 1."""
        ...


@plain_dataclass
class CellBox:
    """Cells with their centres in a box.

    Attributes
    ----------
    lower, upper : tuple of 3 floats, mm
        Opposite corners; infinite where the box has no end.
    """

    lower: Vector
    upper: Vector

    def __post_init__(self) -> None:
        check_box(self.lower, self.upper)

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,) in the box."""
        centres = mesh.centres
        inside: BoolArray = np.all((centres >= self.lower) & (centres <= self.upper), axis=1)
        return _chosen(inside, f"box {self.lower} to {self.upper}", mesh)


@plain_dataclass
class CellCylinder:
    """Cells with their centres in a cylinder, which goes through the whole part.

    Attributes
    ----------
    point : tuple of 3 floats, mm
        A point on the axis.
    axis : str or tuple of 3 floats
        Direction of the axis.
    radius : float, mm
    """

    point: Vector
    axis: str | Vector
    radius: float

    def __post_init__(self) -> None:
        unit_vector(self.axis, "cylinder axis")
        check_fields(self, "radius", above=0.0, unit="mm")

    def __call__(self, mesh: TetMesh) -> IntArray:
        """Cells (k,) in the cylinder."""
        axis = unit_vector(self.axis, "cylinder axis")
        arm = mesh.centres - np.asarray(self.point)
        away = np.linalg.norm(arm - np.outer(arm @ axis, axis), axis=1)
        label = f"cylinder round {self.point} along {self.axis}, radius {self.radius:g} mm"
        inside: BoolArray = away <= self.radius
        return _chosen(inside, label, mesh)


def check_box(lower: Vector, upper: Vector) -> None:
    """Refuse opposite corners of a box, mm, of which the first does not lie below the second."""
    if not (np.asarray(lower) < np.asarray(upper)).all():
        raise InputError(f"box lower must lie below upper; got {lower} and {upper}: swap them")


def _chosen(inside: BoolArray, label: str, mesh: TetMesh) -> IntArray:
    if not inside.any():
        (x, y, z), (u, v, w) = mesh.bounds
        raise InputError(
            f"{label} holds the centre of no cell; the part lies between ({x:.4g}, {y:.4g}, "
            f"{z:.4g}) and ({u:.4g}, {v:.4g}, {w:.4g}) mm: move or widen it, or shorten the edges"
        )
    return np.flatnonzero(inside)


# What rules may have caught, or missed.


_ALL = 0.98
"""Share of the area of a wall from which it counts as taken whole."""
_SOME = 0.01
"""Share of the area of a patch or a face up to which a part of it is not worth a word."""
_SAME = 0.02
"""Share by which radii, and sine by which axes, of like holes may differ."""
_ASIDE = np.cos(np.radians(30.0))


def about_patches(mesh: TetMesh, rules: Mapping[str, PatchRule]) -> tuple[str, ...]:
    """Say what rules may have caught, or missed, against their author's intention.

    One line for each doubt, with the cure, of a mesh with the patches of the rules.
    """
    guessed = {n: r for n, r in rules.items() if isinstance(r, Box | Cylinder | Plane)}
    if not guessed:
        return ()
    area, normal = mesh.facet_areas(mesh.boundary)
    faces = numbered_faces(mesh).faces
    taken = {name: are_among(mesh.boundary, mesh.patches[name]) for name in rules}
    anywhere = np.any(list(taken.values()), axis=0)
    lines: list[str] = []
    for name, rule in guessed.items():
        chosen = taken[name]
        parts = _parts(faces, chosen, area)
        if isinstance(rule, Cylinder):
            lines += _about_cylinder(name, rule, parts)
            lines += _forgotten(name, parts, faces, anywhere, area)
        elif isinstance(rule, Box):
            lines += _about_box(name, rule, parts)
        else:
            lines += _about_plane(name, rule, normal[chosen], area[chosen])
    return tuple(lines)


def _parts(
    faces: tuple[Face, ...], chosen: BoolArray, area: FloatArray
) -> list[tuple[Face, float, float]]:
    """Each face that a patch touches, with its share of the patch, and how much of it is taken."""
    total = float(area[chosen].sum())
    parts = []
    for face in faces:
        size = float(area[face.facets][chosen[face.facets]].sum())
        if size > _SOME * min(total, face.area):
            parts.append((face, size / total, size / face.area))
    return parts


def _about_cylinder(name: str, rule: Cylinder, parts: list[tuple[Face, float, float]]) -> list[str]:
    """Say where a round wall is taken in part, or other faces with it."""
    lines = []
    for face, share, covered in parts:
        if face.kind != "cylinder":
            lines.append(
                f"patch '{name}': {share:.0%} of what its cylinder selects is not a round wall "
                f"but a {face.about}: reduce the radius or the tolerance, or use rule 'face'"
            )
        elif rule.half is None and covered < _ALL:
            lines.append(
                f"patch '{name}' takes {covered:.0%} of a {face.about}: put the cylinder there, or "
                "choose by rule 'holes' or 'face'"
            )
    return lines


def _forgotten(
    name: str,
    parts: list[tuple[Face, float, float]],
    faces: tuple[Face, ...],
    anywhere: BoolArray,
    area: FloatArray,
) -> list[str]:
    """Name walls like the one that a cylinder takes that are in no patch."""
    walls = [face for face, *_ in parts if face.kind == "cylinder" and face.turn > 180.0]
    if len(walls) != 1:
        return []
    (wall,) = walls
    others = []
    for face in faces:
        if face.kind != "cylinder" or face.hollow != wall.hollow or face is wall:
            continue
        alike = abs(face.radius - wall.radius) <= _SAME * wall.radius
        parallel = np.linalg.norm(np.cross(face.direction, wall.direction)) <= _SAME
        free = float(area[face.facets][anywhere[face.facets]].sum()) < _SOME * face.area
        if alike and parallel and free and face.turn > 180.0:
            others.append(face)
    if not others:
        return []
    where = "; ".join(face.about for face in others[:3])
    return [
        f"patch '{name}' is one of {len(others) + 1} like walls; in no patch: {where}: take all by "
        f"rule 'holes' with radius {wall.radius:.3g} if they belong together"
    ]


def _about_box(name: str, rule: Box, parts: list[tuple[Face, float, float]]) -> list[str]:
    """Say where a box takes facets that face in several directions."""
    directions = [face.direction for face, *_ in parts if face.kind == "plane"]
    several = any(direction @ other < _ASIDE for direction in directions for other in directions)
    if rule.normal is not None or not several:
        return []
    named = ", ".join(dict.fromkeys(face.along for face, *_ in parts if face.kind == "plane"))
    return [
        f"patch '{name}': its box takes facets of {len(parts)} faces, with normals {named}: give "
        "the box a normal, or choose by rule 'face'"
    ]


def _about_plane(name: str, rule: Plane, normal: FloatArray, area: FloatArray) -> list[str]:
    """Say where facets face both ways, as those of a sheet thinner than the tolerance do."""
    up = float(area[normal @ normal[0] > 0.0].sum())
    down = float(area.sum()) - up
    if min(up, down) <= _SOME * (up + down):
        return []
    return [
        f"patch '{name}': its plane takes {up:.4g} mm^2 that face one way and {down:.4g} mm^2 that "
        "face the other: lessen the tolerance below the thickness, or choose by rule 'face'"
    ]
