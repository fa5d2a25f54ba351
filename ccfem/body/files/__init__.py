"""Files in and out: meshes with their patches, surfaces, and writing a file whole or not at all."""

import importlib
from typing import Any

from ccfem.base.whole import whole_file
from ccfem.body.files.mesh_file import read_mesh, write_mesh
from ccfem.body.files.surface import Surface, read_surface

__all__ = ["Surface", "read_mesh", "read_surface", "whole_file", "write_mesh"]


def __getattr__(name: str) -> Any:
    if name == "read_stress":  # its place before release 0.2
        return importlib.import_module("ccfem.fem.stress_files").read_stress
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
