"""VTK unstructured grids (``.vtu``, legacy ``.vtk``, XDMF): read by VTK in its own process."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.files.cells import is_axis, tetrahedra, triangles_of, with_groups
from ccfem.body.files.vtk_xml import write_vtk_xml
from ccfem.body.isolated.process import ChildError, read_isolated
from ccfem.body.mesh import TetMesh

_PATCH, _AXIS = "patch:", "axis:"
SOLIDS = {
    10: "tetra",
    11: "hexahedron",
    12: "hexahedron",
    13: "wedge",
    14: "pyramid",
    24: "tetra10",
    25: "hexahedron20",
    26: "wedge15",
    27: "pyramid13",
    29: "hexahedron27",
    32: "wedge18",
}
"""Cells with a volume in meshio's words by VTK's number of their type; voxels in their order."""
_OTHER_SOLIDS = {15, 16, 31, 33, 37, 41, 42, *range(63, 69), *range(71, 75), *range(78, 82)}
"""Types of cells with a volume that are not taken."""
FLAT = {5: 3, 22: 3, 9: 4, 23: 4, 28: 4}
"""Corners of triangles and quadrangles by VTK's number of their type."""
_TAGS = ("patch", "gmsh:physical", "CellEntityIds", "PhysicalIds")
"""Integer cell data that number the groups of triangles in files of other programs."""


def read(path: Path) -> TetMesh:
    """Read a VTK unstructured grid.

    Patches come from the field data ``patch:NAME`` that `write` writes, with the axes of round ones
    in ``axis:NAME``, and from triangles and
    quadrangles with an integer cell array named patch, gmsh:physical, CellEntityIds or PhysicalIds
    (called by their number).
    """
    grid = read_grid(path)
    mesh = tetrahedra(grid.points, grid.blocks, path).mesh(path)
    groups = {
        name.removeprefix(_PATCH): facets.reshape(-1, 3)
        for name, facets in grid.field.items()
        if name.startswith(_PATCH) and facets.dtype.kind in "iu" and facets.size % 3 == 0
    }
    axes = {
        name.removeprefix(_AXIS): axis.reshape(-1)
        for name, axis in grid.field.items()
        if name.startswith(_AXIS) and name.removeprefix(_AXIS) in groups and is_axis(axis)
    }
    return with_groups(mesh, {**_tagged_triangles(grid), **groups}).with_patches({}, axes)


@dataclass(frozen=True)
class Grid:
    """An unstructured grid as arrays.

    Attributes
    ----------
    points : (n, 3) array
    types : (m,) int array
        VTK's number of the type of each cell.
    cells : dict of type to (k, q) int array
        Nodes of the cells of each type, in their order; (k, 0) of those that ccfem does not take.
    point, cell, field : dict of name to array
        Data of points, of cells, and of the whole.
    components : dict of (where, name) to list of str
        Names of the components of data, where they have some.
    steps : int
        Of the series that it is of.
    """

    points: FloatArray
    types: IntArray
    cells: dict[int, IntArray]
    point: dict[str, Any]
    cell: dict[str, Any]
    field: dict[str, Any]
    components: dict[tuple[str, str], list[str]]
    steps: int = 1

    @property
    def blocks(self) -> list[tuple[str, IntArray]]:
        """Cells in meshio's words and order."""
        blocks = []
        for kind, nodes in self.cells.items():
            other = "polyhedron of VTK's" if kind in _OTHER_SOLIDS else "VTK cell"
            in_order = nodes[:, [0, 1, 3, 2, 4, 5, 7, 6]] if kind == _VOXEL else nodes
            blocks.append((SOLIDS.get(kind, f"{other} type {kind}"), in_order))
        return blocks


_VOXEL = 11


def read_grid(path: Path, step: int = 1) -> Grid:
    """Read an unstructured grid; of a series in XDMF the step, from 1."""
    with path.open("rb") as file:
        start = file.read(4096)
    if path.suffix.lower() == ".vtk":
        marks, must = (b"# vtk DataFile", b"UNSTRUCTURED_GRID"), "begin with '# vtk DataFile' and "
        must += "have DATASET UNSTRUCTURED_GRID"
    elif path.suffix.lower() == ".xdmf":
        marks, must = (b"<Xdmf", b">"), "hold <Xdmf>"
    else:
        marks = (b"<VTKFile", b"UnstructuredGrid")
        must = "hold <VTKFile type='UnstructuredGrid'>"
    if not all(mark in start for mark in marks):
        raise InputError(f"{path} is not a VTK unstructured grid: it must {must}")
    try:
        if path.suffix.lower() == ".xdmf":
            arrays = read_isolated("vtk_files:read_xdmf", path, step=step)
        else:
            arrays = read_isolated("vtk_files:read_grid", path)
    except ChildError as error:
        raise InputError(
            f"{path} is not a VTK unstructured grid that can be read: {error}: write it again"
        ) from None
    parts: dict[str, dict[str, Any]] = {
        kind: {k.partition(":")[2]: v for k, v in arrays.items() if k.startswith(f"{kind}:")}
        for kind in ("cells", "point", "cell", "field", "components")
    }
    return Grid(
        np.asarray(arrays["points"], dtype=np.float64),
        arrays["types"].astype(np.int64),
        {int(kind): nodes for kind, nodes in parts["cells"].items()},
        parts["point"],
        parts["cell"],
        parts["field"],
        {
            (name.partition(":")[0], name.partition(":")[2]): names.tolist()
            for name, names in parts["components"].items()
        },
        int(arrays.get("steps", 1)),
    )


def _tagged_triangles(grid: Grid) -> dict[str, IntArray]:
    """Corner nodes (k, 3) of the triangles of each number, quadrangles cut."""
    tag = next((name for name in _TAGS if name in grid.cell), None)
    groups: dict[str, list[IntArray]] = {}
    if tag is None or grid.cell[tag].dtype.kind not in "iu" or grid.cell[tag].ndim != 1:
        return {}
    for kind, count in FLAT.items():
        if kind not in grid.cells:
            continue
        numbers, corners = grid.cell[tag][grid.types == kind], grid.cells[kind][:, :count]
        for number in np.unique(numbers):
            groups.setdefault(str(number), []).append(triangles_of(corners[numbers == number]))
    return {name: np.concatenate(parts) for name, parts in groups.items()}


def write(
    mesh: TetMesh,
    path: Path,
    point: Mapping[str, ArrayLike] | None = None,
    cell: Mapping[str, ArrayLike] | None = None,
    field: Mapping[str, ArrayLike] | None = None,
    components: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write a mesh as VTK unstructured grid, its patches as field data ``patch:NAME``.

    The axes of round ones are in ``axis:NAME``. To be called with a file of `whole_file`, and with
    data of points, of cells, and of the whole, and the names of its components.
    """
    number, corners = mesh.cells.shape
    write_vtk_xml(
        path,
        "UnstructuredGrid",
        {"Points": len(mesh.points), "Cells": number},
        {
            _active("PointData", point): point or {},
            _active("CellData", cell): cell or {},
            "Points": {"Points": mesh.points},
            "Cells": {
                "connectivity": mesh.cells.ravel(),
                "offsets": corners * np.arange(1, number + 1),
                "types": np.full(number, 10 if mesh.order == 1 else 24, dtype=np.uint8),
            },
        },
        {
            **{_PATCH + name: facets for name, facets in mesh.patches.items() if len(facets)},
            **{_AXIS + name: axis for name, axis in mesh.axes.items()},
            **(field or {}),
        },
        components,
    )


def _active(tag: str, arrays: Mapping[str, ArrayLike] | None) -> str:
    """Tag of a section that makes its first array the one that viewers draw."""
    return f"{tag} Scalars={quoteattr(next(iter(arrays)))}" if arrays else tag
