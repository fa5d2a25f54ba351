"""Stress that another program found, read from its file onto a mesh of ccfem."""

import csv
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError, shown
from ccfem.base.tensor import from_voigt, to_voigt
from ccfem.base.whole import existing_file, text_of
from ccfem.body.files.cells import CORNERS, tetrahedra
from ccfem.body.files.formats.vtu import FLAT, SOLIDS, Grid, read_grid
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.stress_field import LARGEST_STRESS, GivenStress, impossible_stress
from ccfem.fem.stress_files.stress_arrays import (
    COMPONENTS,
    StressData,
    component_of,
    component_order,
)
from ccfem.geometry.facets import positions

# Results of CalculiX (``.frd``).


_SOLIDS = {1: (8, 8), 2: (6, 6), 3: (4, 4), 4: (8, 20), 5: (6, 15), 6: (4, 10)}
"""Corners and nodes of the solids by element type (CalculiX 2.20 user's manual, section 11)."""
_STARTS = (13, 25, 37, 49, 61, 73)
"""Columns where the values of a node begin, twelve wide each."""


@dataclass(frozen=True)
class _Result:
    """Stress of one increment or mode, as lines, with its step and its time or frequency."""

    step: int
    value: float
    is_mode: bool
    lines: list[str]

    @classmethod
    def of(cls, heading: list[str], lines: list[str]) -> "_Result":
        """Take step, value and kind of a result from the lines 1PSTEP and 100C above it."""
        step, value, kind = 1, 0.0, 0
        for line in heading:
            if line.split()[:1] == ["1PSTEP"]:
                step = int(line.split()[-1])
            elif line.lstrip().startswith("100C"):
                value, kind = float(line[12:24].strip() or 0.0), int(line[56:58].strip() or 0)
        # Of a buckling step the first result is the stress before, at the value 0.
        return cls(step, value, kind == _FREQUENCY or (kind == _BUCKLING and value != 0.0), lines)

    def __str__(self) -> str:
        kind = "mode" if self.is_mode else "time"
        return f"step {self.step} ({kind} {self.value:.6g})"


_FREQUENCY, _BUCKLING = 2, 4
"""Kinds of analysis in the line 100C whose results may be modes."""
_LISTED = 8
"""Results that a message lists."""


def frd_stress(path: Path, step: int | None = None) -> StressData:
    """Stress in a file that CalculiX wrote with ``*NODE FILE`` and ``*EL FILE``.

    Parameters
    ----------
    step : int, optional
        Its last increment is read; needed where several steps have stress.

    Raises
    ------
    InputError
        When the file has no solids or no stress of that step, or other elements besides, or is cut
        off.
    """
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"expected a result file of CalculiX at {path}: {error}") from None
    points: dict[int, list[float]] = {}
    cells: list[list[int]] = []
    results: list[_Result] = []
    for block, heading, body in _result_blocks(lines, path):
        with _as_written(block, path):
            if block == "2C":
                points = _node_rows(body, 3)
            elif block == "3C":
                cells = _solids(body, path)
            elif block == "STRESS":
                results.append(_Result.of(heading, body))
    if not points or not cells:
        raise InputError(f"{path} has no mesh of solids: give the .frd file of a ccx run")
    result = _of_step(results, step, path)
    with _as_written("STRESS", path):
        names = [line.split()[1] for line in result.lines if line.startswith(" -5")]
        stress = _node_rows([line for line in result.lines if line.startswith(" -1")], 6)
    order = component_order(names[:6], f"{path}: the block STRESS")
    data = _mapped(points, cells, stress, order, path)
    chosen = f"of {path.name} the stress of {result} is taken" if len(results) > 1 else ""
    return replace(data, chosen=chosen, usual=("MPa", "its nodes are in mm"))


@contextmanager
def _as_written(block: str, path: Path) -> Iterator[None]:
    """Turn what goes wrong with the columns of a block into one line."""
    try:
        yield
    except (ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: the block {block} is not as CalculiX writes it in ASCII ({error}): write "
            "the file with ccx and its default output"
        ) from None


def _of_step(results: list[_Result], step: int | None, path: Path) -> _Result:
    """Last result of a step that is no mode; of the only one where no step is given."""
    listed = list(dict.fromkeys(map(str, results)))
    held = ", ".join(listed[:_LISTED]) + (", ..." if len(listed) > _LISTED else "")
    last = {result.step: result for result in results if not result.is_mode}
    if not results:
        raise InputError(f"{path} has no stress: ask ccx for it with *EL FILE and S")
    if not last:
        raise InputError(
            f"{path} has the stress of modes only, which has no size: {held}: give results of loads"
        )
    if step is None and len(last) > 1:
        raise InputError(
            f"{path} has the stress of several steps: {held}: choose a step with --stress-step"
        )
    if step is not None and step not in last:
        raise InputError(
            f"{path} has no stress of loads in step {step}; it has that of {held}: choose another "
            "step with --stress-step"
        )
    return last[next(iter(last)) if step is None else step]


def _result_blocks(lines: list[str], path: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    """Nodes (2C), elements (3C), and results by their name, with the lines before and in them."""
    name = ""
    heading: list[str] = []
    body: list[str] = []
    for line in lines:
        key = line.strip()
        if key.startswith(("2C", "3C")):
            name, body = key[:2], []
        elif line.startswith(" -4"):
            name, body = key.split()[1] if len(key.split()) > 1 else "", []
        elif line.startswith(" -3") and name:
            yield name, heading, body
            name, heading = "", []
        elif name:
            body.append(line)
        else:
            heading.append(line)
    if name:
        raise InputError(f"{path} is cut off in its block {name}: copy it again, or run ccx again")


def _node_rows(lines: list[str], count: int) -> dict[int, list[float]]:
    """First `count` values of each node: columns of twelve after the number of the node."""
    rows = {}
    for line in lines:
        rows[int(line[3:13])] = values = [float(line[k : k + 12]) for k in _STARTS[:count]]
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{shown(line.strip())} is not finite")
    return rows


def _solids(body: list[str], path: Path) -> list[list[int]]:
    """Corner nodes of each element."""
    cells: list[list[int]] = []
    wanted: list[tuple[int, int, int]] = []
    for line in body:
        if line.startswith(" -1"):
            kind = int(line[13:18])
            if kind not in _SOLIDS:
                raise InputError(
                    f"{path} has elements of type {kind}; expected solids only: types "
                    f"{', '.join(map(str, _SOLIDS))}"
                )
            wanted.append((int(line[3:13]), *_SOLIDS[kind]))
            cells.append([])
        elif line.startswith(" -2"):
            cells[-1] += [int(line[k : k + 10]) for k in range(3, len(line.rstrip()), 10)]
    for nodes, (number, _, count) in zip(cells, wanted, strict=True):
        if len(nodes) != count:
            raise ValueError(f"element {number} has {len(nodes)} nodes in place of {count}")
    return [nodes[:corners] for nodes, (_, corners, _) in zip(cells, wanted, strict=True)]


def _mapped(
    points: dict[int, list[float]],
    cells: list[list[int]],
    stress: dict[int, list[float]],
    order: list[int],
    path: Path,
) -> StressData:
    """Stress with the nodes numbered from 0 in the order of the file."""
    missing = sorted(set(points) - set(stress))
    if missing:
        raise InputError(
            f"{path}: {len(missing)} nodes have no stress, the first is {missing[0]}: write the "
            "stress of all elements"
        )
    place = {number: k for k, number in enumerate(points)}
    unknown = {node for nodes in cells for node in nodes} - set(place)
    if unknown:
        raise InputError(
            f"{path}: an element names node {min(unknown)}, which the block 2C does not have: copy "
            "the file again, or run ccx again"
        )
    rows = [[place[node] for node in nodes] for nodes in cells]
    counts = sorted({len(nodes) for nodes in rows})
    return StressData(
        np.array(list(points.values())),
        tuple(np.array([nodes for nodes in rows if len(nodes) == count]) for count in counts),
        np.array([stress[number] for number in points])[:, order],
        None,
        nodes=np.array(list(points)),
    )


# From a file to the mesh of a part.


_MPA = {"pa": 1e-6, "kpa": 1e-3, "mpa": 1.0, "n/mm^2": 1.0, "n/mm2": 1.0, "gpa": 1e3}
_SAME = 1e-5
"""Distance over the size of the part within which nodes are the same: files have six digits."""


# Stress of any program, put onto a mesh.


def read_stress(
    path: str | os.PathLike[str],
    mesh: TetMesh,
    unit: str | None = None,
    array: str | None = None,
    held_or_loaded: tuple[str, ...] = (),
    step: int | None = None,
    components: str | None = None,
) -> GivenStress:
    """Read stress from a file and map it to a mesh.

    Parameters
    ----------
    path : path
        ``.vtu``, legacy ``.vtk``, ``.xdmf``, ``.frd`` of CalculiX, or ``.csv`` by element or node
        (`ccfem.fem.stress_files.stress_file`).
    mesh : TetMesh
        Of the part. The file must have stress for each of its corners or cells: nodes are found by
        their place, cells by their corners, and in a table both by their number.
    unit : str, optional
        Pa, kPa, MPa, N/mm^2 or GPa; needed where the file does not say. A ``.frd`` never does: its
        stress is taken for MPa, since its nodes have to lie where those of the part do, in mm.
    array : str, optional
        Name of the stress in a ``.vtu``, ``.vtk`` or ``.xdmf`` file; by default the only one that
        is called as stress is (`STRESS_NAMES`), or the six arrays of its components.
    held_or_loaded : tuple of str
        As in `GivenStress`.
    step : int, optional
        Step of a ``.frd`` file, whose last increment is read, or of an ``.xdmf`` series, from 1;
        needed where there are several. Modes are no such step: their stress has no size.
    components : str, optional
        Order of six components that such a file does not name, as
        ``xx,yy,zz,xy,yz,xz``.

    Returns
    -------
    GivenStress
        What the file lacks is made of what it has: the stress of a cell is the mean of its
        corners, that of a node the mean of the cells round it, weighted by their volumes.

    Raises
    ------
    InputError
        For another format, a missing unit or component, an array or a step that the file lacks,
        stress on another mesh, and stress that is not finite or larger than in any solid.
    """
    path = existing_file(path, "stress file")
    suffix = path.suffix.lower()
    grids, steps = (".vtu", ".vtk", ".xdmf"), (".frd", ".xdmf")
    for option, value, only in (
        ("array", array, grids),
        ("step", step, steps),
        ("components", components, grids),
    ):
        if value is not None and suffix not in only:
            raise InputError(
                f"only {', '.join(only)} files have the {option} {shown(str(value))} of a "
                f"stress to choose; got {path}: leave --stress-{option} out"
            )
    if suffix in grids:
        data = grid_stress(path, array, components, step)
    elif suffix == ".frd":
        data = frd_stress(path, step)
    elif suffix == ".csv":
        data = table_stress(path)
    else:
        raise InputError(
            f"stress is read from .vtu, .vtk, .xdmf, .frd or .csv; got {path}: convert it"
        )
    assumed = [data.chosen] if data.chosen else []
    if unit is None and not data.unit and data.usual[0]:
        unit, reason = data.usual
        assumed.append(f"the stress of {path.name} is taken for {unit}, as {reason}")
    unit = _unit(path, data.unit, unit)
    factor = _MPA[unit.lower()]
    _check_values(path, data, unit)
    nodal, cell = _on_mesh(data, mesh, path)
    return GivenStress(
        mesh,
        factor * from_voigt(cell),
        factor * from_voigt(nodal),
        held_or_loaded,
        assumed="; ".join(assumed),
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
        named = np.concatenate([block.reshape(-1) for block in data.corners])
        wrong = (named < 0) | (named >= len(data.points))
        if wrong.any():
            raise InputError(
                f"{path}: a cell names point {named[wrong][0]}, and there are 0 to "
                f"{len(data.points) - 1}: write the file again"
            )
        node = _nodes(data.points, mesh, corners, path)
        if data.nodal is not None:
            nodal = np.where(node[:, None] >= 0, data.nodal[node], np.nan)
        at = _cells(data.corners, node, len(data.points), mesh)
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


_WORDS = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron"}
"""Cells by their number of corners."""


def _cells(blocks: tuple[IntArray, ...], node: IntArray, count: int, mesh: TetMesh) -> IntArray:
    """Row of the file (m,) that each cell of the mesh lies in; -1 for none.

    Cells of the file are split as those of the part were: by the numbers of the part's nodes.
    """
    of_part = np.full(count, -1)
    corners = np.unique(mesh.corners)
    of_part[node[corners]] = corners
    known, rows, before = [], [], 0
    for nodes in (of_part[block] for block in blocks):
        present = np.flatnonzero((nodes >= 0).all(axis=1))
        known.append((_WORDS[nodes.shape[1]], nodes[present]))
        rows.append(before + present)
        before += len(nodes)
    if not sum(map(len, rows)):
        return np.full(len(mesh.cells), -1)
    split = tetrahedra(mesh.points, known, "")
    at = positions(mesh.corners, split.cells)
    return np.where(at >= 0, np.concatenate(rows)[split.parent[at]], -1)


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


# Stress of each element or node from tables (CSV).


def table_stress(path: Path) -> StressData:
    """Read a table of stress with one line for each element, or for each node.

    The first line names the columns: ``element`` or ``node``, the number in the mesh, from 0 or
    from 1, every one once in any order; and the six components as ``Sxx [MPa]``, ``S12`` or ``xy``,
    all with the same unit or none. Other columns are left out. Columns are separated by commas,
    semicolons or tabs; lines that start with ``#`` are left out.
    """
    lines = {
        number: line
        for number, line in enumerate(text_of(path, "table of stress").splitlines(), 1)
        if line.strip() and not line.startswith("#")
    }
    if len(lines) < 2:
        raise InputError(f"{path}: expected a line of column names and lines of numbers; got none")
    heading = next(iter(lines.values()))
    delimiter = max(";\t,", key=heading.count)
    try:
        titles, *rows = (next(csv.reader([line], delimiter=delimiter)) for line in lines.values())
    except csv.Error as error:
        raise InputError(f"{path} is not a table of comma-separated values: {error}") from None
    names, units = zip(*(_name_and_unit(cell) for cell in titles), strict=True)
    kinds = [name.lower() for name in names if name.lower() in ("element", "node")]
    if len(kinds) != 1:
        raise InputError(f"{path}: expected one column named element or node; got {titles}")
    stressed = [k for k, name in enumerate(names) if component_of(name) >= 0]
    order = component_order([names[k] for k in stressed], f"{path}: the columns")
    given = sorted({units[k] for k in stressed})
    if len(given) > 1:
        raise InputError(f"{path}: the components have units {', '.join(given)}: give them one")
    at = [name.lower() for name in names].index(kinds[0])
    values, numbers = np.empty((len(rows), 6)), np.empty(len(rows), dtype=np.int64)
    for k, (number, row) in enumerate(zip(list(lines)[1:], rows, strict=True)):
        try:
            values[k] = [float(row[stressed[column]]) for column in order]
            numbers[k] = int(row[at])
        except (ValueError, IndexError, OverflowError):
            raise InputError(
                f"{path}, line {number}: expected a whole number and six numbers; got "
                f"{shown(lines[number])}: correct or delete it"
            ) from None
    first = int(numbers.min())
    if first not in (0, 1) or not np.array_equal(np.sort(numbers), first + np.arange(len(numbers))):
        raise InputError(
            f"{path}: expected every {kinds[0]} from 0 or from 1 on, each once; got "
            f"{len(numbers)} lines from {first} to {numbers.max()}: number them as the mesh does"
        )
    values, numbers = values[np.argsort(numbers, kind="stable")], np.sort(numbers)
    if kinds[0] == "node":
        return StressData(None, None, values, None, given[0], nodes=numbers)
    return StressData(None, None, None, values, given[0], cells=numbers)


def _name_and_unit(cell: str) -> tuple[str, str]:
    """Name of a column, and the unit in brackets behind it."""
    match = re.fullmatch(r"\s*(.*?)\s*(?:\[\s*(.*?)\s*\])?\s*", cell)
    assert match is not None
    return match[1], match[2] or ""


# Stress tensors in VTK unstructured grids, with names of their components and their unit.


UNIT = "unit of stress"
"""Field data that holds the unit."""
VTK_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
"""Components of VTK's symmetric tensors in their order."""


def vtk_tensors(tensors: FloatArray) -> FloatArray:
    """Symmetric tensors (k, 3, 3) as the six components (k, 6) of `VTK_COMPONENTS`."""
    return to_voigt(tensors)[:, [COMPONENTS.index(component) for component in VTK_COMPONENTS]]


STRESS_NAMES = ("stress", "stresses", "s", "sigma", "cauchy", "cauchy stress", "stress tensor")
"""Names of arrays, in any case, that are taken for stress if a file has just one of them."""
_FREECAD = "Stress xx component"
"""Name of a component in files of FreeCAD, whose mesh is in mm and whose stress is in Pa."""


def grid_stress(
    path: Path, array: str | None = None, components: str | None = None, step: int | None = None
) -> StressData:
    """Stress at the nodes and in the cells of a grid, as far as it has an array of that name.

    Arrays of nine components are full tensors, row by row; those of six must name their components
    (xx, yy, zz, yz, xz, xy in any order, as xx, Sxx or S11), or `components` does. Without a name
    it is the only one of `STRESS_NAMES`, or the six arrays whose names are components.
    """
    grid, usual = read_grid(path, step or 1), ("", "")
    if step is None and grid.steps > 1:
        raise InputError(
            f"{path} has {grid.steps} steps: choose one with --stress-step, as 1 for the first"
        )
    known = sorted({*grid.point, *grid.cell})
    names = [name for name in known if name.lower() in STRESS_NAMES]
    single = [name for name in known if component_of(name) >= 0]
    if array is not None or "stress" in names:
        names = [array or "stress"]
    elif not names and single:
        grid, names = _joined(grid, single, path), ["stress"]
        usual = ("Pa", "FreeCAD writes it") if _FREECAD in single else usual
    name = names[0] if len(names) == 1 else ""
    nodal, cell = (_tensors(grid, where, name, components, path) for where in ("point", "cell"))
    if nodal is None and cell is None:
        raise InputError(
            f"{path} has {'several arrays like' if names[1:] else 'no array'} "
            f"{shown(array or 'stress')}; there are: {', '.join(known) or 'none'}: name the one "
            "that holds the stress with --stress-array"
        )
    kinds = [kind for kind in grid.cells if kind in SOLIDS]
    if not kinds or set(grid.cells) - set(SOLIDS) - set(FLAT):
        raise InputError(f"{path}: expected tetrahedra, hexahedra or wedges; mesh the part so")
    corners = tuple(
        nodes[:, : CORNERS[word.rstrip("0123456789")]].astype(np.int64)
        for kind, (word, nodes) in zip(grid.cells, grid.blocks, strict=True)
        if kind in kinds
    )
    if cell is not None:
        cell = cell[np.concatenate([np.flatnonzero(grid.types == kind) for kind in kinds])]
    unit = _text(grid.field.get(UNIT, np.array([])))
    named = name not in (array, "stress")
    chosen = f"of {path.name} the array {shown(name)} is taken" if named else ""
    return StressData(grid.points, corners, nodal, cell, unit, chosen=chosen, usual=usual)


def _joined(grid: Grid, names: list[str], path: Path) -> Grid:
    """Grid with an array ``stress`` of arrays that hold a component each."""
    component_order(names, f"{path}: the arrays")
    where = "point" if names[0] in grid.point else "cell"
    data = getattr(grid, where)
    if not all(name in data and data[name].ndim == 1 for name in names):
        raise InputError(
            f"{path}: the arrays {', '.join(names)} must hold a number each, all of nodes or all "
            "of cells: write them again"
        )
    joined = {"stress": np.stack([data[name] for name in names], axis=1)}
    named = replace(grid, components={(where, "stress"): names}, point={}, cell={})
    return replace(named, point=joined) if where == "point" else replace(named, cell=joined)


def _text(values: NDArray[np.generic]) -> str:
    """Text of field data: bytes of its UTF-8, or strings, of which the first counts."""
    if values.dtype == np.uint8:
        return values.tobytes().decode(errors="replace")
    return str(values.flat[0]) if values.size else ""


def _tensors(
    grid: Grid, where: str, name: str, components: str | None, path: Path
) -> FloatArray | None:
    """Voigt components (k, 6) of an array; None where there is no such array."""
    data = grid.point if where == "point" else grid.cell
    if name not in data:
        return None
    components = components or ""
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
    names = grid.components.get((where, name), [])
    if bool(names) == bool(components):
        raise InputError(
            f"{path}: array '{name}' names its components {', '.join(names)}: leave "
            "--stress-components out"
            if names
            else f"{path}: array '{name}' has six components without names: give their order with "
            "--stress-components, as xx,yy,zz,xy,yz,xz of ParaView or xx,yy,zz,yz,xz,xy of Voigt"
        )
    names = names or components.split(",")
    return values[:, component_order(names, f"{path}: array '{name}'")]
