"""Faces of a surface or a CAD file, and of a surface on the mesh that was made from it."""

import os
from dataclasses import replace

import numpy as np

from ccfem.body.files.surface import Surface, read_surface
from ccfem.body.mesh.face_names import face_name
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, given_faces, smooth_faces
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.cad import is_cad, read_cad


def faces_of_body(
    path: str | os.PathLike[str], scale: float = 1.0, angle: float = FEATURE_ANGLE
) -> BodyFaces:
    """Faces of a closed surface, or of a CAD file as it has them, numbered before any meshing.

    Parameters
    ----------
    path : path
        STL, OBJ, PLY, STEP, IGES or BREP.
    scale : float, default 1
        Factor on the coordinates.
    angle : float, degrees
        Feature angle, of a surface.
    """
    if not is_cad(path):
        surface = read_surface(path, scale)
        faces = smooth_faces(surface.points, surface.triangles, angle)
        return BodyFaces(surface.points, surface.triangles, faces)
    cad = read_cad(path, scale)
    points, triangles = cad.surface.points, cad.surface.triangles
    rows = {k: np.flatnonzero(cad.face == k) for k in np.unique(cad.face).tolist()}
    names = tuple(cad.names[k - 1] for k in rows)
    faces = given_faces(points, triangles, rows.values())
    return BodyFaces(points, triangles, faces, names, tuple(rows))


def with_faces_of(surface: Surface, mesh: TetMesh, angle: float = FEATURE_ANGLE) -> TetMesh:
    """Mesh with the smooth faces of its surface as groups ``face_1``, ``face_2``, ...

    So the numbers that ``ccfem faces`` gives for a surface hold whatever mesh is made of it. Each
    boundary facet belongs to the face of the triangle that its centre is nearest to.

    Parameters
    ----------
    mesh : TetMesh
        Made from it.
    angle : float, degrees
        Feature angle.

    Returns
    -------
    TetMesh
        Faces so small that no facet lies on them are no groups.
    """
    import pyvista

    faces = smooth_faces(surface.points, surface.triangles, angle)
    number = np.zeros(len(surface.triangles), dtype=np.int64)
    for k, face in enumerate(faces, 1):
        number[face.facets] = k
    shell = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    centres = mesh.points[mesh.boundary].mean(axis=1)
    of = number[np.asarray(shell.find_closest_cell(centres))]
    groups = {face_name(k): mesh.boundary[of == k] for k in np.unique(of).tolist()}
    return replace(mesh, patches={**mesh.patches, **groups})
