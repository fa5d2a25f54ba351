"""Facets and edges by their nodes, in any order of these; areas and volumes of simplices."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ccfem.base.arrays import BoolArray, FloatArray, IntArray


def facet_keys(*tables: IntArray) -> list[IntArray]:
    """Give facets one integer each, the same for the same nodes in any order.

    Parameters
    ----------
    *tables : (k_i, c) int arrays
        Nodes of facets, from 0.

    Returns
    -------
    list of (k_i,) int arrays
        Ascending as the sorted nodes do. They are comparable among the tables of one call only:
        where node numbers are so large that a product of them would not fit, the keys of the first
        columns are ranked in between.
    """
    nodes = _ascending(np.concatenate(tables).astype(np.int64))
    count = int(nodes[-1].max(initial=0)) + 1
    key = nodes[0]
    for column in nodes[1:]:
        if int(key.max(initial=0)) >= np.iinfo(np.int64).max // count:
            _, key = np.unique(key, return_inverse=True)
        key = key * count + column
    return np.split(key, np.cumsum([len(table) for table in tables])[:-1])


def _ascending(table: IntArray) -> list[IntArray]:
    """Columns of a table (k, c) with every row sorted: faster than by row where c is small."""
    columns = list(table.T)
    for last in range(len(columns) - 1, 0, -1):
        for j in range(last):
            low, high = columns[j : j + 2]
            columns[j : j + 2] = np.minimum(low, high), np.maximum(low, high)
    return columns


def paired(facets: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs (f, 2) of facets (k, c) that have the same nodes, and those (s,) that stand alone."""
    (key,) = facet_keys(facets)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order]) == 0)
    single = np.ones(len(order), dtype=bool)
    single[first] = single[first + 1] = False
    return np.stack([order[first], order[first + 1]], axis=1), np.sort(order[single])


def positions(facets: IntArray, among: IntArray) -> IntArray:
    """Row (k,) of each facet (k, c) in another table (m, c), -1 where it is not there."""
    wanted, known = facet_keys(facets, among)
    known, row = np.unique(known, return_index=True)
    at = np.searchsorted(known, wanted)
    present = np.append(known, -1)[at] == wanted
    return np.where(present, np.append(row, -1)[at], -1)


def are_among(facets: IntArray, others: IntArray) -> BoolArray:
    """Whether each facet (k, c) is in another table (m, c)."""
    wanted, known = facet_keys(facets, others)
    return np.isin(wanted, known)


def sides_at(edges: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Triangle and side of each directed edge (e, 2), of the triangles (t, 3) that have them.

    Side k goes from corner k of its triangle to the next one, so that corner k + 2 is opposite.
    """
    sides = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    count = int(triangles.max()) + 1
    known = sides[:, 0] * count + sides[:, 1]
    order = np.argsort(known, kind="stable")
    at = order[np.searchsorted(known[order], edges[:, 0] * count + edges[:, 1])]
    return at // 3, at % 3


def unique_edges(ends: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (e, 2) that pairs of nodes (k, 2) stand for, and the edge (k,) of each pair.

    The edges ascend, and so do the nodes of each.
    """
    (key,) = facet_keys(ends)
    _, edge = np.unique(key, return_inverse=True)
    edges = np.empty((int(edge.max(initial=-1)) + 1, 2), dtype=ends.dtype)
    edges[edge] = np.column_stack(_ascending(ends))
    return edges, edge


def edges_left(edges: IntArray, number: IntArray) -> IntArray:
    """Edges (k, 2) of which both ends stay, by the new numbers (n,) of points; -1 for none."""
    left = number[edges]
    return np.asarray(left[(left >= 0).all(axis=1)])


def border_edges(triangles: IntArray, n: int) -> IntArray:
    """Directed edges (e, 2) that only one triangle has, with the material on their left.

    An edge shared by more triangles, where sheets meet, counts as often as it is used more in one
    sense than in the other, so that borders always close.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    low, high = edges.min(axis=1), edges.max(axis=1)
    known, inverse = np.unique(low * n + high, return_inverse=True)
    net = np.bincount(inverse, np.where(edges[:, 0] == low, 1.0, -1.0), len(known)).astype(int)
    ends = np.stack(np.divmod(known, n), axis=1)
    ends[net < 0] = ends[net < 0, ::-1]
    return np.asarray(np.repeat(ends, np.abs(net), axis=0))


# Areas and volumes of simplices, and which of them hang together.


def signed_areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Area of triangles (t, 3) of points (n, 2), (t,), mm^2; negative where clockwise."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    u, v = b - a, c - a
    return np.asarray(0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]))


def counter_clockwise(points: FloatArray, triangles: IntArray) -> IntArray:
    """Triangles (t, 3) of points (n, 2), the clockwise ones turned over."""
    turned = triangles[:, [0, 2, 1]]
    return np.where((signed_areas(points, triangles) < 0.0)[:, None], turned, triangles)


def areas_and_normals(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Areas (t,), mm^2, and unit normals (t, 3), zero without an area, of triangles in space."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    across = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    return area, across / np.maximum(area, 1e-300)[:, None]


def signed_volumes(points: FloatArray, corners: IntArray) -> FloatArray:
    """Volume of straight-sided tetrahedra (m, 4), (m,), mm^3; negative where turned inside out."""
    a, b, c, d = np.moveaxis(points[corners], 1, 0)
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def connected(pairs: IntArray, count: int) -> IntArray:
    """Label the pieces of things that are joined in pairs (k, 2): the piece of each, (count,)."""
    links = coo_array((np.ones(len(pairs), dtype=bool), pairs.T), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
