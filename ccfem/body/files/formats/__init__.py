"""Mesh formats: one module a format, named as the suffix of its files.

A module has ``read(path)``, which returns a `TetMesh`, and ``write(mesh, path)`` if the format can
be written. Modules of other packages are found by entry points of the group
``ccfem.mesh_formats``, named by their suffix. Nothing is registered anywhere.
"""

import importlib
import pkgutil
from types import ModuleType

from ccfem.base import plugins

__all__ = ["format_of", "suffixes"]


def suffixes(writable: bool = False) -> tuple[str, ...]:
    """Suffixes of all formats in order, as ``.vtu``, or of those that can be written."""
    names = {info.name for info in pkgutil.iter_modules(__path__)}
    names |= {entry.name for entry in plugins.entries("ccfem.mesh_formats")}
    known = (f".{name}" for name in sorted(names))
    return tuple(s for s in known if not writable or hasattr(format_of(s), "write"))


def format_of(suffix: str) -> ModuleType:
    """Return the module of the format with a suffix of `suffixes`."""
    name = suffix.removeprefix(".")
    for entry in plugins.entries("ccfem.mesh_formats"):
        if entry.name == name:
            module: ModuleType = entry.load()
            return module
    return importlib.import_module(f"{__name__}.{name}")
