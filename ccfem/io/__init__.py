"""Files in and out: meshes with their patches, surfaces, and writing a file whole or not at all."""

from ccfem.io.mesh_file import read_mesh, write_mesh
from ccfem.io.stress_file import read_stress
from ccfem.io.surface import Surface, read_surface
from ccfem.io.whole import whole_file

__all__ = ["Surface", "read_mesh", "read_stress", "read_surface", "whole_file", "write_mesh"]
