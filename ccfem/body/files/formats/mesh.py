"""Medit meshes (``.mesh``): read by Gmsh."""

from ccfem.body.files.formats import msh

read = msh.read_by_gmsh
