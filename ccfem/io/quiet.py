"""VTK's readers without their warnings: a data set, or nothing where they fail."""

import warnings
from pathlib import Path
from typing import Any

__all__ = ["read_quietly"]


def read_quietly(path: Path) -> Any:
    """Read a file with pyvista; None where VTK cannot make sense of it."""
    import pyvista

    with pyvista.vtk_verbosity("off"), warnings.catch_warnings():
        warnings.filterwarnings("error", message="The VTK reader")
        try:
            return pyvista.read(path)
        except (ValueError, OSError, RuntimeError, UserWarning):
            return None
