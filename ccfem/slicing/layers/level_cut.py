"""Cutting a tetrahedral mesh at a level of a nodal field."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

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
    nodes = np.stack(np.divmod(keys, len(mesh.points)), axis=1)
    points, weights = on_edges(nodes, signed, mesh.points)
    triangles, cell = _drop_repeated(inverse.reshape(-1, 3), crossing[cell])
    return Cut(points, nodes, weights, triangles, cell)


def on_edges(
    nodes: IntArray, signed: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Points (k, 3) where edges between nodes (k, 2) are cut, and their weights (`Cut`)."""
    a, b = nodes.T
    fall = signed[a] - signed[b]
    weights = np.divide(signed[a], fall, out=np.zeros(len(a)), where=fall != 0.0)
    return (1.0 - weights)[:, None] * points[a] + weights[:, None] * points[b], weights


_SIDES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
"""Corners of a cell at the ends of its sides."""


def _cut_cells(
    cells: IntArray, signed: FloatArray, points: FloatArray
) -> tuple[IntArray, IntArray]:
    """Triangles (t, 3) of mesh-edge keys, and the row of `cells` that each comes from."""
    value = signed[cells]
    on, above = (value == 0.0).sum(axis=1), (value > 0.0).sum(axis=1)
    # A face in the plane belongs only to the cell above it.
    cut = (on + (4 - on - above) * above >= 3) & (on < 4) & ((on < 3) | (above > 0))
    row = np.flatnonzero(cut)
    cells, value = cells[row], value[row]
    # Corners of the section: three, or four where two nodes are above and two below.
    p, q = np.moveaxis(cells[:, _SIDES], 2, 0)
    low, high = np.moveaxis(value[:, _SIDES], 2, 0)
    number = len(points)
    keys = np.hstack([cells * number + cells, np.minimum(p, q) * number + np.maximum(p, q)])
    met = np.hstack([value == 0.0, low * high < 0.0])
    keys = np.take_along_axis(keys, np.argsort(~met, axis=1, kind="stable")[:, :4], axis=1)
    four = np.flatnonzero(met.sum(axis=1) == 4)
    # Crossings in the order of the sides of a 2-2 split: 0-1-3-2 is the cyclic order. The quad is
    # split along its shorter diagonal [Chen et al. 2021, section 5].
    p, q, low, high = (one[four][low[four] * high[four] < 0.0] for one in (p, q, low, high))
    share = (low / (low - high))[:, None]
    places = ((1.0 - share) * points[p] + share * points[q]).reshape(-1, 4, 3)
    one, other = (((places[:, a] - places[:, b]) ** 2).sum(axis=1) for a, b in ((0, 3), (1, 2)))
    around = np.where((one <= other)[:, None], [0, 1, 3, 2], [1, 3, 2, 0])
    around = np.take_along_axis(keys[four], around, axis=1)
    triangles = np.stack([keys[:, :3], keys[:, :3]], axis=1)
    triangles[four] = around[:, [[0, 1, 2], [0, 2, 3]]]
    twice = np.zeros((len(row), 2), dtype=bool)
    twice[:, 0] = twice[four, 1] = True
    return triangles[twice], np.repeat(row, twice.sum(axis=1))


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
