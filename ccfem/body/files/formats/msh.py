"""Gmsh ``.msh`` meshes, versions 2.2 and 4.1, text or binary: meshio in a process of its own.

What Gmsh itself reads of other programs, it reads likewise.
"""

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import IntArray
from ccfem.base.errors import InputError
from ccfem.body.files.cells import tetrahedra, triangles_of, with_groups
from ccfem.body.isolated.process import ChildError, read_isolated
from ccfem.body.mesh import TetMesh


def read(path: Path) -> TetMesh:
    """Read a Gmsh mesh; physical groups of triangles and quadrangles become patches.

    A group without a name is called by its number. Quadratic tetrahedra come in VTK order: Gmsh
    swaps the last two mid-side nodes and meshio swaps them back.
    """
    with path.open("rb") as file:
        start = file.read(256)
    if b"$MeshFormat" not in start and not start.startswith(b"$Comments"):
        raise InputError(f"{path} is not a Gmsh mesh: it must begin with $MeshFormat")
    try:
        arrays = read_isolated("gmsh_files:read", path)
    except ChildError as error:
        raise InputError(
            f"{path} is not a Gmsh mesh that can be read ({error}): save it again as version 4.1, "
            "without all elements (Mesh.SaveAll = 0)"
        ) from None
    return _with_groups(arrays, path)


def read_by_gmsh(path: Path) -> TetMesh:
    """Read a mesh of another program that Gmsh knows: MED, Nastran, Medit.

    Groups of facets become patches by their name; those of Nastran and Medit have none and are
    called by the number of their property or region.
    """
    if importlib.util.find_spec("gmsh") is None:
        raise InputError(
            f"{path}: {path.suffix} files are read by Gmsh, which is not installed: pip install "
            "'ccfem[cad]', or give the mesh as .msh or .vtu"
        )
    try:
        arrays = read_isolated("gmsh_files:read_other", path)
    except ChildError as error:
        raise InputError(
            f"{path} is not a mesh that Gmsh can read ({error}): export it again, or as .msh or "
            ".vtu"
        ) from None
    return _with_groups(arrays, path)


def _with_groups(arrays: Mapping[str, NDArray[Any]], path: Path) -> TetMesh:
    """Mesh with patches of arrays as `ccfem.body.isolated.gmsh_files` returns them."""
    parts = {name: name.split(":", 2) for name in arrays}
    blocks = {p[1]: (p[2], arrays[name]) for name, p in parts.items() if p[0] == "cells"}
    mesh = tetrahedra(arrays["points"][:, :3], blocks.values(), path).mesh(path)
    groups: dict[str, list[IntArray]] = {}
    for name, (kind, *rest) in parts.items():
        if kind == "group":
            word, nodes = blocks[rest[0]]
            corners = nodes[arrays[name], : 4 if word.startswith("quad") else 3]
            groups.setdefault(rest[1], []).append(triangles_of(corners))
    return with_groups(mesh, {name: np.concatenate(facets) for name, facets in groups.items()})
