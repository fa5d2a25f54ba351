"""VTK unstructured grids (``.vtu``), through pyvista."""

from pathlib import Path
from typing import Any

import numpy as np

from ccfem.arrays import IntArray
from ccfem.errors import InputError
from ccfem.io.cells import tetrahedra
from ccfem.io.quiet import read_quietly
from ccfem.mesh.patches import with_groups
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["grid_of", "read_grid", "read_vtu", "write_vtu"]

_PATCH = "patch:"
_TYPES = {
    5: "triangle",
    10: "tetra",
    11: "voxel",
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    22: "triangle6",
    24: "tetra10",
    25: "hexahedron20",
    26: "wedge15",
    27: "pyramid13",
    29: "hexahedron27",
    42: "polyhedron",
}
_TAGS = ("patch", "gmsh:physical", "CellEntityIds", "PhysicalIds")
"""Integer cell data that number the groups of triangles in files of other programs."""


def read_vtu(path: Path) -> TetMesh:
    """Read a VTK unstructured grid.

    Patches come from the field data ``patch:NAME`` that `write_vtu` writes, and from triangle
    cells with an integer cell array named patch, gmsh:physical, CellEntityIds or PhysicalIds
    (called by their number).
    """
    grid = read_grid(path)
    blocks = {
        _TYPES.get(int(kind), f"VTK cell type {kind}"): (int(kind), np.asarray(nodes))
        for kind, nodes in grid.cells_dict.items()
    }
    cells = tetrahedra([(name, nodes) for name, (_, nodes) in blocks.items()], path)
    mesh = TetMesh(np.asarray(grid.points, dtype=np.float64), cells)
    groups = {
        name.removeprefix(_PATCH): np.asarray(grid.field_data[name]).reshape(-1, 3)
        for name in grid.field_data
        if name.startswith(_PATCH)
    }
    groups = {**_tagged_triangles(grid, blocks), **groups}
    return with_groups(mesh, groups)


def read_grid(path: Path) -> Any:
    """Read an unstructured grid of pyvista."""
    with path.open("rb") as file:
        start = file.read(4096)
    if b"<VTKFile" not in start or b"UnstructuredGrid" not in start:
        raise InputError(
            f"{path} is not a VTK unstructured grid: it must hold <VTKFile type='UnstructuredGrid'>"
        )
    grid = read_quietly(path)
    if grid is None:
        raise InputError(f"{path} is not a VTK unstructured grid that can be read: write it again")
    return grid


def _tagged_triangles(grid: Any, blocks: dict[str, tuple[int, IntArray]]) -> dict[str, IntArray]:
    """Corner nodes (k, 3) of the triangles of each number."""
    tag = next((name for name in _TAGS if name in grid.cell_data), None)
    groups: dict[str, IntArray] = {}
    if tag is None or grid.cell_data[tag].dtype.kind not in "iu":
        return groups
    for kind in ("triangle", "triangle6"):
        if kind not in blocks:
            continue
        code, nodes = blocks[kind]
        numbers = np.asarray(grid.cell_data[tag])[np.asarray(grid.celltypes) == code]
        for number in np.unique(numbers):
            groups[str(number)] = nodes[numbers == number][:, :3]
    return groups


def write_vtu(mesh: TetMesh, path: Path) -> None:
    """Write a mesh as VTK unstructured grid, its patches as field data ``patch:NAME``."""
    grid_of(mesh).save(path)


def grid_of(mesh: TetMesh) -> Any:
    """Unstructured grid of pyvista of a mesh, its patches as field data ``patch:NAME``."""
    import pyvista

    code = 10 if mesh.order == 1 else 24
    grid = pyvista.UnstructuredGrid({code: mesh.cells}, np.array(mesh.points))
    for name, facets in mesh.patches.items():
        if len(facets):
            grid.field_data[_PATCH + name] = np.array(facets)
    return grid
