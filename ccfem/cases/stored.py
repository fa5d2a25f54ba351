"""Meshes of the cases that come with ccfem, so that a first run does not wait for meshing.

``data/manifest.toml`` says what each file is, which command made it, and its SHA-256.
"""

import hashlib
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ccfem.errors import InputError
from ccfem.io import read_mesh
from ccfem.mesh import TetMesh

__all__ = ["COMMAND", "data_folder", "manifest", "mesh_of_case", "stored_mesh"]

COMMAND = "python -m ccfem.cases.build_data"
"""The command that makes the files."""


def data_folder() -> Path:
    """Folder of the stored meshes: in the installed package, else in the repository."""
    package = Path(__file__).resolve().parent.parent
    packaged = package / "data"
    return packaged if (packaged / "manifest.toml").exists() else package.parent / "data"


def manifest() -> dict[str, Any]:
    """Entries of the manifest by name of the case; empty where there is none."""
    path = data_folder() / "manifest.toml"
    if not path.exists():
        return {}
    with path.open("rb") as file:
        return tomllib.load(file)


def stored_mesh(name: str, element_size: float) -> TetMesh | None:
    """Read the stored mesh of a case; None where there is none of this element size, mm.

    Raises
    ------
    InputError
        When the file is not the one that the manifest names.
    """
    entry = manifest().get(name)
    if entry is None or entry["element_size"] != element_size:
        return None
    path = data_folder() / entry["file"]
    if not path.exists():
        return None
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != entry["sha256"]:
        raise InputError(
            f"{path} is not the file that the manifest names (its SHA-256 differs): make it again "
            f"with '{COMMAND}'"
        )
    return read_mesh(path, check=False)


def mesh_of_case(
    name: str, element_size: float, order: int, make: Callable[[float], TetMesh]
) -> TetMesh:
    """Mesh of a case: the stored one where it is of this element size, else a new one.

    Parameters
    ----------
    name : str
    element_size : float, mm
    order : {1, 2}
        Linear or quadratic.
    make : callable
        Makes the linear mesh with its patches from the element size.
    """
    if order not in (1, 2):
        raise InputError(f"order of the elements must be 1 or 2; got {order}: choose one")
    mesh = stored_mesh(name, element_size)
    if mesh is None:
        mesh = make(element_size)
    return mesh.quadratic() if order == 2 else mesh
