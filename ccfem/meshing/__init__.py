"""Surfaces, CAD files and planforms to tetrahedral meshes."""

from ccfem.meshing.cad import read_cad
from ccfem.meshing.face_groups import faces_of_body, with_faces_of
from ccfem.meshing.meshed_body import mesh_body
from ccfem.meshing.planform import triangulate
from ccfem.meshing.prisms import extrude
from ccfem.meshing.volume import tetrahedralise

__all__ = [
    "extrude",
    "faces_of_body",
    "mesh_body",
    "read_cad",
    "tetrahedralise",
    "triangulate",
    "with_faces_of",
]
