"""Cutting a tetrahedral mesh at a level of a nodal field."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.round_walls import RoundWall

Group = TypeVar("Group", str, int)


@dataclass(frozen=True)
class Cut:
    """Triangles of a level surface.

    Attributes
    ----------
    points : (n, 3) array, mm
    nodes : (n, 2) int array
        Ends of the mesh edge that each point lies on (the same node twice if it lies on a node).
    weights : (n,) array in [0, 1]
        Share of the second end.
    triangles : (t, 3) int array
        Without consistent orientation.
    cell : (t,) int array
        Tetrahedron that each triangle was cut from.
    """

    points: FloatArray
    nodes: IntArray
    weights: FloatArray
    triangles: IntArray
    cell: IntArray


def cut_at_zero(mesh: TetMesh, signed: FloatArray, among: IntArray | None = None) -> Cut | None:
    """Cut a mesh where a field is zero; None where it is zero nowhere.

    Parameters
    ----------
    signed : (n,) array
        Values at the nodes, linear in between; nodes of value 0 become points of the surface.
    among : (k,) int array, optional
        Cells that may be cut, ascending; by default all.
    """
    corners = mesh.corners
    values = signed[corners if among is None else corners[among]]
    crossing = np.flatnonzero((values.min(axis=1) <= 0.0) & (values.max(axis=1) >= 0.0))
    crossing = crossing if among is None else among[crossing]
    lines, cell = _cut_cells(corners[crossing], signed, mesh.points)
    if not len(cell):
        return None
    # An edge of the mesh is one number: smaller node * n + larger node.
    keys, inverse = np.unique(lines, return_inverse=True)
    a, b = np.divmod(keys, len(mesh.points))
    fall = signed[a] - signed[b]
    weights = np.divide(signed[a], fall, out=np.zeros(len(a)), where=fall != 0.0)
    points = (1.0 - weights)[:, None] * mesh.points[a] + weights[:, None] * mesh.points[b]
    triangles, cell = _drop_repeated(inverse.reshape(-1, 3), crossing[cell])
    return Cut(points, np.stack([a, b], axis=1), weights, triangles, cell)


@njit(cache=True)
def _cut_cells(
    cells: IntArray, signed: FloatArray, points: FloatArray
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of mesh-edge keys, and the row of `cells` that each comes from."""
    n = len(points)
    where = np.empty((4, 3))
    lines = np.empty((2 * len(cells), 3), np.int64)
    source = np.empty(2 * len(cells), np.int64)
    count = 0
    key = np.empty(4, np.int64)
    for row in range(len(cells)):
        corners = 0
        below = 0
        above = 0
        for i in range(4):
            p = cells[row, i]
            if signed[p] == 0.0:
                key[corners] = p * n + p
                corners += 1
            elif signed[p] < 0.0:
                below += 1
            else:
                above += 1
        # A face in the plane belongs only to the cell above it.
        if corners == 3 and above == 0:
            continue
        if corners == 4 or corners + below * above < 3:
            continue
        on = corners
        for i in range(4):
            for j in range(i + 1, 4):
                p, q = cells[row, i], cells[row, j]
                if signed[p] * signed[q] < 0.0:
                    key[corners] = min(p, q) * n + max(p, q)
                    w = signed[p] / (signed[p] - signed[q])
                    for d in range(3):
                        where[corners, d] = (1.0 - w) * points[p, d] + w * points[q, d]
                    corners += 1
        if corners == 3:
            for i in range(3):
                lines[count, i] = key[i]
            source[count] = row
            count += 1
        elif on == 0:
            # Four crossings in the order (i, j) of a 2-2 split: 0-1-3-2 is the cyclic order. The
            # quad is split along its shorter diagonal [Chen et al. 2021, section 5].
            one, other = 0.0, 0.0
            for d in range(3):
                one += (where[0, d] - where[3, d]) ** 2
                other += (where[1, d] - where[2, d]) ** 2
            if one <= other:
                a, b, c, d = key[0], key[1], key[3], key[2]
            else:
                a, b, c, d = key[1], key[3], key[2], key[0]
            lines[count, 0], lines[count, 1], lines[count, 2] = a, b, c
            lines[count + 1, 0], lines[count + 1, 1], lines[count + 1, 2] = a, c, d
            source[count] = source[count + 1] = row
            count += 2
    return lines[:count], source[:count]


def _drop_repeated(triangles: IntArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    """Drop triangles with a repeated corner, which snapping leaves."""
    a, b, c = triangles.T
    keep = (a != b) & (b != c) & (a != c)
    return triangles[keep], cell[keep]


def chain(border: IntArray) -> tuple[IntArray, ...]:
    """Chain directed edges to closed loops; each edge is used once where loops touch."""
    leaving: dict[int, list[int]] = {}
    for start, end in border.tolist():
        leaving.setdefault(start, []).append(end)
    loops = []
    for start in sorted(leaving):
        while leaving[start]:
            loop = [start]
            following = leaving[start].pop()
            while following != start:
                loop.append(following)
                following = leaving[following].pop()
            loops.append(np.array(loop, dtype=np.int64))
    return tuple(loops)


def patch_edges(mesh: TetMesh, border: IntArray, nodes: IntArray) -> dict[str, IntArray]:
    """Border edges (k, 2) that lie on each patch of the mesh."""
    return _edges_on(mesh, mesh.patches, border, nodes)


def wall_edges(
    mesh: TetMesh, border: IntArray, nodes: IntArray
) -> tuple[tuple[RoundWall, IntArray], ...]:
    """Round walls that a section cuts, and the border edges (k, 2) that lie on each."""
    facets = {k: mesh.boundary[mesh.wall_of == k] for k in range(len(mesh.round_walls))}
    edges = _edges_on(mesh, facets, border, nodes)
    starts = {k: mesh.points[corners.min()] for k, corners in facets.items() if len(corners)}
    return tuple(
        (replace(mesh.round_walls[k], start=starts[k]), rows)
        for k, rows in edges.items()
        if len(rows)
    )


def _edges_on(
    mesh: TetMesh, groups: Mapping[Group, IntArray], border: IntArray, nodes: IntArray
) -> dict[Group, IntArray]:
    """Border edges (k, 2) that lie on the facets of each group."""
    ends = nodes[border].reshape(-1, 4)
    patches = {}
    for name, facets in groups.items():
        belongs = np.zeros(len(mesh.points), dtype=bool)
        belongs[facets] = True
        candidates = np.flatnonzero(belongs[ends].all(axis=1))
        known = {tuple(f) for f in np.sort(facets, axis=1).tolist()}
        kept = [k for k in candidates.tolist() if _on_facet(ends[k].tolist(), known)]
        patches[name] = border[kept].reshape(-1, 2)
    return patches


def _on_facet(ends: list[int], facets: set[tuple[int, ...]]) -> bool:
    """Whether the mesh nodes that carry a border edge span one of the facets."""
    nodes = tuple(sorted(set(ends)))
    if len(nodes) == 3:
        return nodes in facets
    return len(nodes) == 2 and any(set(nodes) <= set(f) for f in facets)
