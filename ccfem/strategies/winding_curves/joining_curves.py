"""Curves that join the holes of a layer, well inside it, along which the paper cuts the layer.

Fang et al. 2024, section 2.4, steps 2 to 6, join the middles of the holes' Voronoi cells by
shortest paths along edges. Here lengths near the outer border cost more, three holes meet where the
way to all of them is shortest, and curves cross triangles instead of following edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, seen_only
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.strategies.winding_curves.triangle_mesh import EdgePath, TriangleMesh, insert

_PER_EDGE = 3
"""Number of points on an edge at which a curve may cross it."""
_KEEP = 0.12
"""Least distance of a crossing from the ends of its edge, in edges, to avoid thin triangles."""
_DEAR = 1000.0
"""Factor on the cost of an edge that touches the outer border."""
_SAMPLE = 0.5
"""Distance, mm, between samples of the border to which distances are measured."""


@dataclass(frozen=True)
class _Cost:
    """Cost of a way per mm: ``1 + repulsion / d^2`` at the distance d from the outer border."""

    tree: cKDTree | None
    repulsion: float

    def __call__(self, points: FloatArray) -> FloatArray:
        if self.tree is None:
            return np.ones(len(points))
        away, _ = self.tree.query(points)
        return 1.0 + self.repulsion / np.maximum(away, 1e-3) ** 2


def join(
    mesh: TriangleMesh, loops: Sequence[IntArray], outer: Sequence[IntArray], repulsion: float
) -> tuple[TriangleMesh, list[IntArray]]:
    """Join the holes of a piece of a layer by a tree of curves.

    Parameters
    ----------
    mesh : TriangleMesh
        Connected.
    loops : sequence of int arrays
        Points of the border of each hole.
    outer : sequence of int arrays
        All other loops of its border; curves keep away from them.
    repulsion : float, mm^2
        Strength of that.

    Returns
    -------
    mesh : TriangleMesh
        With the curves as edges; the given points keep their numbers.
    curves : list of int arrays
        Points of each curve, from end to end.

    Raises
    ------
    InputError
        When a hole cannot be reached within the piece.
    """
    if len(loops) < 2:
        return mesh, []
    closed = np.zeros(len(mesh.points), dtype=bool)
    for loop in outer:
        closed[loop] = True
    cost = _Cost(border_tree(mesh.points, outer), repulsion)
    graph = _edge_graph(mesh, cost, closed)
    far, _ = _ways(graph, loops)
    # Three holes meet at the point of least total distance; others join the hole nearest to all.
    if len(loops) == 3:
        tree = np.array([int(np.argmin(np.where(closed, np.inf, far.sum(axis=0))))])
        left = list(range(3))
    else:
        between = np.array([[far[i, loop].min() for loop in loops] for i in range(len(loops))])
        start = int(np.argmin(between.sum(axis=1)))
        tree, left = loops[start], [k for k in range(len(loops)) if k != start]
    curves: list[IntArray] = []
    while left:
        distance, before = _ways(graph, [tree])
        near = [float(distance[0, loops[k]].min()) for k in left]
        k = left.pop(int(np.argmin(near)))
        if not np.isfinite(min(near)):
            raise InputError(
                "a hole of the layer cannot be joined with the others: name fewer joints"
            )
        if min(near) == 0.0:
            continue
        end = int(loops[k][np.argmin(distance[0, loops[k]])])
        way = _way_back(before[0], end)
        path = _refined(mesh, way, tree, loops[k], cost)
        mesh, curve = insert(mesh, path)
        closed = np.concatenate([closed, np.zeros(len(mesh.points) - len(closed), dtype=bool)])
        curves.append(curve)
        tree = np.unique(np.concatenate([tree, curve, loops[k]]))
        if left:
            graph = _edge_graph(mesh, cost, closed)
    return mesh, curves


def border_tree(points: FloatArray, outer: Sequence[IntArray]) -> cKDTree | None:
    """Tree of samples of the outer border; None if there is no such border."""
    samples = []
    for loop in outer:
        a, b = points[loop], points[np.roll(loop, -1)]
        parts = np.maximum(1, np.ceil(np.linalg.norm(b - a, axis=1) / _SAMPLE)).astype(int)
        row = np.repeat(np.arange(len(loop)), parts)
        share = (np.arange(len(row)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[row]
        samples.append(a[row] + share[:, None] * (b - a)[row])
    return cKDTree(np.concatenate(samples)) if samples else None


def _edge_graph(mesh: TriangleMesh, cost: _Cost, closed: BoolArray) -> sp.csr_array:
    """Ways along edges; costly ones, for necks without others, touch the outer border."""
    t, n = mesh.triangles, len(mesh.points)
    edges = np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), axis=1)
    edges = np.stack(np.divmod(np.unique(edges[:, 0] * n + edges[:, 1]), n), axis=1)
    a, b = mesh.points[edges[:, 0]], mesh.points[edges[:, 1]]
    weight = np.linalg.norm(b - a, axis=1) * cost(0.5 * (a + b))
    weight[closed[edges].any(axis=1)] *= _DEAR
    return sp.coo_array((weight, (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()


def _ways(graph: sp.csr_array, sources: Sequence[IntArray]) -> tuple[FloatArray, IntArray]:
    """Distance of every point from each set of sources, and the point before it on the way."""
    ways = [
        dijkstra(graph, directed=False, indices=s, min_only=True, return_predecessors=True)
        for s in sources
    ]
    return np.stack([d for d, _, _ in ways]), np.stack([p for _, p, _ in ways]).astype(np.int64)


def _way_back(before: IntArray, end: int) -> list[int]:
    """Points of the way to an end, from the end back to the source."""
    way = [end]
    while before[way[-1]] >= 0:
        way.append(int(before[way[-1]]))
    return way


def _refined(
    mesh: TriangleMesh, way: list[int], tree: IntArray, loop: IntArray, cost: _Cost
) -> EdgePath:
    """Shortest curve across the triangles round a way along edges, from the loop to the tree."""
    # Triangles within two rings of the way.
    near = np.zeros(len(mesh.points), dtype=bool)
    near[way] = True
    for _ in range(2):
        near[mesh.triangles[near[mesh.triangles].any(axis=1)]] = True
    t = mesh.triangles[near[mesh.triangles].all(axis=1)]
    fixed = np.zeros(len(mesh.points), dtype=bool)
    fixed[tree] = fixed[loop] = True
    n, m = len(mesh.points), len(t)
    sides = np.sort(np.stack([t[:, [1, 2]], t[:, [2, 0]], t[:, [0, 1]]], axis=1), axis=2)
    keys, side = np.unique(sides[..., 0] * n + sides[..., 1], return_inverse=True)
    side = side.reshape(m, 3)
    edges = np.stack(np.divmod(keys, n), axis=1)
    # Edges of the border, of the tree and of the loop are not crossed.
    count = np.bincount(side.ravel(), minlength=len(edges))
    open_ = (count == 2) & ~fixed[edges].all(axis=1)
    share = np.asarray((np.arange(_PER_EDGE) + 1.0) / (_PER_EDGE + 1.0), dtype=np.float64)
    a, b = mesh.points[edges[:, 0]], mesh.points[edges[:, 1]]
    places = a[:, None] + share[None, :, None] * (b - a)[:, None]
    # Nodes of the graph: crossings, then the points of the mesh at which the curve may end.
    ends = np.unique(t[fixed[t]])
    number = np.full(n, -1)
    number[ends] = _PER_EDGE * len(edges) + np.arange(len(ends))
    where = np.concatenate([places.reshape(-1, 3), mesh.points[ends]])
    # Within a triangle every crossing of a side is joined with every crossing of another side, and
    # with the end in the corner across.
    rows, columns = [], []
    for i in range(3):
        for j in range(i):
            both = np.flatnonzero(open_[side[:, i]] & open_[side[:, j]])
            for p in range(_PER_EDGE):
                for q in range(_PER_EDGE):
                    rows.append(_PER_EDGE * side[both, i] + p)
                    columns.append(_PER_EDGE * side[both, j] + q)
        corner = np.flatnonzero(open_[side[:, i]] & (number[t[:, i]] >= 0))
        for p in range(_PER_EDGE):
            rows.append(_PER_EDGE * side[corner, i] + p)
            columns.append(number[t[corner, i]])
    row, column = np.concatenate(rows), np.concatenate(columns)
    weight = np.linalg.norm(where[row] - where[column], axis=1)
    weight = weight * cost(0.5 * (where[row] + where[column]))
    graph = sp.coo_array((weight, (row, column)), shape=(len(where), len(where))).tocsr()
    # Shortest way on this graph from any end on the tree to the nearest one on the loop.
    on_tree = np.zeros(n, dtype=bool)
    on_tree[tree] = True
    source = number[ends[on_tree[ends]]]
    distance, before, _ = dijkstra(
        graph, directed=False, indices=source, min_only=True, return_predecessors=True
    )
    on_loop = np.zeros(n, dtype=bool)
    on_loop[loop] = True
    target = number[ends[on_loop[ends]]]
    last = int(target[np.argmin(distance[target])])
    if not np.isfinite(distance[last]):
        raise InputError("a hole of the layer cannot be joined with the others: name fewer joints")
    followed = _way_back(before.astype(np.int64), last)
    inner = np.array(followed[1:-1], dtype=np.int64)
    first = _PER_EDGE * len(edges)
    path = EdgePath(
        int(ends[followed[0] - first]),
        int(ends[followed[-1] - first]),
        edges[inner // _PER_EDGE],
        np.asarray(share[inner % _PER_EDGE], dtype=np.float64),
    )
    return straighten(mesh.points, path, _KEEP)


# Straightening of a curve across triangles.


_SWEEPS = 20


def straighten(points: FloatArray, path: EdgePath, keep: float) -> EdgePath:
    """Move the crossings of a curve along their edges so that it gets shorter.

    Each crossing in turn moves to where the straight line between its neighbours crosses its edge,
    with both triangles laid flat. After s sweeps bends are spread over about sqrt(s) crossings.

    Parameters
    ----------
    points : (n, 3) array, mm
    keep : float in (0, 0.5)
        Least share of an edge between a crossing and either end.
    """
    share = path.share.copy()
    _sweep(seen_only(points), path.start, path.end, path.edges, share, keep, _SWEEPS)
    return replace(path, share=share)


@compiled
def _sweep(
    points: FloatArray,
    start: int,
    end: int,
    edges: IntArray,
    share: FloatArray,
    keep: float,
    sweeps: int,
) -> None:
    count = len(share)
    for sweep in range(sweeps):
        for step in range(count):
            k = step if sweep % 2 == 0 else count - 1 - step
            # Position of each neighbour along the edge, and its distance from the edge.
            square, s, t = 0.0, 0.0, 0.0
            for i in range(points.shape[1]):
                a = points[edges[k, 0], i]
                along = points[edges[k, 1], i] - a
                square += along * along
                s += (_before(points, start, edges, share, k, i) - a) * along
                t += (_behind(points, end, edges, share, k, i) - a) * along
            s, t = s / square, t / square
            u, v = 0.0, 0.0
            for i in range(points.shape[1]):
                a = points[edges[k, 0], i]
                along = points[edges[k, 1], i] - a
                u += (_before(points, start, edges, share, k, i) - a - s * along) ** 2
                v += (_behind(points, end, edges, share, k, i) - a - t * along) ** 2
            u, v = np.sqrt(u), np.sqrt(v)
            if u + v > 0.0:
                share[k] = min(max((s * v + t * u) / (u + v), keep), 1.0 - keep)


@compiled
def _before(
    points: FloatArray, start: int, edges: IntArray, share: FloatArray, k: int, i: int
) -> float:
    """Coordinate i of the point before crossing k: the previous crossing, or the start."""
    return points[start, i] if k == 0 else _crossing(points, edges, share, k - 1, i)


@compiled
def _behind(
    points: FloatArray, end: int, edges: IntArray, share: FloatArray, k: int, i: int
) -> float:
    """Coordinate i of the point after crossing k: the next crossing, or the end."""
    return points[end, i] if k == len(share) - 1 else _crossing(points, edges, share, k + 1, i)


@compiled
def _crossing(points: FloatArray, edges: IntArray, share: FloatArray, k: int, i: int) -> float:
    """Coordinate i of a crossing."""
    return points[edges[k, 0], i] * (1.0 - share[k]) + points[edges[k, 1], i] * share[k]
