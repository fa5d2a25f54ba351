"""What every reader does with cells and groups of facets: tetrahedra of one order, and patches.

Hexahedra, wedges and pyramids are split into tetrahedra. Every quadrangle is cut from its corner of
the smallest number, so that both cells at it cut it alike, and every cell is filled by cones from
its corner of the smallest number over the faces that do not have it (Dompierre et al., How to
subdivide pyramids, prisms and hexahedra into tetrahedra, 1999).
"""

import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.curved_cells import EDGES
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import are_among, facet_keys, positions, signed_volumes, unique_edges

CELL_FACES = {
    4: ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    5: ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    6: ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    8: ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
"""Corners of the faces of cells by their number of corners, in the order of Abaqus, inward."""
_BASE = ((0, 1), (1, 2), (2, 3), (3, 0))
_SIDES = {
    4: tuple(map(tuple, EDGES.tolist())),
    5: (*_BASE, (0, 4), (1, 4), (2, 4), (3, 4)),
    6: ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    8: (*_BASE, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
}
"""Corners of the sides whose middles follow the corners of quadratic cells (VTK order)."""
_THROUGH = ((0, 6), (1, 7), (2, 4), (3, 5))
"""Diagonals of a hexahedron."""
_SOLIDS = {
    "tetra": (4, 4),
    "tetra10": (4, 10),
    "pyramid": (5, 5),
    "pyramid13": (5, 13),
    "pyramid14": (5, 14),
    "wedge": (6, 6),
    "wedge15": (6, 15),
    "wedge18": (6, 18),
    "hexahedron": (8, 8),
    "hexahedron20": (8, 20),
    "hexahedron27": (8, 27),
}
"""Corners and nodes of the cells that are taken, by meshio's words."""
CORNERS = {"triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
"""Corners of cells by the beginning of their words."""
_OTHER_SOLIDS = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron")
"""Beginnings of the words for cells with a volume."""
_PLURALS = {5: "pyramids", 6: "wedges", 8: "hexahedra"}


@dataclass(frozen=True)
class SplitCells:
    """Tetrahedra of a file, of one order.

    Attributes
    ----------
    points : (n + k, 3) array
        Points of the file, then the middles of diagonals of quadratic cells that were split.
    cells : (m, 4) or (m, 10) int array
    parent : (m,) int array
        Cell with volume that each is of, counted from 0 through all blocks of the file.
    ends : (k, 2) int array
        Corners between which the added points lie.
    said : str
        What was split; empty where nothing was.
    """

    points: FloatArray
    cells: IntArray
    parent: IntArray
    ends: IntArray
    said: str

    def mesh(self, path: str | PathLike[str]) -> TetMesh:
        """Mesh without patches; a `UserWarning` says what was split."""
        if self.said:
            warnings.warn(f"{path}: {self.said}", UserWarning, stacklevel=3)
        return TetMesh(self.points, self.cells)


def tetrahedra(
    points: FloatArray, blocks: Iterable[tuple[str, IntArray]], path: str | PathLike[str]
) -> SplitCells:
    """Join the tetrahedra of a file, those that other cells are split into among them.

    Parameters
    ----------
    points : (n, 3) array
    blocks : iterable of (type, nodes)
        Type in meshio's words, nodes (m, k) in VTK order.
    path : path
        For the messages.

    Raises
    ------
    InputError
        When there are no cells with a volume, when linear and quadratic ones are mixed, when cells
        name nodes that there are not, or when some of the volume is meshed with cells that are not
        taken (dropping them would leave holes).
    """
    blocks = [(kind, np.asarray(nodes, dtype=np.int64)) for kind, nodes in blocks if len(nodes)]
    solids = [(kind, nodes) for kind, nodes in blocks if kind.startswith(_OTHER_SOLIDS)]
    counts: Counter[str] = Counter()
    for kind, nodes in blocks:
        counts[kind] += len(nodes)
    held = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) or "no cells"
    if not solids:
        raise InputError(
            f"{path} holds no tetrahedra; it has {held}: mesh the volume with tetrahedra (in Gmsh "
            "make it a Physical Volume, too), or give a closed surface as STL, OBJ or PLY"
        )
    unknown = sorted({kind for kind, _ in solids} - set(_SOLIDS))
    if unknown:
        raise InputError(
            f"{path} has cells of type {', '.join(unknown)}, which are not split into tetrahedra: "
            "mesh the volume with tetrahedra, hexahedra or wedges"
        )
    quadratic = {_SOLIDS[kind][1] > _SOLIDS[kind][0] for kind, _ in solids}
    if len(quadratic) > 1:
        raise InputError(
            f"{path} must be meshed with linear or with quadratic cells throughout; it has "
            f"{held}: mesh it again with one kind"
        )
    for kind, nodes in solids:
        if nodes.shape[1] != _SOLIDS[kind][1]:
            raise InputError(
                f"{path}: a {kind} has {_SOLIDS[kind][1]} nodes, and the file gives "
                f"{nodes.shape[1]}: write it again"
            )
    if any(nodes.min() < 0 or nodes.max() >= len(points) for _, nodes in solids):
        raise InputError(
            f"{path}: cells must name nodes 0 to {len(points) - 1}: check the numbering of the file"
        )
    return _split(points, solids, quadratic == {True})


def _split(
    points: FloatArray, solids: Sequence[tuple[str, IntArray]], quadratic: bool
) -> SplitCells:
    """Tetrahedra of solid cells that are known, of one order."""
    corners, parent, before, counts = [], [], 0, Counter[str]()
    known, bulges = [], []
    for kind, nodes in solids:
        of_cell, row = nodes[:, : _SOLIDS[kind][0]], np.arange(len(nodes))
        if quadratic:
            known.append(_known_middles(nodes, of_cell))
        if of_cell.shape[1] > 4:
            counts[_PLURALS[of_cell.shape[1]]] += len(nodes)
            bulges += [_bulges(points, nodes, of_cell)] if quadratic else []
            of_cell, row = _cones(points, of_cell)
        corners.append(of_cell)
        parent.append(before + row)
        before += len(nodes)
    cells, ends = np.concatenate(corners), np.zeros((0, 2), dtype=np.int64)
    split = len(cells) - before + sum(counts.values())
    remark = " and ".join(f"{count:,} {name}" for name, count in sorted(counts.items()))
    remark += f" are split into {split:,} tetrahedra"
    if not quadratic:
        remark += (
            ', which are stiffer while they are linear: order = "auto" makes them quadratic where '
            "that matters, order = 2 always"
        )
    if not counts:
        cells = np.concatenate([nodes for _, nodes in solids])
    elif quadratic:
        points, cells, ends = _with_middles(points, cells, known, bulges)
    return SplitCells(points, cells, np.concatenate(parent), ends, remark if counts else "")


def triangles_of(faces: IntArray) -> IntArray:
    """Triangles (k, 3) of faces (f, 3 or 4) by their corners, those of a quadrangle in a row.

    A quadrangle is cut from its corner of the smallest number; what has no area is left out.
    """
    triangles = _cut(faces).reshape(-1, 3)
    return triangles[_differ(triangles)]


def _cut(faces: IntArray) -> IntArray:
    """Triangles (f, 1 or 2, 3) of faces (f, 3 or 4)."""
    if faces.shape[1] == 3:
        return faces[:, None]
    turned = (faces.argmin(axis=1)[:, None] + np.arange(4)) % 4
    return np.take_along_axis(faces, turned, axis=1)[:, [[0, 1, 2], [0, 2, 3]]]


def _differ(triangles: IntArray) -> BoolArray:
    """Whether the corners of triangles (k, 3) differ."""
    a, b, c = triangles.T
    return np.asarray((a != b) & (b != c) & (a != c))


def _cones(points: FloatArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Tetrahedra (k, 4) of cells (m, c), turned to positive volume, and the row of each."""
    apex, cells, rows = corners.min(axis=1), [], []
    for face in CELL_FACES[corners.shape[1]]:
        triangles = _cut(corners[:, face])
        row = np.repeat(np.arange(len(corners)), triangles.shape[1])
        triangles = triangles.reshape(-1, 3)
        kept = _differ(triangles) & (triangles != apex[row, None]).all(axis=1)
        cells.append(np.column_stack([triangles[kept], apex[row[kept]]]))
        rows.append(row[kept])
    order = np.argsort(np.concatenate(rows), kind="stable")
    tets, row = np.concatenate(cells)[order], np.concatenate(rows)[order]
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused later
        inverted = signed_volumes(points, tets) < 0.0
    tets[inverted] = tets[inverted][:, [0, 2, 1, 3]]
    return tets, row


# Middles of the sides of quadratic cells that are split.


def _known_middles(nodes: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """Find the ends (k, 2) of the sides of cells, and the nodes (k,) in their middle."""
    count = corners.shape[1]
    sides = np.array(_SIDES[count])
    return corners[:, sides].reshape(-1, 2), nodes[:, count : count + len(sides)].reshape(-1)


def _bulges(points: FloatArray, nodes: IntArray, corners: IntArray) -> tuple[IntArray, FloatArray]:
    """Find the ends (k, 2) of diagonals, and how far (k, 3) their middles lie from the chords.

    By the middles of the sides, as the shape functions of 8 and 20 nodes have it: half the sum of
    those round a face, and a quarter of that of all sides of a hexahedron. So straight cells make
    straight tetrahedra; centres of faces and cells that a file gives are not needed.
    """
    count, place = corners.shape[1], points[corners]
    sides = {frozenset(side): k for k, side in enumerate(_SIDES[count])}
    chords = np.stack([place[:, side].mean(axis=1) for side in _SIDES[count]], axis=1)
    off = points[nodes[:, count : count + len(sides)]] - chords
    ends, bulges = [], []
    for face in (face for face in CELL_FACES[count] if len(face) == 4):
        round_it = [sides[frozenset((face[k - 1], face[k]))] for k in range(4)]
        ends += [corners[:, face[0::2]], corners[:, face[1::2]]]
        bulges += 2 * [0.5 * off[:, round_it].sum(axis=1)]
    if count == 8:
        ends += [corners[:, diagonal] for diagonal in _THROUGH]
        bulges += 4 * [0.25 * off.sum(axis=1)]
    return np.concatenate(ends), np.concatenate(bulges)


def _with_middles(
    points: FloatArray,
    corners: IntArray,
    known: Sequence[tuple[IntArray, IntArray]],
    bulges: Sequence[tuple[IntArray, FloatArray]],
) -> tuple[FloatArray, IntArray, IntArray]:
    """Points with the middles of diagonals, quadratic cells, and the ends of these diagonals."""
    ends, side = unique_edges(corners[:, EDGES].reshape(-1, 2))
    at = positions(ends, np.concatenate([pairs for pairs, _ in known]))
    node = np.concatenate([nodes for _, nodes in known])[at]
    added = np.flatnonzero(at < 0)
    node[added] = len(points) + np.arange(len(added))
    between = positions(ends[added], np.concatenate([pairs for pairs, _ in bulges]))
    bulge = np.concatenate([off for _, off in bulges])[between]
    points = np.concatenate([points, points[ends[added]].mean(axis=1) + bulge])
    return points, np.column_stack([corners, node[side].reshape(-1, 6)]), ends[added]


# Facets of the outside.


def outside(mesh: TetMesh) -> IntArray:
    """Boundary facets (b, 3), outward, of a mesh in which cells may be given twice."""
    _, first = np.unique(facet_keys(mesh.corners)[0], return_index=True)
    if len(first) == len(mesh.cells):
        return mesh.boundary
    return TetMesh(mesh.points, mesh.cells[np.sort(first)]).boundary


def with_groups(mesh: TetMesh, groups: Mapping[str, IntArray]) -> TetMesh:
    """Return the mesh with groups of facets (k, 3) as patches: those on the boundary, or none."""
    border = outside(mesh)
    return mesh.with_patches(
        {name: border[are_among(border, facets)] for name, facets in groups.items()}
    )


def is_axis(values: Any) -> bool:
    """Whether an array of a file is a direction in space."""
    return (
        values.dtype.kind in "fiu"
        and values.size == 3
        and bool(np.isfinite(values).all() and np.any(values))
    )
