"""Tetrahedral meshes: nodes, cells, named patches, boxes, and what is wrong with a mesh."""

from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.check import MeshReport, check_mesh
from ccfem.body.mesh.tet_mesh import TetMesh

__all__ = ["MeshReport", "TetMesh", "box_mesh", "check_mesh"]
