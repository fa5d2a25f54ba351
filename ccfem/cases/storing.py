"""Make the stored meshes and outlines of the cases: ``python -m ccfem.cases.storing``."""

import hashlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ccfem.body.files import whole_file, write_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.bodies import BODIES
from ccfem.cases.designed import ELEMENT_SIZE, PLATES, THICKNESS
from ccfem.cases.stored import COMMAND, data_folder


def store(folder: Path, names: Sequence[str] = (*BODIES, *PLATES)) -> Path:
    """Make the stored meshes and outlines of cases in a folder, and their manifest: its path."""
    text = (
        "# Meshes of the cases at their default element size, mm, and outlines of the optimised\n"
        f"# plates. Made by: {COMMAND}\n"
    )
    for name in names:
        if name in PLATES:
            text += "".join(_plate_entries(folder, name))
        else:
            make, element_size = BODIES[name]
            text += _mesh_entry(folder / f"{name}.npz", make(element_size), element_size)
    with whole_file(folder / "manifest.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / "manifest.toml"


def _plate_entries(folder: Path, name: str) -> Iterator[str]:
    """Optimise a plate, write its outline and the mesh of the part; their entries."""
    plate = PLATES[name]
    design = plate.design()
    outline = plate.outline(design)
    path = folder / f"{name}_outline.npz"
    write_outline(outline, path)
    points = len(outline.exterior.coords) + sum(len(ring.coords) for ring in outline.interiors)
    what = (
        f"{points} points on {1 + len(outline.interiors)} rings; compliance "
        f"{design.compliance[-1]:.4g} N mm after {design.iterations} iterations"
    )
    yield _entry(path, what, f"volume_fraction = {plate.volume_fraction}")
    mesh = plate.mesh(outline, ELEMENT_SIZE, THICKNESS)
    yield _mesh_entry(folder / f"{name}.npz", mesh, ELEMENT_SIZE)


def write_outline(polygon: shapely.Polygon, path: Path) -> None:
    """Write a polygon to a compressed NumPy archive: its border, then its holes."""
    rings = [polygon.exterior, *polygon.interiors]
    arrays: dict[str, Any] = {f"ring_{k}": np.asarray(r.coords) for k, r in enumerate(rings)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def _mesh_entry(path: Path, mesh: TetMesh, element_size: float) -> str:
    """Write a mesh; its entry."""
    write_mesh(mesh, path)
    what = f"{len(mesh.cells)} linear tetrahedra, {len(mesh.points)} nodes"
    if mesh.patches:
        what += f", patches {mesh.patch_list}"
    return _entry(path, what, f"element_size = {element_size}")


def _entry(path: Path, what: str, made_for: str) -> str:
    """Entry of the manifest for a file that was written."""
    return (
        f"\n[{path.stem}]\n"
        f'file = "{path.name}"\n'
        f'what = "{what}"\n'
        f'command = "{COMMAND}"\n'
        f"{made_for}\n"
        f'sha256 = "{hashlib.sha256(path.read_bytes()).hexdigest()}"\n'
    )


if __name__ == "__main__":
    sys.stdout.write(store(data_folder()).read_text(encoding="utf-8"))
