"""Finer cells where they are wanted: cells are halved at their longest edges.

A cell that is cut at all is cut at its longest edge first, which keeps cells from becoming flat
(Rivara, Int. J. Numer. Meth. Engng 20, 1984, 745-756). The order of the edges is one for the whole
mesh, so two cells cut the facet between them alike, and no node hangs.
"""

from itertools import combinations

import numpy as np

from ccfem.base.arrays import BoolArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import unique_edges


def bisected(mesh: TetMesh, chosen: BoolArray) -> tuple[TetMesh, IntArray]:
    """Halve chosen linear cells at their longest edges, and what of their neighbours has to follow.

    Returns the mesh, whose first nodes are those of before, with its patches cut as their cells
    are; and the cell (k,) that each cell is a piece of.
    """
    edges, edge = unique_edges(mesh.cells[:, mesh.edges].reshape(-1, 2))
    edge = edge.reshape(-1, 6)
    length = np.linalg.norm(np.diff(mesh.points[edges], axis=1)[:, 0], axis=1)
    rank = np.empty(len(edges), dtype=np.int64)
    rank[np.argsort(length, kind="stable")] = np.arange(len(edges))
    longest = edge[np.arange(len(edge)), rank[edge].argmax(axis=1)]
    halved = np.zeros(len(edges), dtype=bool)
    halved[longest[chosen]] = True
    while True:
        wanted = longest[halved[edge].any(axis=1)]
        if halved[wanted].all():
            break
        halved[wanted] = True
    n, ends = len(mesh.points), np.sort(edges[halved], axis=1).astype(np.int64)
    points = np.concatenate([mesh.points, mesh.points[ends].mean(axis=1)])
    key = ends[:, 0] * n + ends[:, 1]
    order = np.argsort(key, kind="stable")
    cut = (n, key[order], rank[halved][order], n + order)
    cells, parent = _bisected(mesh.cells, *cut)
    patches = {name: _bisected(facets, *cut)[0] for name, facets in mesh.patches.items()}
    return TetMesh(points, cells, patches, mesh.axes, mesh.walls), parent


def _bisected(
    cells: IntArray, n: int, key: IntArray, rank: IntArray, middle: IntArray
) -> tuple[IntArray, IntArray]:
    """Cut cells, or facets, at the edges of these keys; the pieces, and whose pieces they are."""
    sides = np.array(list(combinations(range(cells.shape[1]), 2)))
    rest, owner = cells.astype(np.int64), np.arange(len(cells))
    done, owners = [rest[:0]], [owner[:0]]
    while len(rest):
        ends = np.sort(rest[:, sides], axis=2)
        wanted = np.where(ends[..., 1] < n, ends[..., 0] * n + ends[..., 1], -1)
        at = np.minimum(np.searchsorted(key, wanted), max(len(key) - 1, 0))
        known = key[at] == wanted if len(key) else np.zeros(wanted.shape, dtype=bool)
        place = np.where(known, rank[at] if len(key) else 0, -1)
        side, rows = place.argmax(axis=1), np.arange(len(rest))
        whole = place[rows, side] < 0
        done.append(rest[whole])
        owners.append(owner[whole])
        rows, side = rows[~whole], side[~whole]
        half = middle[at[rows, side]]
        pieces = np.concatenate([rest[rows], rest[rows]])
        k = len(rows)
        pieces[np.arange(k), sides[side, 0]] = half
        pieces[k + np.arange(k), sides[side, 1]] = half
        rest, owner = pieces, np.concatenate([owner[rows], owner[rows]])
    order = np.argsort(np.concatenate(owners), kind="stable")
    return np.concatenate(done)[order], np.concatenate(owners)[order]
