"""Nastran bulk data (``.bdf``): read by Gmsh."""

from ccfem.body.files.formats.msh import read_by_gmsh as read

__all__ = ["read"]
