"""Meshes of Gmsh, read by meshio, and of other programs, read by Gmsh, to plain arrays."""

import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np

_NAME = re.compile(rb'^[ \t]*(\d+)[ \t]+(\d+)[ \t]+"(.*)"', re.M)
"""Dimension, number and name of a physical group."""
_FLAT = ("triangle", "quad")


def read(path: str) -> dict[str, Any]:
    """Points, cells and groups of facets of a .msh file.

    Names are ``points``, ``cells:K:TYPE`` for the k-th block, and ``group:K:NAME`` for rows of it.
    """
    import meshio

    path, names = _with_distinct_names(path)
    meshio._mesh.topological_dimension.setdefault("wedge15", 3)  # the one cell that it forgot
    mesh = meshio.gmsh.read(path)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:  # meshio makes no complaint of a file without
        raise ValueError("it holds no nodes")
    arrays: dict[str, Any] = {"points": points}
    untagged = [np.zeros(len(block.data)) for block in mesh.cells]
    tags = mesh.cell_data.get("gmsh:physical", untagged)
    for k, block in enumerate(mesh.cells):
        nodes = np.asarray(block.data)
        order = _ORDERS[block.type] if block.type in _LEFT else slice(None)
        arrays[f"cells:{k}:{block.type}"] = nodes[:, order]
        if not block.type.startswith(_FLAT):
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


_TYPES = {
    2: "triangle",
    9: "triangle6",
    3: "quad",
    16: "quad8",
    10: "quad9",
    4: "tetra",
    11: "tetra10",
    7: "pyramid",
    19: "pyramid13",
    14: "pyramid14",
    6: "wedge",
    18: "wedge15",
    13: "wedge18",
    5: "hexahedron",
    17: "hexahedron20",
    12: "hexahedron27",
}
"""Cells in meshio's words by Gmsh's number of their type."""
_ORDERS = {
    "tetra10": [*range(8), 9, 8],
    "pyramid13": [*range(5), 5, 8, 10, 6, 7, 9, 11, 12],
    "pyramid14": [*range(5), 5, 8, 10, 6, 7, 9, 11, 12, 13],
    "wedge15": [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11],
    "wedge18": [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16],
    "hexahedron20": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
    "hexahedron27": [
        *(*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15),
        *(22, 23, 21, 24, 20, 25, 26),
    ],
}
"""Nodes of Gmsh's cells in VTK's order."""
_LEFT = ("pyramid14", "wedge18")
"""Cells that meshio leaves in Gmsh's order."""


def read_other(path: str) -> dict[str, Any]:
    """Points, cells and groups of facets of a file of another program, as `read`.

    Groups are called by their names, or by the number of the property or region of their facets.
    """
    import gmsh

    # Gmsh goes by suffixes in lower case, and takes a file of another one for a script to run.
    copy = f"copy{Path(path).suffix.lower()}"  # in the folder of this process
    shutil.copyfile(path, copy)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.open(copy)
        model = gmsh.model
        nodes, points, _ = model.mesh.getNodes()
        if not len(nodes):
            raise ValueError("it holds no nodes")
        order = np.argsort(nodes, kind="stable")
        arrays: dict[str, Any] = {"points": points.reshape(-1, 3)[order]}
        for entity in (e for e in model.getEntities() if e[0] > 1):
            groups = model.getPhysicalGroupsForEntity(*entity)
            names = [model.getPhysicalName(entity[0], k).strip() or str(k) for k in groups]
            for kind, cells, corners in zip(*model.mesh.getElements(*entity), strict=True):
                rows = np.searchsorted(nodes[order], corners).reshape(len(cells), -1)
                block = f"{entity[0]}_{entity[1]}_{kind}"
                name = _TYPES.get(kind) or model.mesh.getElementProperties(kind)[0].lower()
                arrays[f"cells:{block}:{name}"] = rows[:, _ORDERS.get(name, slice(None))]
                for group in (names or [str(entity[1])]) if name.startswith(_FLAT) else ():
                    arrays[f"group:{block}:{group}"] = np.arange(len(rows))
        return arrays
    finally:
        gmsh.finalize()
