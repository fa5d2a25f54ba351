"""Make the stored meshes and outlines of the cases: ``python -m ccfem.cases.stored.build``."""

import hashlib
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from ccfem.body.files import whole_file, write_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.designed import ELEMENT_SIZE, THICKNESS
from ccfem.cases.stored.stored_files import COMMAND, data_folder, write_outline

CASES = (
    *("bar", "loop", "open_hole", "bracket", "t_bracket", "twist_bar", "lifting_eye"),
    *("arm_bracket", "corner_bracket"),
)
DESIGNED = ("bridge", "suspension", "cantilever", "m_shape", "l_shape")
"""Cases of optimised plates: an outline and its mesh each."""


def build(folder: Path, names: Sequence[str] = (*CASES, *DESIGNED)) -> Path:
    """Make the stored meshes and outlines of cases in a folder, and their manifest: its path."""
    text = (
        "# Meshes of the cases at their default element size, mm, and outlines of the optimised\n"
        f"# plates. Made by: {COMMAND}\n"
    )
    for name in names:
        text += _designed(folder, name) if name in DESIGNED else _meshed(folder, name)
    with whole_file(folder / "manifest.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / "manifest.toml"


def _meshed(folder: Path, name: str) -> str:
    """Make the mesh of a case; its entry."""
    module = importlib.import_module(f"ccfem.cases.{name}")
    mesh = getattr(module, f"{name}_mesh")(module.ELEMENT_SIZE)
    return _mesh_entry(folder, name, mesh, module.ELEMENT_SIZE)


def _designed(folder: Path, name: str) -> str:
    """Optimise a plate, make its outline and the mesh of the part; their entries."""
    plate = getattr(importlib.import_module(f"ccfem.cases.{name}"), f"{name}_plate")()
    design = plate.design()
    outline = plate.outline(design)
    path = folder / f"{name}_outline.npz"
    write_outline(outline, path)
    points = len(outline.exterior.coords) + sum(len(ring.coords) for ring in outline.interiors)
    what = (
        f"{points} points on {1 + len(outline.interiors)} rings; compliance "
        f"{design.compliance[-1]:.4g} N mm after {design.iterations} iterations"
    )
    mesh = plate.mesh(outline, ELEMENT_SIZE, THICKNESS)
    return _entry(path, what, f"volume_fraction = {plate.volume_fraction}") + _mesh_entry(
        folder, name, mesh, ELEMENT_SIZE
    )


def _mesh_entry(folder: Path, name: str, mesh: TetMesh, element_size: float) -> str:
    """Write a mesh; its entry."""
    path = folder / f"{name}.npz"
    write_mesh(mesh, path)
    what = (
        f"{len(mesh.cells)} linear tetrahedra, {len(mesh.points)} nodes, patches "
        f"{', '.join(sorted(mesh.patches))}"
    )
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
    sys.stdout.write(build(data_folder()).read_text(encoding="utf-8"))
