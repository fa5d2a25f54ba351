"""Surfaces and planforms to tetrahedral meshes."""

from ccfem.meshing.face_groups import with_faces_of
from ccfem.meshing.planform import triangulate
from ccfem.meshing.prisms import extrude
from ccfem.meshing.volume import tetrahedralise

__all__ = ["extrude", "tetrahedralise", "triangulate", "with_faces_of"]
