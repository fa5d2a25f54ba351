"""The part of a tetrahedral mesh where a field lies above a level, as a mesh of its own."""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import are_among, positions
from ccfem.geometry.measures import signed_volumes

_LEAST = 0.05
"""Least share of an edge on either side of a cut."""
_PRISMS = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 2, 0, 4, 5, 3],
        [2, 0, 1, 5, 3, 4],
        [3, 5, 4, 0, 2, 1],
        [4, 3, 5, 1, 0, 2],
        [5, 4, 3, 2, 1, 0],
    ]
)
"""Orders of the corners of a prism that begin with each of them and do not turn it inside out."""
_SPLITS = np.array(
    [
        [[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]],
        [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]],
    ]
)
"""Tetrahedra of a prism whose diagonals meet in corner 0, by the third diagonal: 15 or 24."""
_LONE = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 0, 1, 3), (3, 0, 2, 1))
_PAIRS = (
    (0, 1, 2, 3),
    (2, 3, 0, 1),
    (0, 2, 3, 1),
    (3, 1, 0, 2),
    (0, 3, 1, 2),
    (1, 2, 0, 3),
)
"""Orders of the corners of a tetrahedron that keep it positive."""


class CutMesh(NamedTuple):
    """A part of a mesh.

    Attributes
    ----------
    mesh : TetMesh
        With what is left of the patches.
    facet : (b,) int array
        Boundary facet of the whole mesh that each boundary facet lies on; -1 on the cut.
    """

    mesh: TetMesh
    facet: IntArray


def volume_above(mesh: TetMesh, values: FloatArray, level: float) -> float:
    """Volume where a piecewise linear field, (n,) at the nodes, is above a level, mm^3."""
    off = np.sort(values[mesh.corners] - level, axis=1)[:, ::-1]
    count = (off > 0.0).sum(axis=1)
    share = (count == 4).astype(np.float64)
    a, b, c, d = off.T
    with np.errstate(divide="ignore", invalid="ignore"):
        one = a**3 / ((a - b) * (a - c) * (a - d))
        three = 1.0 + d**3 / ((a - d) * (b - d) * (c - d))
        # Two of three corners, by the prism that is left of the tetrahedron.
        x, y, z, w = a / (a - c), a / (a - d), b / (b - c), b / (b - d)
        two = x * y + z * w * (1.0 - x) + (1.0 - y) * x * w
    for chosen, part in ((1, one), (2, two), (3, three)):
        share[count == chosen] = part[count == chosen]
    return float(mesh.volumes @ share)


def cut_mesh(mesh: TetMesh, values: FloatArray, level: float) -> CutMesh:
    """Cut out the part of a mesh where a piecewise linear field is above a level.

    Marching tetrahedra (Doi and Koide, IEICE Trans. E74 (1991) 214); the prisms that are left are
    split by their least node, so that neighbours agree (Dompierre et al., How to subdivide
    pyramids, prisms and hexahedra into tetrahedra, 8th International Meshing Roundtable, 1999).

    Parameters
    ----------
    mesh : TetMesh
        Linear.
    values : (n,) array
        At the nodes; some above the level.
    level : float
    """
    n, inside = len(mesh.points), values > level
    ends = np.sort(mesh.cells[:, mesh.edges].reshape(-1, 2), axis=1)
    ends = ends[inside[ends[:, 0]] != inside[ends[:, 1]]]
    keys = np.unique(ends[:, 0] * n + ends[:, 1])
    ends = np.stack(np.divmod(keys, n), axis=1)
    low, high = values[ends].T
    share = np.clip((level - low) / (high - low), _LEAST, 1.0 - _LEAST)[:, None]
    points = (1.0 - share) * mesh.points[ends[:, 0]] + share * mesh.points[ends[:, 1]]
    cells = _cells(mesh, inside, keys)
    points = np.concatenate([mesh.points, points])
    turned = signed_volumes(points, cells) < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    used, number = np.unique(cells, return_inverse=True)
    found = TetMesh(points[used], number.reshape(-1, 4))
    own = np.repeat(np.arange(n)[:, None], 2, axis=1)
    facet = _facets(mesh, np.concatenate([own, ends])[used][found.boundary])
    patches = {}
    for name, facets in mesh.patches.items():
        chosen = are_among(mesh.boundary, facets)
        patches[name] = found.boundary[chosen[facet] & (facet >= 0)]
    return CutMesh(found.with_patches(patches), facet)


def _cells(mesh: TetMesh, inside: BoolArray, keys: IntArray) -> IntArray:
    """Cells (k, 4) of the part, the points of cut edges counted behind the nodes."""
    n = len(mesh.points)

    def cut(a: IntArray, b: IntArray) -> IntArray:
        return n + np.searchsorted(keys, np.minimum(a, b) * n + np.maximum(a, b))

    above = inside[mesh.cells]
    count = above.sum(axis=1)
    found = [mesh.cells[count == 4]]
    prisms = [np.zeros((0, 6), dtype=np.int64)]
    for order in _LONE:
        first = above[:, order[0]]
        a, b, c, d = mesh.cells[(count == 1) & first][:, order].T
        found.append(np.stack([a, cut(a, b), cut(a, c), cut(a, d)], axis=1))
        a, b, c, d = mesh.cells[(count == 3) & ~first][:, order].T
        prisms.append(np.stack([b, c, d, cut(a, b), cut(a, c), cut(a, d)], axis=1))
    for order in _PAIRS:
        both = above[:, order[0]] & above[:, order[1]]
        p, q, r, s = mesh.cells[(count == 2) & both][:, order].T
        prisms.append(np.stack([p, cut(p, r), cut(p, s), q, cut(q, r), cut(q, s)], axis=1))
    prism = np.concatenate(prisms)
    prism = np.take_along_axis(prism, _PRISMS[prism.argmin(axis=1)], axis=1)
    third = prism[:, [1, 5]].min(axis=1) > prism[:, [2, 4]].min(axis=1)
    rows = np.arange(len(prism))[:, None, None]
    found.append(prism[rows, _SPLITS[third.astype(np.int64)]].reshape(-1, 4))
    return np.concatenate(found)


def _facets(mesh: TetMesh, nodes: IntArray) -> IntArray:
    """Boundary facet of the mesh (b,), or -1, of facets (b, 3, 2) given by the nodes they cut."""
    nodes = np.sort(nodes.reshape(-1, 6), axis=1)
    fresh = np.concatenate([np.ones((len(nodes), 1), dtype=bool), np.diff(nodes) > 0], axis=1)
    flat = fresh.sum(axis=1) == 3
    result = np.full(len(nodes), -1)
    result[flat] = positions(nodes[flat][fresh[flat]].reshape(-1, 3), mesh.boundary)
    return result
