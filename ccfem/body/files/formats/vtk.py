"""Legacy VTK files (``.vtk``) of unstructured grids, as those in XML."""

from ccfem.body.files.formats import vtu

read = vtu.read
