"""Smooth faces of a body: by number, to be read, and by place, to be kept in part files."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh.check import in_metres
from ccfem.body.mesh.smooth_faces import Face, direction_text, place_text
from ccfem.geometry.facets import areas_and_normals

if TYPE_CHECKING:
    import pandas as pd

_REACH = 5e-3
"""Default distance of a face from its place, in diagonals: a mesh of it may be coarser."""
_WALL = 0.05
"""Distance more, in radii, by which chords may lie inside a round wall."""
_FACING = np.cos(np.radians(20.0))
"""Cosine of the angle between a normal and the one that is kept."""
_ALONG, _SAME_RADIUS = 0.05, 0.02
"""Sine of the angle between axes, and relative difference of radii, of the same round wall."""
_PLACE = 1e-5
"""Rounding of a place, in diagonals."""
_LISTED = 3
"""Candidates that are named where no face fits."""


@dataclass(frozen=True)
class BodyFaces:
    """Smooth faces of a body.

    Attributes
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Oriented outwards.
    names : tuple of str
        Names of the faces of a CAD file, if it has any.
    numbers : tuple of int
        Number of each face, ascending; by default from 1. A mesh lacks those of its body that are
        smaller than its cells.
    """

    points: FloatArray
    triangles: IntArray
    faces: tuple[Face, ...]
    names: tuple[str, ...] = ()
    numbers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        numbers = self.numbers or range(1, len(self.faces) + 1)
        object.__setattr__(self, "numbers", numbers)
        freeze(self, points=float, triangles=int, faces=tuple, names=tuple, numbers=tuple)

    def __repr__(self) -> str:
        return f"BodyFaces: {len(self.faces)} faces of {len(self.triangles):,} triangles"

    def __str__(self) -> str:
        return str(self.to_frame().to_string(index=False))

    def _repr_html_(self) -> str:
        return str(self.to_frame().to_html(index=False))

    @property
    def doubt(self) -> str:
        """Remark on a body so small that its lengths look like metres; else empty."""
        return in_metres(self.points)

    def to_frame(self) -> "pd.DataFrame":
        """Tabulate number, area, a point on it, shape, and name if it has one, one row a face."""
        import pandas as pd

        columns = {
            "face": self.numbers,
            "area, mm^2": [float(f"{face.area:.4g}") for face in self.faces],
            "at": [place_text(self.point_on(face)) for face in self.faces],
            "what": [face.shape for face in self.faces],
        }
        names = {"name": self.names[: len(self.faces)]} if any(self.names) else {}
        return pd.DataFrame(columns | names)

    @property
    def size(self) -> float:
        """Diagonal of the body, mm."""
        return float(np.linalg.norm(np.ptp(self.points[self.triangles], axis=(0, 1))))

    def face(self, number: int) -> Face:
        """Face of a number."""
        if number not in self.numbers:
            raise InputError(
                f"the part has {len(self.faces)} faces; got number {number}: see ccfem faces for "
                "them, and give the place of one (at)"
            )
        return self.faces[self.numbers.index(number)]

    def point_on(self, face: Face) -> FloatArray:
        """Point on a face, (3,), mm: its centre, or the middle of the triangle nearest to that."""
        triangles = self.triangles[face.facets]
        middles = self.points[triangles].mean(axis=1)
        place = middles[np.argmin(np.linalg.norm(middles - face.centre, axis=1))]
        if _distances(face.centre, self.points, triangles).min() <= _PLACE * self.size:
            place = face.centre
        digits = int(np.clip(np.ceil(-np.log10(max(_PLACE * self.size, 1e-12))), 0, 12))
        return np.asarray(np.round(place, digits) + 0.0)

    def place(self, number: int) -> dict[str, Any]:
        """Place and kind of a face, as the rule `face` of a part file has it.

        ``at``, a point on it, with its ``axis`` and ``radius`` where it is round, else with its
        outward ``normal`` there.
        """
        face = self.face(number)
        at = self.point_on(face)
        table: dict[str, Any] = {"at": tuple(at.tolist())}
        if face.kind == "cylinder":
            return table | {"axis": face.direction, "radius": float(f"{face.radius:.5g}")}
        if face.kind == "plane":
            return table | {"normal": face.direction}
        triangles = self.triangles[face.facets]
        nearest = int(np.argmin(_distances(at, self.points, triangles)))
        _, normals = areas_and_normals(self.points, triangles[nearest : nearest + 1])
        return table | {"normal": normals[0]}

    def number_at(
        self,
        at: ArrayLike,
        normal: FloatArray | None = None,
        axis: FloatArray | None = None,
        radius: float = np.nan,
        tolerance: float | None = None,
    ) -> int:
        """Find the number of the face at a place.

        Parameters
        ----------
        at : (3,) array, mm
            A point on it.
        normal : (3,) array, optional
            Outward unit normal there, within 20 degrees.
        axis : (3,) array, optional
            Axis, of length 1, within 3 degrees and of either sense, of a round wall of a radius
            within 2 %.
        radius : float, mm
            Of the wall, with its axis.
        tolerance : float, mm, optional
            How far the face may be from the point; by default 0.5 % of the part's diagonal, for a
            round wall with 5 % of its radius, since a mesh of it lies inside.

        Raises
        ------
        InputError
            Where no such face is near, with the nearest candidates; or two are.
        """
        at = np.asarray(at, dtype=np.float64)
        away = _distances(at, self.points, self.triangles)
        fits: BoolArray = np.ones(len(away), dtype=bool)
        if normal is not None:
            fits = areas_and_normals(self.points, self.triangles)[1] @ normal > _FACING
        distance = np.full(len(self.faces), np.inf)
        for k, face in enumerate(self.faces):
            rows = face.facets[fits[face.facets]]
            if len(rows) and (axis is None or _is_wall(face, axis, radius)):
                distance[k] = away[rows].min()
        reach = _REACH * self.size if tolerance is None else tolerance
        if axis is not None and tolerance is None:
            reach += _WALL * radius
        order = np.argsort(distance, kind="stable")
        near = order[distance[order] <= distance[order[0]] + _PLACE * self.size]
        what = "face"
        if normal is not None:
            what = f"face with normal {direction_text(normal)}"
        elif axis is not None:
            what = f"round wall of radius {radius:.4g} mm and axis {direction_text(axis)}"
        if not distance[order[0]] <= reach:
            raise InputError(
                f"no {what} is within {reach:.3g} mm of {place_text(at)}; nearest: "
                f"{self._candidates(away, distance)}: correct the place, which ccfem faces lists"
            )
        if len(near) > 1:
            raise InputError(
                f"the place {place_text(at)} of a {what} lies between several: "
                f"{self._candidates(away, distance)}: move it into one of them"
            )
        return self.numbers[int(order[0])]

    def _candidates(self, away: FloatArray, distance: FloatArray) -> str:
        """Name the faces nearest to a place: of the wanted kind, or of any where there is none."""
        if not np.isfinite(distance).any():
            distance = np.array([away[face.facets].min() for face in self.faces])
        order = np.argsort(distance, kind="stable")[:_LISTED]
        return "; ".join(
            f"face {self.numbers[k]}, {distance[k]:.3g} mm off, a {self.faces[k].about}"
            for k in order
            if np.isfinite(distance[k])
        )


def _is_wall(face: Face, axis: FloatArray, radius: float) -> bool:
    """Whether a face is a cylinder of this axis and radius."""
    return (
        face.kind == "cylinder"
        and float(np.linalg.norm(np.cross(face.direction, axis))) <= _ALONG
        and abs(face.radius - radius) <= _SAME_RADIUS * radius
    )


def _distances(place: FloatArray, points: FloatArray, triangles: IntArray) -> FloatArray:
    """Distance (t,), mm, of a place from each triangle."""
    corners = np.moveaxis(points[triangles] - place, 1, 0)
    normal = areas_and_normals(points, triangles)[1]
    inside = normal.any(axis=1)
    least = np.full(len(triangles), np.inf)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        side = end - start
        inside &= np.einsum("ij,ij->i", np.cross(start, side), normal) >= 0.0
        square = np.maximum(np.einsum("ij,ij->i", side, side), 1e-300)
        along = np.clip(-np.einsum("ij,ij->i", start, side) / square, 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(start + along[:, None] * side, axis=1))
    height = np.abs(np.einsum("ij,ij->i", corners[0], normal))
    return np.where(inside, np.minimum(height, least), least)
