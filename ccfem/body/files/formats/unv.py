"""I-DEAS universal meshes (``.unv``), as Salome, FreeCAD and others write them.

A file is a row of data sets between lines of -1, whose first line is their number. Here 2411 holds
nodes, 2412 elements, and those of `_GROUPS` groups of nodes and elements.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError, shown
from ccfem.base.whole import text_of
from ccfem.body.files.cells import outside, tetrahedra, triangles_of, with_groups
from ccfem.body.mesh import TetMesh

_BEAMS = (11, 21, 22, 23, 24)
"""Types of elements with a line of orientation before their nodes."""
_FACETS = {
    **{key: [0, 1, 2] for key in (41, 91)},
    **{key: [0, 2, 4] for key in (42, 92)},
    **{key: [0, 1, 2, 3] for key in (44, 94)},
    **{key: [0, 2, 4, 6] for key in (45, 95)},
}
"""Corners of triangles and quadrangles: nodes in the middle of sides lie between them."""
_SOLIDS = {
    111: ("tetra", [0, 1, 2, 3]),
    118: ("tetra10", [0, 2, 4, 9, 1, 3, 5, 6, 7, 8]),
    112: ("wedge", [*range(6)]),
    113: ("wedge15", [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8]),
    115: ("hexahedron", [*range(8)]),
    116: ("hexahedron20", [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11]),
}
"""Solids in meshio's words, and their nodes in its order."""
_NODES = {kind: len(order) for kind, (_, order) in _SOLIDS.items()}
_GROUPS = (2435, 2452, 2467, 2477)
_NODE, _ELEMENT = 7, 8
"""Kinds of members of groups."""


def read(path: Path) -> TetMesh:
    """Read a universal file; groups of facets, or of nodes, become patches."""
    numbers: list[int] = []
    points: list[list[float]] = []
    elements: dict[int, tuple[int, list[int]]] = {}
    groups: dict[str, list[tuple[int, int]]] = {}
    for number, lines in _data_sets(text_of(path, "universal file").splitlines()):
        try:
            if number == 2411:
                numbers += [int(line[:10]) for line in lines[::2]]
                points += [_floats(line) for line in lines[1::2]]
            elif number == 2412:
                elements |= dict(_elements(lines))
            elif number in _GROUPS:
                for name, members in _members(lines):
                    groups.setdefault(name, []).extend(members)
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{path}: data set {number} is not as universal files have it "
                f"({shown(str(error))}): export the mesh again"
            ) from None
    if len(points) != len(numbers) or not points:
        raise InputError(f"{path} holds no nodes (data set 2411): export the mesh as .unv again")
    row = {number: k for k, number in enumerate(numbers)}
    blocks: dict[str, list[list[int]]] = {}
    triangles: dict[int, list[list[int]]] = {}
    try:
        for number, (kind, nodes) in elements.items():
            if kind in _FACETS:
                corners = np.array([[row[nodes[k]] for k in _FACETS[kind]]])
                triangles[number] = triangles_of(corners).tolist()
            elif kind in _SOLIDS:
                name, order = _SOLIDS[kind]
                blocks.setdefault(name, []).append([row[nodes[k]] for k in order])
    except (KeyError, IndexError):
        raise InputError(
            f"{path}: element {number} names nodes that the file does not have: export it again"
        ) from None
    cells = [(name, np.array(rows)) for name, rows in blocks.items()]
    mesh = tetrahedra(np.array(points), cells, path).mesh(path)
    border, facets = outside(mesh), {}
    for name, members in groups.items():
        named = [t for what, n in members if what == _ELEMENT for t in triangles.get(n, ())]
        on = [row[n] for what, n in members if what == _NODE and n in row]
        named += border[np.isin(border, on).all(axis=1)].tolist()
        facets[name] = np.array(named, dtype=np.int64).reshape(-1, 3)
    return with_groups(mesh, facets)


def _data_sets(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the lines of each data set."""
    marks = [k for k, line in enumerate(lines) if line.strip() == "-1"]
    for start, end in zip(marks[::2], marks[1::2], strict=False):
        number = lines[start + 1].strip()
        if number.isdecimal():
            yield int(number), lines[start + 2 : end]


def _floats(line: str) -> list[float]:
    """Three numbers of 25 columns, with exponents D or E."""
    values = [float(line[k : k + 25].replace("D", "E").replace("d", "E")) for k in (0, 25, 50)]
    if not np.isfinite(values).all():
        raise ValueError(f"{line.strip()} is not finite")
    return values


def _integers(line: str) -> list[int]:
    """Whole numbers of ten columns."""
    return [int(line[k : k + 10]) for k in range(0, len(line.rstrip()), 10)]


def _elements(lines: list[str]) -> Iterator[tuple[int, tuple[int, list[int]]]]:
    """Yield the number of each element, with its type and nodes."""
    at = 0
    while at < len(lines):
        number, kind, _, _, _, count = _integers(lines[at])[:6]
        at += 2 if kind in _BEAMS else 1
        end = at + max(1, -(-count // 8))
        nodes = [node for line in lines[at:end] for node in _integers(line)]
        if len(nodes) != count or count != _NODES.get(kind, count):
            raise ValueError(f"element {number} has {len(nodes)} nodes")
        yield number, (kind, nodes)
        at = end


def _members(lines: list[str]) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Yield the name of each group, with the kinds and numbers of its members."""
    at = 0
    while at < len(lines):
        heading = _integers(lines[at])
        number, count = heading[0], heading[7]
        name, end = lines[at + 1].strip() or str(number), at + 2 + -(-count // 2)
        fields = [x for line in lines[at + 2 : end] for x in _integers(line)]
        yield name, list(zip(fields[::4], fields[1::4], strict=True))[:count]
        at = end
