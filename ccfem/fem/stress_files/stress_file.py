"""Stress that another program found, read from its file onto a mesh of ccfem."""

import os
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError, shown
from ccfem.base.tensor import from_voigt
from ccfem.base.whole import existing_file
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.part_stress import LARGEST_STRESS, GivenStress, impossible_stress
from ccfem.fem.stress_files.frd import frd_stress
from ccfem.fem.stress_files.stress_data import COMPONENTS, StressData
from ccfem.fem.stress_files.stress_table import table_stress
from ccfem.fem.stress_files.vtu_tensors import vtu_stress
from ccfem.geometry.facets import positions

_MPA = {"pa": 1e-6, "kpa": 1e-3, "mpa": 1.0, "n/mm^2": 1.0, "n/mm2": 1.0, "gpa": 1e3}
_SAME = 1e-5
"""Distance over the size of the part within which nodes are the same: files have six digits."""


def read_stress(
    path: str | os.PathLike[str],
    mesh: TetMesh,
    unit: str | None = None,
    array: str = "stress",
    held_or_loaded: tuple[str, ...] = (),
) -> GivenStress:
    """Read stress from a file and map it to a mesh.

    Parameters
    ----------
    path : path
        ``.vtu``, ``.frd`` of CalculiX, or ``.csv`` by element or node
        (`ccfem.fem.stress_files.stress_table`).
    mesh : TetMesh
        Of the part. The file must have stress for each of its corners or cells: nodes are found by
        their place, cells by their corners, and in a table both by their number.
    unit : str, optional
        Pa, kPa, MPa, N/mm^2 or GPa; needed where the file does not say. A ``.frd`` never does: its
        stress is taken for MPa, since its nodes have to lie where those of the part do, in mm.
    array : str, default "stress"
        Name of the stress in a ``.vtu`` file.
    held_or_loaded : tuple of str
        As in `GivenStress`.

    Returns
    -------
    GivenStress
        What the file lacks is made of what it has: the stress of a cell is the mean of its
        corners, that of a node the mean of the cells round it, weighted by their volumes.

    Raises
    ------
    InputError
        For another format, a missing unit or component, stress on another mesh, and stress that is
        not finite or larger than in any solid.
    """
    path = existing_file(path, "stress file")
    suffix = path.suffix.lower()
    if suffix == ".vtu":
        data = vtu_stress(path, array)
    elif suffix == ".frd":
        data = frd_stress(path)
    elif suffix == ".csv":
        data = table_stress(path)
    else:
        raise InputError(f"stress is read from .vtu, .frd or .csv; got {path}: convert it")
    assumed = ""
    if suffix == ".frd" and unit is None:
        unit, assumed = "MPa", f"the stress of {path.name} is taken for MPa, as its nodes are in mm"
    unit = _unit(path, data.unit, unit)
    factor = _MPA[unit.lower()]
    _check_values(path, data, unit)
    nodal, cell = _on_mesh(data, mesh, path)
    return GivenStress(
        mesh,
        factor * from_voigt(cell),
        factor * from_voigt(nodal),
        held_or_loaded,
        assumed=assumed,
    )


def _unit(path: Path, said: str, given: str | None) -> str:
    """Find the unit of the stress in a file: a key of `_MPA` but for its case."""
    if said and given and _MPA.get(said.lower()) != _MPA.get(given.lower()):
        raise InputError(f"{path} holds stress in {said}; got the unit {given}: leave it out")
    unit = said or given
    if not unit:
        raise InputError(
            f"{path} does not say the unit of its stress: give it, as MPa or Pa, with --stress-unit"
        )
    if unit.lower() not in _MPA:
        raise InputError(f"unit of stress must be Pa, kPa, MPa, N/mm^2 or GPa; got {shown(unit)}")
    return unit


def _check_values(path: Path, data: StressData, unit: str) -> None:
    """Raise where the stress of a node or an element is none that a solid has."""
    for what, values, numbers in (
        ("node", data.nodal, data.nodes),
        ("element", data.cell, data.cells),
    ):
        if values is None:
            continue
        with np.errstate(over="ignore"):  # what overflows is beyond all bounds
            at = impossible_stress(_MPA[unit.lower()] * values)
        if at is not None:
            row, column = at
            raise InputError(
                f"{path}: stress must be finite and within {LARGEST_STRESS:g} MPa; got "
                f"{values[row, column]:g} {unit} as {COMPONENTS[column]} of {what} "
                f"{row if numbers is None else numbers[row]}: correct it, or the unit of all"
            )


def _on_mesh(data: StressData, mesh: TetMesh, path: Path) -> tuple[FloatArray, FloatArray]:
    """Stress, Voigt, at the nodes (n, 6) and in the cells (m, 6) of the mesh."""
    corners = np.unique(mesh.corners)
    nodal = cell = None
    if data.points is None:
        nodal, cell = _by_number(data, mesh, corners, path)
    else:
        assert data.corners is not None
        node = _nodes(data.points, mesh, corners, path)
        if data.nodal is not None:
            nodal = np.where(node[:, None] >= 0, data.nodal[node], np.nan)
        at = positions(node[mesh.corners], data.corners)
        if (at < 0).any():
            raise InputError(
                f"{path} has other cells than the part: {int((at < 0).sum())} of "
                f"{len(mesh.cells)} are not in it: write the stress on the mesh of the part"
            )
        cell = None if data.cell is None else data.cell[at]
    if nodal is not None:
        nodal = _with_middles(mesh, nodal)
        if cell is None:
            cell = nodal[mesh.corners].mean(axis=1)
    if nodal is None:
        assert cell is not None
        nodal = _averaged(mesh, cell)
    assert cell is not None
    return nodal, cell


def _by_number(
    data: StressData, mesh: TetMesh, corners: IntArray, path: Path
) -> tuple[FloatArray | None, FloatArray | None]:
    """Take the numbers of a table for those of the mesh."""
    if data.cell is not None:
        if len(data.cell) != len(mesh.cells):
            raise InputError(
                f"{path} has {len(data.cell)} elements and the part {len(mesh.cells)}: write the "
                "stress on the mesh of the part"
            )
        return None, data.cell
    assert data.nodal is not None
    linear = int(corners.max()) + 1
    if len(data.nodal) not in (linear, len(mesh.points)):
        raise InputError(
            f"{path} has {len(data.nodal)} nodes and the part {len(mesh.points)}"
            + (f", {linear} of them corners" if mesh.order == 2 else "")
            + ": write the stress on the mesh of the part"
        )
    nodal = np.full((len(mesh.points), 6), np.nan)
    nodal[: len(data.nodal)] = data.nodal
    return nodal, None


def _nodes(points: FloatArray, mesh: TetMesh, corners: IntArray, path: Path) -> IntArray:
    """Row of the file for each node (n,) of the mesh; -1 for middles that it does not have."""
    if not np.isfinite(points).all():
        raise InputError(f"{path}: nodes must be finite; got NaN or infinity: write it again")
    near = _SAME * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    n = len(mesh.points)
    if len(points) >= len(corners) and len(points) <= n:
        # In the same order, as ccfem writes them; this tells nodes on one spot apart.
        with np.errstate(over="ignore"):  # what overflows lies elsewhere
            same = np.linalg.norm(points - mesh.points[: len(points)], axis=1) <= near
        if same.all() and corners.max() < len(points):
            return np.concatenate([np.arange(len(points)), np.full(n - len(points), -1)])
    tree = cKDTree(points)
    distance, node = tree.query(mesh.points, distance_upper_bound=near)
    node = np.where(np.isfinite(distance), node, -1)
    lost = corners[node[corners] < 0]
    if len(lost):
        at = ", ".join(f"{x:.4g}" for x in mesh.points[lost[0]])
        raise InputError(
            f"{path} has no node where {len(lost)} of {len(corners)} corners of the part lie, the "
            f"first at ({at}) mm: write the stress on the mesh of the part, in mm and in its frame"
        )
    if len(np.unique(node[corners])) < len(corners):
        raise InputError(
            f"{path} numbers the nodes otherwise than the part, and some of these lie on one spot: "
            "write the stress with the part's own numbers"
        )
    return node


def _with_middles(mesh: TetMesh, nodal: FloatArray) -> FloatArray:
    """Fill in mid-side nodes that have no stress: the mean of the ends of their sides."""
    if mesh.order == 1:
        return np.nan_to_num(nodal)
    ends = mesh.cells[:, mesh.edges].reshape(-1, 2)
    middle = mesh.cells[:, 4:].reshape(-1)
    empty = np.isnan(nodal[middle, 0])
    result = nodal.copy()
    result[middle[empty]] = nodal[ends[empty]].mean(axis=1)
    return np.nan_to_num(result)


def _averaged(mesh: TetMesh, cell: FloatArray) -> FloatArray:
    """Stress at the nodes: the mean of the cells round each, weighted by their volumes."""
    total, weight = np.zeros((len(mesh.points), 6)), np.zeros(len(mesh.points))
    for column in mesh.cells.T:
        np.add.at(total, column, mesh.volumes[:, None] * cell)
        np.add.at(weight, column, mesh.volumes)
    return total / np.where(weight > 0.0, weight, 1.0)[:, None]
