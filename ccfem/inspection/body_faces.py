"""Smooth faces of a body, with the numbers by which part files select them."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ccfem.arrays import FloatArray, IntArray, freeze
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.errors import InputError
from ccfem.io.mesh_file import read_mesh
from ccfem.io.surface import is_surface, read_surface
from ccfem.mesh.in_metres import in_metres
from ccfem.mesh.smooth_faces import FEATURE_ANGLE, Face, given_faces, smooth_faces
from ccfem.meshing.cad import is_cad, read_cad

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["BodyFaces", "faces"]


@dataclass(frozen=True)
class BodyFaces:
    """Smooth faces of a body.

    Attributes
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Oriented outwards.
    faces : tuple of Face
        Face 1 first.
    names : tuple of str
        Names of the faces of a CAD file, if it has any.
    """

    points: FloatArray
    triangles: IntArray
    faces: tuple[Face, ...]
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, points=float, triangles=int, faces=tuple, names=tuple)

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
        """One row a face: its number, area, shape, and its name if it has one."""
        import pandas as pd

        columns = {
            "face": range(1, len(self.faces) + 1),
            "area, mm^2": [float(f"{face.area:.4g}") for face in self.faces],
            "what": [face.about for face in self.faces],
        }
        names = {"name": self.names[: len(self.faces)]} if any(self.names) else {}
        return pd.DataFrame(columns | names)


def faces(
    body: str | os.PathLike[str] | Case, angle: float = FEATURE_ANGLE, scale: float = 1.0
) -> BodyFaces:
    """Find the smooth faces of a body.

    Parameters
    ----------
    body : path, str or Case
        Surface, CAD or mesh file, part file, or a case.
    angle : float, degrees
        Feature angle: edges of at least this angle separate two faces.
    scale : float, default 1
        Factor that converts the coordinates of a file to mm.

    Raises
    ------
    InputError
        For a body that cannot be read.
    """
    if isinstance(body, Case):
        mesh = body.problem.mesh
        found = smooth_faces(mesh.points, mesh.boundary, angle)
        return BodyFaces(mesh.points, mesh.boundary, tuple(found))
    body = Path(body)
    if is_cad(body):
        cad = read_cad(body, scale)
        points, triangles = cad.surface.points, cad.surface.triangles
        rows = [np.flatnonzero(cad.face == k) for k in range(1, len(cad.names) + 1)]
        found = given_faces(points, triangles, [each for each in rows if len(each)])
        return BodyFaces(points, triangles, tuple(found), tuple(cad.names))
    points, triangles = _boundary(body, scale)
    return BodyFaces(points, triangles, tuple(smooth_faces(points, triangles, angle)))


def _boundary(body: Path, scale: float) -> tuple[FloatArray, IntArray]:
    """Points and outward triangles of a body's boundary."""
    if is_surface(body):
        surface = read_surface(body, scale)
        return surface.points, surface.triangles
    is_part = body.suffix in ("", ".toml")
    if is_part and scale != 1.0:
        raise InputError(
            f"--scale is for surface and mesh files; got {scale:g} for the part '{body}': leave it "
            "out, or scale in the part file"
        )
    mesh = read(str(body)).problem.mesh if is_part else read_mesh(body, scale)
    return mesh.points, mesh.boundary
