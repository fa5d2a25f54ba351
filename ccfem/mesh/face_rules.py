"""Rules that choose patches by smooth faces: by their numbers, or all holes of a radius."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ccfem.arrays import IntArray
from ccfem.checks import check_fields
from ccfem.errors import InputError
from ccfem.mesh.face_names import face_name, number_of_face
from ccfem.mesh.facets import are_among
from ccfem.mesh.patches import Bounded, Vector, match_boundary, unit_vector
from ccfem.mesh.smooth_faces import FEATURE_ANGLE, Face, given_faces, smooth_faces
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["Faces", "Holes", "faces_of", "without_faces"]

_PARALLEL = 0.02
"""Sine of the largest angle between the axis of a hole and the one that is wanted."""


@dataclass(frozen=True)
class Faces:
    """Smooth faces by their numbers, as ``ccfem faces`` lists them.

    Attributes
    ----------
    number : int or tuple of int
        From 1, the largest first; those of equal area from low to high x of their centres, then y,
        then z. In a mirror image equal faces have each other's numbers. Of a CAD file as it has
        them.
    angle : float, degrees
        Feature angle of the listing.
    """

    number: int | tuple[int, ...]
    angle: float = FEATURE_ANGLE

    def __post_init__(self) -> None:
        if not self._numbers or not all(number >= 1 for number in self._numbers):
            raise InputError(
                f"face numbers count from 1; got {self.number}: see ccfem faces for them"
            )
        check_fields(self, "angle", above=0.0, below=180.0, unit="degrees")

    @property
    def _numbers(self) -> tuple[int, ...]:
        return (self.number,) if isinstance(self.number, int) else self.number

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) of the faces.

        Where the mesh was made from a surface whose faces came with it as groups, of these.
        """
        if face_name(1) in mesh.patches:
            _check_count(self._numbers, max(number_of_face(n) or 0 for n in mesh.patches))
            groups = [mesh.patches.get(face_name(number)) for number in self._numbers]
            found = [group for group in groups if group is not None]
            return match_boundary(mesh, np.concatenate(found or [np.zeros((0, 3), np.int64)]))
        faces = smooth_faces(mesh.points, mesh.boundary, self.angle)
        _check_count(self._numbers, len(faces))
        rows = np.concatenate([faces[number - 1].facets for number in self._numbers])
        return mesh.boundary[np.unique(rows)]


@dataclass(frozen=True)
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
        faces = faces_of(mesh, self.angle)
        walls = [face for face in faces if face.kind == "cylinder" and face.hollow]
        chosen = [face for face in walls if self._fits(face)]
        if not chosen:
            there = "; ".join(face.about for face in walls[:6]) or "none"
            raise InputError(
                f"no hole has radius {self.radius:g} mm"
                f"{'' if self.axis is None else f' and axis {self.axis}'}; there are: {there}: "
                "take one of these radii, or a larger tolerance"
            )
        return mesh.boundary[np.sort(np.concatenate([face.facets for face in chosen]))]

    def _fits(self, face: Face) -> bool:
        tolerance = 0.02 * self.radius if self.tolerance is None else self.tolerance
        if abs(face.radius - self.radius) > tolerance:
            return False
        if self.axis is None:
            return True
        across = np.cross(face.direction, unit_vector(self.axis, "holes axis"))
        return float(np.linalg.norm(across)) <= _PARALLEL


def faces_of(mesh: Bounded, angle: float = FEATURE_ANGLE) -> tuple[Face, ...]:
    """Faces of what a mesh was made from, where they came with it as groups; else its smooth ones.

    The facets of each are rows of `TetMesh.boundary`. A coarse mesh has corners all round a hole;
    the file that it was made from has not.
    """
    names = sorted(name for name in mesh.patches if number_of_face(name))
    if face_name(1) not in names:
        return smooth_faces(mesh.points, mesh.boundary, angle)
    rows = [np.flatnonzero(are_among(mesh.boundary, mesh.patches[name])) for name in names]
    return given_faces(mesh.points, mesh.boundary, [each for each in rows if len(each)])


def without_faces(mesh: TetMesh, kept: Iterable[str]) -> TetMesh:
    """Mesh without the groups of a surface's faces, but for those with a name that is kept."""
    wanted = set(kept)
    patches = {n: f for n, f in mesh.patches.items() if n in wanted or number_of_face(n) is None}
    return replace(mesh, patches=patches)


def _check_count(numbers: tuple[int, ...], count: int) -> None:
    if max(numbers) > count:
        raise InputError(
            f"the part has {count} faces; got number {max(numbers)}: see ccfem faces for them"
        )
