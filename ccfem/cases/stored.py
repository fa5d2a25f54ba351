"""Stored meshes and outlines of the cases that come with ccfem, so that a first run need not wait.

``data/manifest.toml`` says what each file is, which command made it, and its SHA-256.
"""

import hashlib
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh.tet_mesh import TetMesh

COMMAND = "python -m ccfem.cases.storing"
"""The command that makes the files."""


def data_folder() -> Path:
    """Folder of the shipped cases: in the installed package, else in the repository."""
    package = Path(__file__).resolve().parents[1]
    packaged = package / "data"
    return packaged if (packaged / "manifest.toml").exists() else package.parent / "data"


def manifest() -> dict[str, Any]:
    """Entries of the manifest by name of the case; empty where there is none."""
    path = data_folder() / "manifest.toml"
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def stored_mesh(name: str, element_size: float) -> TetMesh | None:
    """Read the stored mesh of a case; None where there is none of this element size, mm."""
    path = _stored_file(name, "element_size", element_size)
    return None if path is None else read_mesh(path, check=False)


def stored_outline(name: str, volume_fraction: float) -> shapely.Polygon | None:
    """Read the stored outline of an optimised plate, mm; None where there is none of this share."""
    path = _stored_file(f"{name}_outline", "volume_fraction", volume_fraction)
    if path is None:
        return None
    with np.load(path, allow_pickle=False) as archive:
        border, *holes = [archive[ring] for ring in archive.files]
    return shapely.Polygon(border, holes)


def _stored_file(name: str, key: str, value: float) -> Path | None:
    """File of an entry of the manifest that has this value; None where there is none."""
    entry = manifest().get(name)
    if entry is None or entry[key] != value:
        return None
    path = data_folder() / entry["file"]
    if not path.exists():
        return None
    if hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
        raise InputError(
            f"{path} is not the file that the manifest names (its SHA-256 differs): make it again "
            f"with '{COMMAND}'"
        )
    return path
