"""What ``ccfem faces`` does: the smooth faces of a body listed, and drawn with their numbers."""

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.smooth_faces import Face, place_text
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.inspection.body_faces import faces as faces_of
from ccfem.comparison.plot.canvas import check_picture
from ccfem.comparison.plot.part_views import Label, draw_part

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
    listing = faces_of(body, angle, scale)
    points, triangles, faces, names = (
        listing.points,
        listing.triangles,
        listing.faces,
        listing.names,
    )
    columns = ("face", "area, mm^2", "at", "what", "name")[: 5 if any(names) else 4]
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, justify="right" if column in columns[:2] else "left")
    for k, (number, face) in enumerate(zip(listing.numbers, faces, strict=True)):
        at = place_text(listing.point_on(face))
        row = (str(number), f"{face.area:.4g}", at, face.shape, *names[k : k + 1])
        table.add_row(*row[: len(columns)])
    console = Console(highlight=False, markup=False)
    console.print(table)
    of = np.zeros(len(triangles), dtype=np.int64)
    for k, face in enumerate(faces):
        of[face.facets] = k
    colour = [_COLOURS[k % len(_COLOURS)] for k in of.tolist()]
    largest = sorted(range(len(faces)), key=lambda k: -faces[k].area)[:_NAMED]
    labels = [_label(points, triangles, faces[k], listing.numbers[k]) for k in sorted(largest)]
    draw_part(points, triangles, colour, labels, picture, title=f"{body.name}: {len(faces)} faces")
    about = "" if is_cad(body) else f" at a feature angle of {angle:g} degrees"
    console.print(
        f"{len(faces)} faces{about}; picture: {picture}\n"
        + (f"warning: {listing.doubt}\n" if listing.doubt else "")
        + 'in a part file: [patches.NAME] with rule = "face", at = [...] and normal, or axis and '
        "radius; lengths are mm"
    )


def _label(points: FloatArray, triangles: IntArray, face: Face, number: int) -> Label:
    """Label of a face at its triangle nearest to its centre."""
    corners = points[triangles[face.facets]]
    middles = corners.mean(axis=1)
    nearest = int(np.argmin(np.linalg.norm(middles - face.centre, axis=1)))
    a, b, c = corners[nearest]
    normal = np.cross(b - a, c - a)
    return Label(str(number), middles[nearest], normal / max(float(np.linalg.norm(normal)), 1e-300))
