"""Meshes of Gmsh, read by meshio, to plain arrays."""

import re
from pathlib import Path
from typing import Any

import numpy as np

_NAME = re.compile(rb'^[ \t]*(\d+)[ \t]+(\d+)[ \t]+"(.*)"', re.M)
"""Dimension, number and name of a physical group."""


def read(path: str) -> dict[str, Any]:
    """Points, cells and groups of triangles of a .msh file.

    Names are ``points``, ``cells:K:TYPE`` for the k-th block, and ``group:K:NAME`` for rows of it.
    """
    import meshio

    path, names = _with_distinct_names(path)
    mesh = meshio.gmsh.read(path)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:  # meshio makes no complaint of a file without
        raise ValueError("it holds no nodes")
    arrays: dict[str, Any] = {"points": points}
    untagged = [np.zeros(len(block.data)) for block in mesh.cells]
    tags = mesh.cell_data.get("gmsh:physical", untagged)
    for k, block in enumerate(mesh.cells):
        arrays[f"cells:{k}:{block.type}"] = np.asarray(block.data)
        if not block.type.startswith("triangle"):
            continue
        groups = {f"2:{tag}": tags[k] == tag for tag in np.unique(tags[k]) if tag > 0}
        for group, rows in mesh.cell_sets.items():
            if group in names and rows[k] is not None and len(rows[k]):
                groups[group] = np.isin(np.arange(len(block.data)), rows[k])
        for group, inside in groups.items():
            key = f"group:{k}:{names.get(group, group[2:])}"
            arrays[key] = np.union1d(arrays.get(key, []), np.flatnonzero(inside)).astype(np.int64)
    return arrays


def _with_distinct_names(path: str) -> tuple[str, dict[str, str]]:
    """Copy of a file whose groups are called ``DIMENSION:NUMBER``, and the names they had.

    meshio knows groups by their names alone: of a volume and a surface of one name it keeps one.
    """
    content = Path(path).read_bytes()
    start, end = content.find(b"$PhysicalNames"), content.find(b"$EndPhysicalNames")
    section = content[start:end] if 0 <= start < end else b""
    names = {
        f"{int(d)}:{int(k)}": name.decode(errors="replace") for d, k, name in _NAME.findall(section)
    }
    if not names:
        return path, names
    with Path("renamed.msh").open("wb") as copy:  # in the folder of this process
        copy.write(content[:start] + _NAME.sub(_by_number, section) + content[end:])
    return copy.name, names


def _by_number(row: re.Match[bytes]) -> bytes:
    return b'%d %d "%d:%d"' % (*map(int, row.groups()[:2]), *map(int, row.groups()[:2]))
