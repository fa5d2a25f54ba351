"""What ``ccfem faces`` does: the smooth faces of a body listed, and drawn with their numbers."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ccfem.arrays import FloatArray, IntArray
from ccfem.cases.reading import read
from ccfem.errors import InputError
from ccfem.io.mesh_file import read_mesh
from ccfem.io.surface import is_surface, read_surface
from ccfem.mesh.smooth_faces import FEATURE_ANGLE, Face, given_faces, smooth_faces
from ccfem.meshing.cad import is_cad, read_cad
from ccfem.plot.canvas import check_picture
from ccfem.plot.part_views import Label, draw_part

__all__ = ["faces_of", "list_faces"]

_COLOURS = ("#9ec1e3", "#f3c98b", "#a8d5a2", "#e3a9c0", "#c9b8e0", "#e8e08a", "#9fd6d2", "#d9b89c")
_NAMED = 60
"""Faces that are named in the picture; the rest are smaller."""


def list_faces(body: Path, angle: float, scale: float, picture: Path) -> None:
    """Print the faces of a surface, a mesh file or a part, and draw them.

    Parameters
    ----------
    body : Path
        Surface, CAD or mesh file, part file, or the name of a case.
    angle : float, degrees
        Feature angle.
    scale : float
        Factor on the coordinates of a surface or mesh file, to make them mm.
    picture : Path
        File of the picture.
    """
    check_picture(picture)
    points, triangles, faces, names = faces_of(body, angle, scale)
    columns = ("face", "area, mm^2", "what", "name")[: 4 if any(names) else 3]
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, justify="left" if column in ("what", "name") else "right")
    for number, face in enumerate(faces, 1):
        row = (str(number), f"{face.area:.4g}", face.about, *names[number - 1 : number])
        table.add_row(*row[: len(columns)])
    console = Console(highlight=False, markup=False)
    console.print(table)
    of = np.zeros(len(triangles), dtype=np.int64)
    for k, face in enumerate(faces):
        of[face.facets] = k
    colour = [_COLOURS[k % len(_COLOURS)] for k in of.tolist()]
    labels = [_label(points, triangles, face, k) for k, face in enumerate(faces[:_NAMED], 1)]
    draw_part(points, triangles, colour, labels, picture, title=f"{body.name}: {len(faces)} faces")
    about = "" if is_cad(body) else f" at a feature angle of {angle:g} degrees"
    console.print(
        f"{len(faces)} faces{about}; picture: {picture}\n"
        'in a part file: [patches.NAME] with rule = "face", number = [1, 2]; lengths are mm'
    )


def faces_of(
    body: Path, angle: float = FEATURE_ANGLE, scale: float = 1.0
) -> tuple[FloatArray, IntArray, Sequence[Face], tuple[str, ...]]:
    """Points (n, 3) and outward triangles of a body, its faces, and their names in a CAD file."""
    if is_cad(body):
        cad = read_cad(body, scale)
        points, triangles = cad.surface.points, cad.surface.triangles
        rows = [np.flatnonzero(cad.face == k) for k in range(1, len(cad.names) + 1)]
        faces = given_faces(points, triangles, [each for each in rows if len(each)])
        return points, triangles, faces, cad.names
    points, triangles = _boundary(body, scale)
    return points, triangles, smooth_faces(points, triangles, angle), ()


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


def _label(points: FloatArray, triangles: IntArray, face: Face, number: int) -> Label:
    """Label of a face at its triangle nearest to its centre."""
    corners = points[triangles[face.facets]]
    middles = corners.mean(axis=1)
    nearest = int(np.argmin(np.linalg.norm(middles - face.centre, axis=1)))
    a, b, c = corners[nearest]
    normal = np.cross(b - a, c - a)
    return Label(str(number), middles[nearest], normal / max(float(np.linalg.norm(normal)), 1e-300))
