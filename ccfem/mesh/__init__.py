"""Tetrahedral meshes: nodes, cells, named patches, boxes, and what is wrong with a mesh."""

from ccfem.mesh.box import box_mesh
from ccfem.mesh.check import MeshReport, check_mesh
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["MeshReport", "TetMesh", "box_mesh", "check_mesh"]
