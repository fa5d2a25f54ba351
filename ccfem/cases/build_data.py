"""Make the stored meshes of the cases: ``python -m ccfem.cases.build_data``."""

import hashlib
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path

from ccfem.cases.stored import COMMAND, data_folder
from ccfem.io import whole_file, write_mesh

__all__ = ["build"]

_CASES = ("bar", "loop", "open_hole")


def build(folder: Path, names: Sequence[str] = _CASES) -> Path:
    """Make the stored meshes and their manifest.

    Parameters
    ----------
    folder : Path
        Where to write; it must exist.
    names : sequence of str
        Cases to make.

    Returns
    -------
    Path
        The manifest.
    """
    text = f"# Meshes of the cases at their default element size, mm. Made by: {COMMAND}\n"
    for name in names:
        module = importlib.import_module(f"ccfem.cases.{name}")
        mesh = getattr(module, f"{name}_mesh")(module.ELEMENT_SIZE)
        path = folder / f"{name}.npz"
        write_mesh(mesh, path)
        text += (
            f"\n[{name}]\n"
            f'file = "{path.name}"\n'
            f'what = "{len(mesh.cells)} linear tetrahedra, {len(mesh.points)} nodes, patches '
            f'{", ".join(sorted(mesh.patches))}"\n'
            f'command = "{COMMAND}"\n'
            f"element_size = {module.ELEMENT_SIZE}\n"
            f'sha256 = "{hashlib.sha256(path.read_bytes()).hexdigest()}"\n'
        )
    with whole_file(folder / "manifest.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return folder / "manifest.toml"


if __name__ == "__main__":
    sys.stdout.write(build(data_folder()).read_text(encoding="utf-8"))
