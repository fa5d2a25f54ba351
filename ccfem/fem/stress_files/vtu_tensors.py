"""Stress tensors in VTK unstructured grids, with names of their components and their unit."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import to_voigt
from ccfem.body.files.formats.vtu import Grid, read_grid
from ccfem.fem.stress_files.stress_data import COMPONENTS, StressData, component_order

UNIT = "unit of stress"
"""Field data that holds the unit."""
VTK_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Components of VTK's symmetric tensors in their order."""


def vtk_tensors(tensors: FloatArray) -> FloatArray:
    """Symmetric tensors (k, 3, 3) as the six components (k, 6) of `VTK_COMPONENTS`."""
    return to_voigt(tensors)[:, [COMPONENTS.index(component) for component in VTK_COMPONENTS]]


def vtu_stress(path: Path, array: str) -> StressData:
    """Stress at the nodes and in the cells of a grid, as far as it has an array of that name.

    Arrays of nine components are full tensors, row by row; those of six must name their components
    (xx, yy, zz, yz, xz, xy in any order, as xx, Sxx or S11).
    """
    grid = read_grid(path)
    nodal, cell = (_tensors(grid, where, array, path) for where in ("point", "cell"))
    if nodal is None and cell is None:
        known = sorted({*grid.point, *grid.cell})
        raise InputError(
            f"{path} has no array '{array}'; there are: {', '.join(known) or 'none'}: name the "
            "one that holds the stress"
        )
    tetrahedra = [nodes for kind, nodes in grid.cells.items() if kind in (10, 24)]
    if len(tetrahedra) != 1 or len(tetrahedra[0]) != len(grid.types):
        raise InputError(f"{path}: expected tetrahedra of one kind only; mesh the part with those")
    unit = _text(grid.field.get(UNIT, np.array([])))
    corners = np.asarray(tetrahedra[0], dtype=np.int64)[:, :4]
    return StressData(grid.points, corners, nodal, cell, unit)


def _text(values: NDArray[np.generic]) -> str:
    """Text of field data: bytes of its UTF-8, or strings, of which the first counts."""
    if values.dtype == np.uint8:
        return values.tobytes().decode(errors="replace")
    return str(values.flat[0]) if values.size else ""


def _tensors(grid: Grid, where: str, name: str, path: Path) -> FloatArray | None:
    """Voigt components (k, 6) of an array; None where there is no such array."""
    data = grid.point if where == "point" else grid.cell
    if name not in data:
        return None
    if data[name].dtype.kind not in "fiu":
        raise InputError(f"{path}: array '{name}' must hold numbers; got {data[name].dtype}")
    values = np.asarray(data[name], dtype=np.float64)
    if values.ndim == 3 and values.shape[1:] == (3, 3):
        values = values.reshape(-1, 9)
    if values.ndim != 2 or values.shape[1] not in (6, 9):
        raise InputError(
            f"{path}: array '{name}' must have six or nine components; got shape {values.shape}"
        )
    if values.shape[1] == 9:
        full = values.reshape(-1, 3, 3)
        return to_voigt(0.5 * full + 0.5 * full.swapaxes(1, 2))
    names = grid.components.get((where, name), [""] * 6)
    return values[:, component_order(names, f"{path}: array '{name}'")]
