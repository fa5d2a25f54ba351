"""Gmsh ``.msh`` meshes, versions 2.2 and 4.1, text or binary, through meshio."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.arrays import IntArray
from ccfem.errors import InputError
from ccfem.io.cells import tetrahedra
from ccfem.mesh.patches import with_groups
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["read_msh"]

_TAG = "gmsh:physical"
_BROKEN = (ValueError, LookupError, TypeError, EOFError, AssertionError, MemoryError, OverflowError)
"""What meshio raises on broken files."""


def read_msh(path: Path) -> TetMesh:
    """Read a Gmsh mesh; physical groups of triangles become patches.

    A group without a name is called by its number. Quadratic tetrahedra come in VTK order: Gmsh
    swaps the last two mid-side nodes and meshio swaps them back.
    """
    import meshio

    with path.open("rb") as file:
        start = file.read(256)
    if b"$MeshFormat" not in start and not start.startswith(b"$Comments"):
        raise InputError(f"{path} is not a Gmsh mesh: it must begin with $MeshFormat")
    try:
        found = meshio.gmsh.read(path)
    except (meshio.ReadError, struct.error, *_BROKEN) as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        raise InputError(
            f"{path} is not a Gmsh mesh that can be read ({reason}): save it again as version 4.1"
        ) from None
    cells = tetrahedra([(block.type, block.data) for block in found.cells], path)
    mesh = TetMesh(np.asarray(found.points, dtype=np.float64)[:, :3], cells)
    return with_groups(mesh, _triangle_groups(found))


def _triangle_groups(found: Any) -> dict[str, IntArray]:
    """Corner nodes (k, 3) of the triangles in each physical group."""
    groups: dict[str, list[IntArray]] = {}
    names = {
        int(tag): name for name, (tag, dimension) in found.field_data.items() if dimension == 2
    }
    tags = found.cell_data.get(_TAG, [None] * len(found.cells))
    for k, block in enumerate(found.cells):
        if not block.type.startswith("triangle"):
            continue
        corners = np.asarray(block.data)[:, :3]
        for tag in np.unique(tags[k]) if tags[k] is not None else []:
            if tag > 0:
                name = names.get(int(tag), str(tag))
                groups.setdefault(name, []).append(corners[tags[k] == tag])
        for name, members in found.cell_sets.items():
            if not name.startswith("gmsh:") and members[k] is not None and len(members[k]):
                chosen = np.asarray(members[k], dtype=np.int64)
                groups.setdefault(name, []).append(corners[chosen])
    return {name: np.concatenate(parts) for name, parts in groups.items()}
