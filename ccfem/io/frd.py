"""Stress at the nodes from result files of CalculiX (``.frd``, ASCII)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.errors import InputError
from ccfem.io.stress_data import StressData, component_order

__all__ = ["frd_stress"]

_TETRAHEDRA = {3: 4, 6: 10}
"""Nodes of the tetrahedra among the element types (CalculiX 2.20 user's manual, section 11)."""


def frd_stress(path: Path) -> StressData:
    """Stress of the last step of a file that CalculiX wrote with ``*NODE FILE`` and ``*EL FILE``.

    Raises
    ------
    InputError
        When the file has no tetrahedra or no stress, or other elements besides.
    """
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"expected a result file of CalculiX at {path}: {error}") from None
    points: dict[int, tuple[float, ...]] = {}
    cells: list[list[int]] = []
    stress: dict[int, list[float]] = {}
    names: list[str] = []
    for block, body in _blocks(lines):
        try:
            if block == "2C":
                points = {int(line[3:13]): _numbers(line)[:3] for line in body}
            elif block == "3C":
                cells = _cells(body, path)
            elif block == "STRESS":
                names = [line.split()[1] for line in body if line.startswith(" -5")]
                values = [line for line in body if line.startswith(" -1")]
                stress = {int(line[3:13]): list(_numbers(line)) for line in values}
        except (ValueError, IndexError):
            raise InputError(
                f"{path}: the block {block} is not as CalculiX writes it in ASCII: write the file "
                "with ccx and its default output"
            ) from None
    if not points or not cells:
        raise InputError(f"{path} has no mesh of tetrahedra: give the .frd file of a ccx run")
    if not stress:
        raise InputError(f"{path} has no stress: ask ccx for it with *EL FILE and S")
    order = component_order(names[:6], f"{path}: the block STRESS")
    return _mapped(points, cells, stress, order, path)


def _blocks(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Nodes (2C), elements (3C), and results by their name, each with its lines."""
    name = ""
    body: list[str] = []
    for line in lines:
        key = line.strip()
        if key.startswith(("2C", "3C")):
            name, body = key[:2], []
        elif line.startswith(" -4"):
            name, body = line.split()[1], []
        elif line.startswith(" -3") and name:
            yield name, body
            name = ""
        elif name:
            body.append(line)


def _numbers(line: str) -> tuple[float, ...]:
    """Values of twelve columns each, after the number of the node."""
    return tuple(float(line[k : k + 12]) for k in range(13, len(line.rstrip()), 12))


def _cells(body: list[str], path: Path) -> list[list[int]]:
    """Corner nodes of each element."""
    cells: list[list[int]] = []
    wanted = 0
    for line in body:
        if line.startswith(" -1"):
            kind = int(line.split()[2])
            if kind not in _TETRAHEDRA:
                raise InputError(
                    f"{path} has elements of type {kind}; expected tetrahedra (C3D4 or C3D10) only"
                )
            wanted = _TETRAHEDRA[kind]
            cells.append([])
        elif line.startswith(" -2"):
            cells[-1] += [int(line[k : k + 10]) for k in range(3, len(line.rstrip()), 10)]
            if len(cells[-1]) > wanted:
                raise ValueError(line)
    return [nodes[:4] for nodes in cells]


def _mapped(
    points: dict[int, tuple[float, ...]],
    cells: list[list[int]],
    stress: dict[int, list[float]],
    order: list[int],
    path: Path,
) -> StressData:
    """Stress with the nodes numbered from 0 in the order of the file."""
    numbers = np.array(list(points), dtype=np.int64)
    place: IntArray = np.full(int(numbers.max()) + 1, -1, dtype=np.int64)
    place[numbers] = np.arange(len(numbers))
    missing = sorted(set(points) - set(stress))
    if missing:
        raise InputError(
            f"{path}: {len(missing)} nodes have no stress, the first is {missing[0]}: write the "
            "stress of all elements"
        )
    nodal: FloatArray = np.array([stress[number] for number in points])[:, order]
    return StressData(np.array(list(points.values())), place[np.array(cells)], nodal, None)
