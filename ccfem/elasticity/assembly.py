"""Stiffness matrix of linear and quadratic tetrahedra, gathered row by row into 3x3 blocks.

Each row of blocks is the sum over the cells round its node, so no element matrix is ever stored.
Quadratic cells with straight sides are integrated exactly: their gradients are linear in the
barycentric coordinates, so every block is a combination of the sixteen products of the four
corner gradients.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.arrays import FloatArray, IntArray, freeze
from ccfem.mesh.cell_mesh import CellMesh
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["Pattern", "add_blocks", "assemble", "cell_gradients", "pattern"]


@dataclass(frozen=True)
class Pattern:
    """Where the blocks of the stiffness matrix are; the same for every stiffness on a mesh.

    Attributes
    ----------
    indptr : (n + 1,) int array
        First block of each row.
    indices : (b,) int array
        Column (node) of each block, ascending within a row.
    start : (n + 1,) int array
        First entry of each node in `touching`.
    touching : (m * q,) int array
        ``q * cell + place`` of each cell that a node belongs to and its place there; q is the
        number of nodes of a cell.
    """

    indptr: IntArray
    indices: IntArray
    start: IntArray
    touching: IntArray

    def __post_init__(self) -> None:
        freeze(self, indptr=np.int32, indices=np.int32, start=np.int32, touching=np.int32)


def pattern(mesh: CellMesh) -> Pattern:
    """Find the pattern of the stiffness matrix of a mesh."""
    (m, q), n = mesh.cells.shape, len(mesh.points)
    starts = np.arange(0, m * q + 1, q, dtype=np.int32)
    nodes = mesh.cells.reshape(-1).astype(np.int32)
    places = np.arange(m * q, dtype=np.int32)
    cells_of_node = sp.csr_array((places, nodes, starts), shape=(m, n)).T.tocsr()
    one = np.ones(m * q, dtype=np.bool_)
    joined = sp.csr_array(
        (one, cells_of_node.indices, cells_of_node.indptr), shape=(n, m)
    ) @ sp.csr_array((one, nodes, starts), shape=(m, n))
    # The pattern is symmetric, and transposing leaves the columns sorted.
    joined = joined.T.tocsr()
    return Pattern(joined.indptr, joined.indices, cells_of_node.indptr, cells_of_node.data)


def cell_gradients(mesh: TetMesh) -> FloatArray:
    """Gradients of the four barycentric coordinates in each cell.

    Returns
    -------
    (m, 4, 3) array, 1/mm
        In a linear cell the displacement gradient is ``u.T @ gradients`` with the (4, 3)
        displacement of its corners.
    """
    result = np.empty((len(mesh.cells), 4, 3))
    _gradients(mesh.points, mesh.cells, result)
    return result


@njit(cache=True)
def _gradients(points, cells, result):  # type: ignore[no-untyped-def]
    e = np.empty((3, 3))
    for cell in range(len(cells)):
        for a in range(3):
            for d in range(3):
                e[a, d] = points[cells[cell, a + 1], d] - points[cells[cell, 0], d]
        determinant = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            for d in range(3):
                p, q = (d + 1) % 3, (d + 2) % 3
                result[cell, a + 1, d] = e[b, p] * e[c, q] - e[b, q] * e[c, p]
        for d in range(3):
            determinant += e[0, d] * result[cell, 1, d]
        for d in range(3):
            total = 0.0
            for a in range(1, 4):
                result[cell, a, d] /= determinant
                total += result[cell, a, d]
            result[cell, 0, d] = -total


@njit(cache=True)
def _times_gradient(c, g, factor, t):  # type: ignore[no-untyped-def]
    """Store ``factor * C B`` in t (6, 3), B the strain of displacements with gradient g."""
    x, y, z = factor * g[0], factor * g[1], factor * g[2]
    for k in range(6):
        t[k, 0] = c[k, 0] * x + c[k, 4] * z + c[k, 5] * y
        t[k, 1] = c[k, 1] * y + c[k, 3] * z + c[k, 5] * x
        t[k, 2] = c[k, 2] * z + c[k, 3] * y + c[k, 4] * x


@njit(cache=True)
def _against(t, p, x, y, z):  # type: ignore[no-untyped-def]
    """Row p of ``t.T B``, B the strain of displacements with gradient (x, y, z)."""
    return (
        t[0, p] * x + t[4, p] * z + t[5, p] * y,
        t[1, p] * y + t[3, p] * z + t[5, p] * x,
        t[2, p] * z + t[3, p] * y + t[4, p] * x,
    )


@njit(cache=True)
def _mark(indptr, indices, i, slot):  # type: ignore[no-untyped-def]
    """Store in `slot` the entry of the pattern of each column of row i."""
    for s in range(indptr[i], indptr[i + 1]):
        slot[indices[s]] = s


@njit(cache=True)
def _gather_linear(indptr, indices, start, touching, cells, gradients, scale, stiffness, data):  # type: ignore[no-untyped-def]
    one = stiffness.shape[0] == 1
    slot = np.empty(indptr.size - 1, np.int32)
    t = np.empty((6, 3))
    for i in range(indptr.size - 1):
        _mark(indptr, indices, i, slot)
        for e in range(start[i], start[i + 1]):
            cell, a = touching[e] // 4, touching[e] % 4
            c = stiffness[0 if one else cell]
            _times_gradient(c, gradients[cell, a], scale[cell], t)
            for b in range(4):
                x, y, z = gradients[cell, b, 0], gradients[cell, b, 1], gradients[cell, b, 2]
                s = slot[cells[cell, b]]
                for p in range(3):
                    u, v, w = _against(t, p, x, y, z)
                    data[s, p, 0] += u
                    data[s, p, 1] += v
                    data[s, p, 2] += w


@njit(cache=True)
def _gather_quadratic(  # type: ignore[no-untyped-def]
    indptr, indices, start, touching, cells, gradients, scale, stiffness, first, second, data
):
    # Gradient of shape function a: sum of its terms phi_s g_s. A corner i has one term,
    # (4 L_i - 1) g_i; the edge (i, j) has two, 4 L_j g_i and 4 L_i g_j. Written with the corner
    # that the linear factor belongs to, any two terms integrate to 16 (1 + [same]) / 20, less 1
    # where one of them is a corner's (twice less 1, plus 1, where both are).
    one = stiffness.shape[0] == 1
    slot = np.empty(indptr.size - 1, np.int32)
    t = np.empty((6, 3))
    block = np.empty((2, 4, 3, 3))
    for i in range(indptr.size - 1):
        _mark(indptr, indices, i, slot)
        for e in range(start[i], start[i + 1]):
            cell, a = touching[e] // 10, touching[e] % 10
            c = stiffness[0 if one else cell]
            terms_a = 1 if a < 4 else 2
            for k in range(terms_a):
                corner = first[a] if k == 0 else second[a]
                _times_gradient(c, gradients[cell, corner], scale[cell], t)
                for b in range(4):
                    x, y, z = gradients[cell, b, 0], gradients[cell, b, 1], gradients[cell, b, 2]
                    for p in range(3):
                        block[k, b, p] = _against(t, p, x, y, z)
            for b in range(10):
                s = slot[cells[cell, b]]
                terms_b = 1 if b < 4 else 2
                for k in range(terms_a):
                    linear_a = second[a] if k == 0 else first[a]
                    for h in range(terms_b):
                        linear_b = second[b] if h == 0 else first[b]
                        corner = first[b] if h == 0 else second[b]
                        w = 1.6 if linear_a == linear_b else 0.8
                        if a < 4 or b < 4:
                            w -= 1.0
                        for p in range(3):
                            for r in range(3):
                                data[s, p, r] += w * block[k, corner, p, r]


_FIRST = np.concatenate([np.arange(4), TetMesh.edges[:, 0]])
_SECOND = np.concatenate([np.arange(4), TetMesh.edges[:, 1]])


def assemble(
    mesh: TetMesh,
    stiffness: FloatArray,
    density: FloatArray | None = None,
    where: Pattern | None = None,
) -> sp.bsr_array:
    """Stiffness matrix of a mesh.

    Parameters
    ----------
    mesh : TetMesh
        Linear, or quadratic with straight sides.
    stiffness : (6, 6) or (m, 6, 6) array, MPa
        In the global frame, for all cells or for each.
    density : (m,) array, optional
        Factor on the stiffness of each cell.
    where : Pattern, optional
        From `pattern`, when it is at hand already.

    Returns
    -------
    bsr_array (3n, 3n) with 3x3 blocks, N/mm
        Its columns are sorted and its ``indptr`` and ``indices`` are those of the pattern.
    """
    where = pattern(mesh) if where is None else where
    scale = mesh.volumes if density is None else mesh.volumes * density
    stiffness = np.ascontiguousarray(stiffness, dtype=np.float64).reshape(-1, 6, 6)
    if len(stiffness) not in (1, len(mesh.cells)):
        raise ValueError(
            f"stiffness must have shape (6, 6) or ({len(mesh.cells)}, 6, 6); got "
            f"{len(stiffness)} matrices: give one a cell"
        )
    data = np.zeros((len(where.indices), 3, 3))
    arguments = (where.indptr, where.indices, where.start, where.touching, mesh.cells)
    values = (cell_gradients(mesh), scale, stiffness)
    if mesh.order == 1:
        _gather_linear(*arguments, *values, data)
    else:
        _gather_quadratic(*arguments, *values, _FIRST, _SECOND, data)
    n = 3 * len(mesh.points)
    return sp.bsr_array((data, where.indices, where.indptr), shape=(n, n))


@njit(cache=True)
def _scatter(indptr, indices, nodes, blocks, data):  # type: ignore[no-untyped-def]
    q = nodes.shape[1]
    for e in range(nodes.shape[0]):
        for a in range(q):
            i = nodes[e, a]
            for b in range(q):
                low, high = indptr[i], indptr[i + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < nodes[e, b]:
                        low = middle + 1
                    else:
                        high = middle
                for p in range(3):
                    for r in range(3):
                        data[low, p, r] += blocks[e, 3 * a + p, 3 * b + r]


def add_blocks(matrix: sp.bsr_array, nodes: IntArray, blocks: FloatArray) -> None:
    """Add element matrices to an assembled matrix, in place.

    Parameters
    ----------
    matrix : bsr_array (3n, 3n)
        From `assemble`. Every pair of nodes of an element must share a cell of its mesh.
    nodes : (k, q) int array
        Nodes of each element.
    blocks : (k, 3q, 3q) array, N/mm
        Element matrices, the components of a node together.
    """
    _scatter(matrix.indptr, matrix.indices, nodes, np.ascontiguousarray(blocks), matrix.data)
