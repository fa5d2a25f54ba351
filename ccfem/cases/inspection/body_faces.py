"""Smooth faces of a body, with the places and numbers by which part files select them."""

import os
from pathlib import Path

from ccfem.base.errors import InputError
from ccfem.body.files.mesh_file import read_mesh
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import numbered_faces
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE
from ccfem.body.meshing import faces_of_body
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.case import Case
from ccfem.cases.part_file import faces_of_part
from ccfem.cases.reading import read


def faces(
    body: str | os.PathLike[str] | Case, angle: float = FEATURE_ANGLE, scale: float = 1.0
) -> BodyFaces:
    """Find the smooth faces of a body.

    Their numbers are those of the rule `face`, whatever they are listed from: of a part file those
    of its surface, of a mesh those of the body it was made from, where they came with it as groups.

    Parameters
    ----------
    body : path, str or Case
        Surface, CAD or mesh file, part file, or a case.
    angle : float, degrees
        Feature angle: edges of at least this angle separate two faces.
    scale : float, default 1
        Factor that converts the coordinates of a file to mm.
    """
    if isinstance(body, Case):
        return numbered_faces(body.problem.mesh, angle) if body.body is None else body.body
    body = Path(body)
    if is_cad(body) or is_surface(body):
        return faces_of_body(body, scale, angle)
    if body.suffix not in ("", ".toml"):
        return numbered_faces(read_mesh(body, scale), angle)
    if scale != 1.0:
        raise InputError(
            f"--scale is for surface and mesh files; got {scale:g} for the part '{body}': leave it "
            "out, or scale in the part file"
        )
    return faces_of_part(body, angle) if body.suffix else faces(read(str(body)), angle)
