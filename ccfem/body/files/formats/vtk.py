"""Legacy VTK files (``.vtk``) of unstructured grids, as those in XML."""

from ccfem.body.files.formats.vtu import read

__all__ = ["read"]
