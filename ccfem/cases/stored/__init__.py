"""Meshes and outlines of the cases that come with ccfem, so that a first run need not wait."""

from ccfem.cases.stored.stored_files import mesh_of_case, stored_outline

__all__ = ["mesh_of_case", "stored_outline"]
