"""Faces of a surface carried over to the mesh that was made from it."""

from dataclasses import replace

import numpy as np

from ccfem.io.surface import Surface
from ccfem.mesh.face_names import face_name
from ccfem.mesh.smooth_faces import FEATURE_ANGLE, smooth_faces
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["with_faces_of"]


def with_faces_of(surface: Surface, mesh: TetMesh, angle: float = FEATURE_ANGLE) -> TetMesh:
    """Mesh with the smooth faces of its surface as groups ``face_1``, ``face_2``, ...

    So the numbers that ``ccfem faces`` gives for a surface hold whatever mesh is made of it. Each
    boundary facet belongs to the face of the triangle that its centre is nearest to.

    Parameters
    ----------
    surface : Surface
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
