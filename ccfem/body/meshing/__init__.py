"""Surfaces, CAD files and planforms to tetrahedral meshes."""

from ccfem.body.meshing.cad import read_cad
from ccfem.body.meshing.meshed_body import faces_of_body, mesh_body, with_faces_of
from ccfem.body.meshing.planform import extrude, triangulate
from ccfem.body.meshing.volume import tetrahedralise

__all__ = [
    "extrude",
    "faces_of_body",
    "mesh_body",
    "read_cad",
    "tetrahedralise",
    "triangulate",
    "with_faces_of",
]
