"""Files in and out: meshes with their patches, surfaces, and writing a file whole or not at all."""

from ccfem.base.whole import whole_file
from ccfem.body.files.mesh_file import read_mesh, write_mesh
from ccfem.body.files.surface import Surface, read_surface

__all__ = ["Surface", "read_mesh", "read_surface", "whole_file", "write_mesh"]
