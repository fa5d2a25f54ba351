"""Quadratic tetrahedra whose sides follow a round wall: their middles, gradients and volumes.

A cell maps from barycentric coordinates by the shape functions that also interpolate the
displacement in it (isoparametric). Where all middles lie on the chords the map is linear.
"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.round_walls import RoundWall, moved_onto
from ccfem.geometry.facets import facet_keys

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corner nodes of the edge that carries mid-side node 4 + k (VTK order)."""
_SIDES = np.array([[0, 1], [1, 2], [2, 0]])
STRAIGHT = 1e-6
"""Distance of a mid-side node from the middle of its edge, over the edge, that counts as none."""
_PLANE = 0.999
"""Least cosine between the normals of facets in one plane."""
_FOLDED = 0.2
"""Least determinant of the map of a cell, over that of its straight one."""


def _orbit(*weights: float) -> FloatArray:
    """All orders of four barycentric coordinates of which some are equal, each once."""
    return np.array(sorted(set(permutations(weights))))


_INNER, _OUTER, _SIDE = 0.3108859192633006, 0.0927352503108912, 0.0455037041256497
CELL_POINTS = np.concatenate(
    [
        _orbit(_INNER, _INNER, _INNER, 1.0 - 3.0 * _INNER),
        _orbit(_OUTER, _OUTER, _OUTER, 1.0 - 3.0 * _OUTER),
        _orbit(_SIDE, _SIDE, 0.5 - _SIDE, 0.5 - _SIDE),
    ]
)
CELL_WEIGHTS = np.repeat([0.1126879257180159, 0.0734930431163620, 0.0425460207770815], [4, 4, 6])
"""Quadrature of a tetrahedron, exact to degree 5, in shares of its volume (Walkington 2000)."""
_FACET_POINTS = np.array(
    [np.roll([1.0 - 2.0 * a, a, a], k) for a in (0.445948490915965, 0.0915762135097707)
     for k in range(3)]
)  # fmt: skip
_FACET_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)
"""Quadrature of a triangle, exact to degree 4, in shares of its area (Dunavant 1985)."""
NODES = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1)])
"""Barycentric coordinates of the ten nodes of a cell."""


def side_middles(
    points: FloatArray,
    boundary: IntArray,
    normals: FloatArray,
    walls: Sequence[RoundWall],
    wall_of: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Middles (k, 3), mm, of the sides (k, 2) that lie on round walls.

    Where a wall ends, the middle lies on the line in which it meets the face beyond. The boundary
    facets (b, 3) have outward normals (b, 3), and lie on a wall (b,), or -1.
    """
    sides = boundary[:, _SIDES].reshape(-1, 2)
    (key,) = facet_keys(sides)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order]) == 0)
    one, two = order[first], order[first + 1]
    # Sides with a wall on at least one hand, which becomes the first.
    one, two = np.where(wall_of[one // 3] >= 0, (one, two), (two, one))
    on_wall = wall_of[one // 3] >= 0
    one, two = one[on_wall], two[on_wall]
    wall, beyond = wall_of[one // 3], wall_of[two // 3]
    flat = np.where((beyond < 0)[:, None], normals[two // 3], 0.0)
    second = np.where(beyond == wall, -1, beyond)
    ends = sides[one]
    return ends, moved_onto(walls, wall, points[ends].mean(axis=1), second, flat)


def nodes_on_walls(
    points: FloatArray,
    boundary: IntArray,
    normals: FloatArray,
    walls: Sequence[RoundWall],
    wall_of: IntArray,
) -> tuple[IntArray, FloatArray]:
    """Nodes (k,) of the facets on round walls, and where they lie on these walls, (k, 3), mm.

    What meshed the triangles of a surface anew put them on chords. Nodes at the end of a wall keep
    to the face beyond, and those where more than two faces meet stay. Parameters are as in
    `side_middles`.
    """
    n, node, wall = len(points), boundary.reshape(-1), np.repeat(wall_of, 3)
    first, second = np.full(n, len(walls)), np.full(n, -1)
    round_ = wall >= 0
    np.minimum.at(first, node[round_], wall[round_])
    np.maximum.at(second, node[round_], wall[round_])
    third = np.zeros(n, dtype=bool)
    third[node[round_ & (wall != first[node]) & (wall != second[node])]] = True
    # The plane beyond: the mean normal of the other facets, if they agree on it.
    flat = np.zeros((n, 3))
    np.add.at(flat, node[~round_], np.repeat(normals, 3, axis=0)[~round_])
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-300)[:, None]
    agrees = np.einsum("ki,ki->k", np.repeat(normals, 3, axis=0), flat[node]) > _PLANE
    third[node[~round_ & ~agrees]] = True
    alone = first == second
    third |= ~alone & flat.any(axis=1)
    nodes = np.flatnonzero((second >= 0) & ~third)
    beyond = np.where(alone, -1, second)[nodes]
    return nodes, moved_onto(walls, first[nodes], points[nodes], beyond, flat[nodes])


def unfolded(points: FloatArray, cells: IntArray, middles: IntArray) -> FloatArray:
    """Points (n, 3) with those `middles` (k,) back on their chords that would fold a cell."""
    off = np.zeros(len(points), dtype=bool)
    off[middles] = True
    points = points.copy()
    curved = np.flatnonzero(off[cells[:, 4:]].any(axis=1))
    samples = np.concatenate([NODES, CELL_POINTS])
    while len(curved):
        corner = points[cells[curved]]
        straight = jacobians(straightened(corner), NODES[0])
        least = np.min([jacobians(corner, at) for at in samples], axis=0)
        folds = least < _FOLDED * straight
        if not folds.any():
            break
        cell = cells[curved[folds]]
        points[cell[:, 4:]] = points[cell[:, EDGES]].mean(axis=2)
        off[cell[:, 4:]] = False
        curved = curved[off[cells[curved, 4:]].any(axis=1)]
    return points


def curved_cells(points: FloatArray, cells: IntArray) -> IntArray:
    """Rows of the quadratic cells with a middle off its chord."""
    result = np.zeros(len(cells), dtype=bool)
    for k, (i, j) in enumerate(EDGES):
        start, end = points[cells[:, i]], points[cells[:, j]]
        gap = np.linalg.norm(points[cells[:, 4 + k]] - 0.5 * (start + end), axis=1)
        result |= gap > STRAIGHT * np.linalg.norm(end - start, axis=1)
    return np.flatnonzero(result)


def shape_values(at: FloatArray) -> FloatArray:
    """Values (..., 10) of the quadratic shape functions at barycentric coordinates (..., 4)."""
    i, j = EDGES.T
    return np.concatenate([at * (2.0 * at - 1.0), 4.0 * at[..., i] * at[..., j]], axis=-1)


def _slopes(at: FloatArray) -> FloatArray:
    """Differentiate the shape functions by the last three coordinates (..., 4): (..., 10, 3)."""
    table = np.zeros((*at.shape[:-1], 10, 4))
    i, j = EDGES.T
    table[..., np.arange(4), np.arange(4)] = 4.0 * at - 1.0
    table[..., 4 + np.arange(6), i] = 4.0 * at[..., j]
    table[..., 4 + np.arange(6), j] = 4.0 * at[..., i]
    return np.asarray(table[..., 1:] - table[..., :1])


def jacobians(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Six times the local volume (m,), mm^3, of cells with nodes (m, 10, 3) at a place (4,)."""
    return np.asarray(np.linalg.det(np.swapaxes(nodes, 1, 2) @ _slopes(at)))


def gradients_at(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Gradients (m, 10, 3), 1/mm, of the shape functions of cells with nodes (m, 10, 3).

    The barycentric coordinates are (4,), or (m, 4) of a place in each cell.
    """
    table = _slopes(at)
    return np.asarray(table @ np.linalg.inv(np.swapaxes(nodes, 1, 2) @ table))


def curved_volumes(nodes: FloatArray) -> FloatArray:
    """Volume (m,), mm^3, of cells with nodes (m, 10, 3)."""
    return integrals(nodes).sum(axis=1)


def integrals(nodes: FloatArray) -> FloatArray:
    """Integrals (m, 10), mm^3, of the shape functions over cells with nodes (m, 10, 3)."""
    points = zip(CELL_WEIGHTS, CELL_POINTS, strict=True)
    parts = [w / 6.0 * jacobians(nodes, at)[:, None] * shape_values(at) for w, at in points]
    return np.asarray(np.sum(parts, axis=0))


def facet_integrals(nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Integrals of the shape functions over quadratic facets with nodes (k, 6, 3).

    Of the area, (k, 6), mm^2, and of the vector, (k, 6, 3): times the unit normal, which their
    corners go round counter-clockwise.
    """
    area, vector = np.zeros(nodes.shape[:2]), np.zeros(nodes.shape)
    for weight, at in zip(_FACET_WEIGHTS, _FACET_POINTS, strict=True):
        i, j = _SIDES.T
        values = np.concatenate([at * (2.0 * at - 1.0), 4.0 * at[i] * at[j]])
        table = np.zeros((6, 3))
        table[np.arange(3), np.arange(3)] = 4.0 * at - 1.0
        table[3 + np.arange(3), i], table[3 + np.arange(3), j] = 4.0 * at[j], 4.0 * at[i]
        along, across = (np.einsum("kai,a->ki", nodes, table[:, k] - table[:, 0]) for k in (1, 2))
        normal = 0.5 * weight * np.cross(along, across)
        area += np.linalg.norm(normal, axis=1)[:, None] * values
        vector += normal[:, None] * values[:, None]
    return area, vector


def barycentric(nodes: FloatArray, places: FloatArray, start: FloatArray) -> FloatArray:
    """Barycentric coordinates (k, 4) of places (k, 3), mm, in cells with nodes (k, 10, 3).

    Newton's steps from a start (k, 4): the coordinates in the straight cells.
    """
    at = start.copy()
    for _ in range(4):
        gap = places - np.einsum("ka,kai->ki", shape_values(at), nodes)
        matrix = np.swapaxes(nodes, 1, 2) @ _slopes(at)
        step = np.linalg.solve(matrix, gap[:, :, None])[:, :, 0]
        at[:, 1:] += step
        at[:, 0] -= step.sum(axis=1)
    return at


def straightened(nodes: FloatArray) -> FloatArray:
    """Nodes (m, 10, 3) with the middles on their chords."""
    return np.concatenate([nodes[:, :4], nodes[:, EDGES].mean(axis=2)], axis=1)
