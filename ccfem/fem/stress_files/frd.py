"""Stress at the nodes from result files of CalculiX (``.frd``, ASCII)."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError, shown
from ccfem.fem.stress_files.stress_data import StressData, component_order

_TETRAHEDRA = {3: 4, 6: 10}
"""Nodes of the tetrahedra among the element types (CalculiX 2.20 user's manual, section 11)."""
_STARTS = (13, 25, 37, 49, 61, 73)
"""Columns where the values of a node begin, twelve wide each."""


def frd_stress(path: Path) -> StressData:
    """Stress of the last step of a file that CalculiX wrote with ``*NODE FILE`` and ``*EL FILE``.

    Raises
    ------
    InputError
        When the file has no tetrahedra or no stress, or other elements besides, or is cut off.
    """
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"expected a result file of CalculiX at {path}: {error}") from None
    points: dict[int, list[float]] = {}
    cells: list[list[int]] = []
    stress: dict[int, list[float]] = {}
    names: list[str] = []
    for block, body in _blocks(lines, path):
        try:
            if block == "2C":
                points = _rows(body, 3)
            elif block == "3C":
                cells = _cells(body, path)
            elif block == "STRESS":
                names = [line.split()[1] for line in body if line.startswith(" -5")]
                stress = _rows([line for line in body if line.startswith(" -1")], 6)
        except (ValueError, IndexError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{path}: the block {block} is not as CalculiX writes it in ASCII ({error}): write "
                "the file with ccx and its default output"
            ) from None
    if not points or not cells:
        raise InputError(f"{path} has no mesh of tetrahedra: give the .frd file of a ccx run")
    if not stress:
        raise InputError(f"{path} has no stress: ask ccx for it with *EL FILE and S")
    order = component_order(names[:6], f"{path}: the block STRESS")
    return _mapped(points, cells, stress, order, path)


def _blocks(lines: list[str], path: Path) -> Iterator[tuple[str, list[str]]]:
    """Nodes (2C), elements (3C), and results by their name, each with its lines."""
    name = ""
    body: list[str] = []
    for line in lines:
        key = line.strip()
        if key.startswith(("2C", "3C")):
            name, body = key[:2], []
        elif line.startswith(" -4"):
            name, body = key.split()[1] if len(key.split()) > 1 else "", []
        elif line.startswith(" -3") and name:
            yield name, body
            name = ""
        elif name:
            body.append(line)
    if name:
        raise InputError(f"{path} is cut off in its block {name}: copy it again, or run ccx again")


def _rows(lines: list[str], count: int) -> dict[int, list[float]]:
    """First `count` values of each node: columns of twelve after the number of the node."""
    rows = {}
    for line in lines:
        rows[int(line[3:13])] = values = [float(line[k : k + 12]) for k in _STARTS[:count]]
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{shown(line.strip())} is not finite")
    return rows


def _cells(body: list[str], path: Path) -> list[list[int]]:
    """Corner nodes of each element."""
    cells: list[list[int]] = []
    wanted: list[tuple[int, int]] = []
    for line in body:
        if line.startswith(" -1"):
            kind = int(line[13:18])
            if kind not in _TETRAHEDRA:
                raise InputError(
                    f"{path} has elements of type {kind}; expected tetrahedra (C3D4 or C3D10) only"
                )
            wanted.append((int(line[3:13]), _TETRAHEDRA[kind]))
            cells.append([])
        elif line.startswith(" -2"):
            cells[-1] += [int(line[k : k + 10]) for k in range(3, len(line.rstrip()), 10)]
    for nodes, (number, count) in zip(cells, wanted, strict=True):
        if len(nodes) != count:
            raise ValueError(f"element {number} has {len(nodes)} nodes in place of {count}")
    return [nodes[:4] for nodes in cells]


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
    return StressData(
        np.array(list(points.values())),
        np.array([[place[node] for node in nodes] for nodes in cells]),
        np.array([stress[number] for number in points])[:, order],
        None,
        nodes=np.array(list(points)),
    )
