"""Files of the stored meshes and outlines: where they are, and how they are read and written.

``data/manifest.toml`` says what each file is, which command made it, and its SHA-256.
"""

import hashlib
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.problem import Order

COMMAND = "python -m ccfem.cases.stored.build"
"""The command that makes the files."""


def data_folder() -> Path:
    """Folder of the stored meshes: in the installed package, else in the repository."""
    package = Path(__file__).resolve().parents[2]
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


def write_outline(polygon: shapely.Polygon, path: Path) -> None:
    """Write a polygon to a compressed NumPy archive: its border, then its holes."""
    rings = [polygon.exterior, *polygon.interiors]
    arrays: dict[str, Any] = {f"ring_{k}": np.asarray(r.coords) for k, r in enumerate(rings)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _stored_file(name: str, key: str, value: float) -> Path | None:
    """File of an entry of the manifest that has this value; None where there is none.

    Raises
    ------
    InputError
        When the file is not the one that the manifest names.
    """
    entry = manifest().get(name)
    if entry is None or entry[key] != value:
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
    return path


def mesh_of_case(
    name: str, element_size: float, order: Order, make: Callable[[float], TetMesh]
) -> TetMesh:
    """Mesh of a case: the stored one where it is of this element size, else a new one.

    Parameters
    ----------
    element_size : float, mm
    order : 1, 2 or "auto"
        Linear or quadratic.
    make : callable
        Makes the linear mesh with its patches from the element size.
    """
    if order not in (1, 2, "auto"):
        raise InputError(f"order of the elements must be 1, 2 or 'auto'; got {order!r}: choose one")
    mesh = stored_mesh(name, element_size)
    if mesh is None:
        mesh = make(element_size)
    return mesh.quadratic() if order == 2 else mesh
