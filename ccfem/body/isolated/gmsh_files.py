"""Meshes of Gmsh, read by meshio, to plain arrays."""

from typing import Any

import numpy as np


def read(path: str) -> dict[str, Any]:
    """Points, cells and groups of triangles of a .msh file.

    Names are ``points``, ``cells:K:TYPE`` for the k-th block, and ``group:K:NAME`` for rows of it.
    """
    import meshio

    mesh = meshio.gmsh.read(path)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:  # meshio makes no complaint of a file without
        raise ValueError("it holds no nodes")
    arrays: dict[str, Any] = {"points": points}
    names = {int(tag): name for name, (tag, size) in mesh.field_data.items() if size == 2}
    tags = mesh.cell_data.get("gmsh:physical", [None] * len(mesh.cells))
    for k, block in enumerate(mesh.cells):
        arrays[f"cells:{k}:{block.type}"] = np.asarray(block.data)
        if not block.type.startswith("triangle"):
            continue
        for tag in np.unique(tags[k]) if tags[k] is not None else []:
            if tag > 0:
                name = names.get(int(tag), str(tag))
                arrays[f"group:{k}:{name}"] = np.flatnonzero(np.asarray(tags[k]) == tag)
        for name, members in mesh.cell_sets.items():
            if not name.startswith("gmsh:") and members[k] is not None and len(members[k]):
                arrays[f"group:{k}:{name}"] = np.asarray(members[k], dtype=np.int64)
    return arrays
