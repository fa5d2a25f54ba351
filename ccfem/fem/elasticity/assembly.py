"""Stiffness matrix of linear and quadratic tetrahedra, gathered row by row into 3x3 blocks.

Each row of blocks is the sum over the cells round its node, so no element matrix is ever stored.
Quadratic cells with straight sides are integrated exactly: their gradients are linear in the
barycentric coordinates, so every block combines the sixteen products of the four corner gradients.
The few with a side on a round wall get the difference from their straight ones, by quadrature.
"""

from dataclasses import dataclass
from functools import reduce

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, Int32Array, IntArray, freeze, seen_only
from ccfem.base.compiled import compiled
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import (
    CELL_POINTS,
    CELL_WEIGHTS,
    gradients_at,
    jacobians,
    straightened,
)
from ccfem.body.mesh.tet_mesh import CellMesh


@dataclass(frozen=True)
class Pattern:
    """Positions of the blocks of the stiffness matrix; the same for every stiffness on a mesh.

    Attributes
    ----------
    indptr : (n + 1,) int array
        First block of each row.
    indices : (b,) int array
        Column (node) of each block, ascending within a row.
    order : (m,) int array
        Cells by their lowest node, so that rows meet neighbouring cells one after the other.
    start : (n + 1,) int array
        First entry of each node in `touching`.
    touching : (m * q,) int array
        ``q * k + place`` of each cell ``order[k]`` that a node belongs to and its place there; q
        is the number of nodes of a cell.
    """

    indptr: Int32Array
    indices: Int32Array
    order: Int32Array
    start: Int32Array
    touching: Int32Array

    def __post_init__(self) -> None:
        freeze(self, indptr=np.int32, indices=np.int32)
        freeze(self, order=np.int32, start=np.int32, touching=np.int32)


def pattern(mesh: CellMesh) -> Pattern:
    """Find the pattern of the stiffness matrix of a mesh."""
    n = len(mesh.points)
    order, _ = grouped(reduce(np.minimum, mesh.cells.T), n)
    cells = mesh.cells[order].astype(np.int32)
    touching, start = grouped(cells, n)
    # Nodes that share a cell with each node: those of the cells round it.
    (m, q), present = cells.shape, np.ones(cells.size, dtype=bool)
    cells_round = sp.csr_array((present, touching // q, start), (n, m))
    of_cells = sp.csr_array((present, cells.ravel(), q * np.arange(m + 1)), (m, n))
    met = cells_round @ of_cells
    met.sort_indices()
    return Pattern(met.indptr, met.indices, order, start, touching)


def grouped(values: IntArray | Int32Array, count: int) -> tuple[Int32Array, Int32Array]:
    """Entries of (m, q) values below `count`, by value, and the first entry of each value."""
    size = values.size
    rows = (np.ones(size, dtype=bool), values.ravel(), np.arange(size + 1, dtype=np.int32))
    by_value = sp.csr_array(rows, (size, count)).tocsc()
    return by_value.indices, by_value.indptr


def cell_gradients(mesh: TetMesh) -> FloatArray:
    """Gradients (m, 4, 3), 1/mm, of the four barycentric coordinates in each cell.

    In a linear cell the displacement gradient is ``u.T @ gradients`` with the (4, 3) displacement
    of its corners.
    """
    result = np.empty((len(mesh.cells), 4, 3))
    _gradients(mesh.points, mesh.cells, result, np.empty(len(mesh.cells)))
    return result


@compiled
def _gradients(points: FloatArray, cells: IntArray, result: FloatArray, volume: FloatArray) -> None:
    e = np.empty((3, 3))
    for cell in range(len(cells)):
        for a in range(3):
            for d in range(3):
                e[a, d] = points[cells[cell, a + 1], d] - points[cells[cell, 0], d]
        # Gradient a: cross product of the other two edges over their determinant, six times the
        # volume.
        determinant = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            for d in range(3):
                p, q = (d + 1) % 3, (d + 2) % 3
                result[cell, a + 1, d] = e[b, p] * e[c, q] - e[b, q] * e[c, p]
        for d in range(3):
            determinant += e[0, d] * result[cell, 1, d]
        volume[cell] = determinant / 6.0
        # The four coordinates add up to 1, so that their gradients add up to 0.
        for d in range(3):
            total = 0.0
            for a in range(1, 4):
                result[cell, a, d] /= determinant
                total += result[cell, a, d]
            result[cell, 0, d] = -total


@compiled
def _times_gradient(c: FloatArray, g: FloatArray, factor: float, t: FloatArray) -> None:
    """Store ``factor * C B`` in t (6, 3), B the strain of displacements with gradient g."""
    x, y, z = factor * g[0], factor * g[1], factor * g[2]
    for k in range(6):
        t[k, 0] = c[k, 0] * x + c[k, 4] * z + c[k, 5] * y
        t[k, 1] = c[k, 1] * y + c[k, 3] * z + c[k, 5] * x
        t[k, 2] = c[k, 2] * z + c[k, 3] * y + c[k, 4] * x


@compiled
def _against(t: FloatArray, p: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Row p of ``t.T B``, B the strain of displacements with gradient (x, y, z)."""
    return (
        t[0, p] * x + t[4, p] * z + t[5, p] * y,
        t[1, p] * y + t[3, p] * z + t[5, p] * x,
        t[2, p] * z + t[3, p] * y + t[4, p] * x,
    )


@compiled
def _mark(indptr: Int32Array, indices: Int32Array, i: int, slot: Int32Array) -> None:
    """Store in `slot` the entry of the pattern of each column of row i."""
    for s in range(indptr[i], indptr[i + 1]):
        slot[indices[s]] = s


@compiled
def _mirror(
    indptr: Int32Array, indices: Int32Array, i: int, diagonal: Int32Array, data: FloatArray
) -> None:
    """Copy the blocks left of the diagonal of row i from the rows above; note its diagonal.

    Rows are processed in order, so the wanted blocks of row j come in order too: `diagonal` holds
    the position of the last one.
    """
    for s in range(indptr[i], indptr[i + 1]):
        j = indices[s]
        if j == i:
            diagonal[i] = s
            break
        diagonal[j] += 1
        above = diagonal[j]
        for p in range(3):
            for r in range(3):
                data[s, p, r] = data[above, r, p]


@compiled
def _gather_linear(
    where: tuple[Int32Array, Int32Array, Int32Array, Int32Array],
    cells: IntArray,
    which: Int32Array,
    gradients: FloatArray,
    scale: FloatArray,
    stiffness: FloatArray,
    data: FloatArray,
) -> None:
    indptr, indices, start, touching = where
    slot = np.empty(indptr.size - 1, np.int32)
    diagonal = np.empty(indptr.size - 1, np.int32)
    t = np.empty((6, 3))
    # Row by row, so that every block is written by one node: ``K_ij = sum V B_i^T C B_j``.
    for i in range(indptr.size - 1):
        _mark(indptr, indices, i, slot)
        for e in range(start[i], start[i + 1]):
            cell, a = touching[e] // 4, touching[e] % 4
            _times_gradient(stiffness[which[cell]], gradients[cell, a], scale[cell], t)
            for b in range(4):
                j = cells[cell, b]
                if j < i:
                    continue
                x, y, z = gradients[cell, b, 0], gradients[cell, b, 1], gradients[cell, b, 2]
                s = slot[j]
                for p in range(3):
                    u, v, w = _against(t, p, x, y, z)
                    data[s, p, 0] += u
                    data[s, p, 1] += v
                    data[s, p, 2] += w
        _mirror(indptr, indices, i, diagonal, data)


@compiled
def _gather_quadratic(
    where: tuple[Int32Array, Int32Array, Int32Array, Int32Array],
    cells: IntArray,
    which: Int32Array,
    gradients: FloatArray,
    scale: FloatArray,
    stiffness: FloatArray,
    terms: tuple[IntArray, IntArray],
    data: FloatArray,
) -> None:
    (indptr, indices, start, touching), (first, second) = where, terms
    # Gradient of shape function a: sum of its terms phi_s g_s. A corner i has one term,
    # (4 L_i - 1) g_i; the edge (i, j) has two, 4 L_j g_i and 4 L_i g_j. Written with the corner
    # that the linear factor belongs to, any two terms integrate to 16 (1 + [same]) / 20, less 1
    # where one of them is a corner's (twice less 1, plus 1, where both are).
    slot = np.empty(indptr.size - 1, np.int32)
    diagonal = np.empty(indptr.size - 1, np.int32)
    t, h = np.empty((6, 3)), np.empty(4)
    for i in range(indptr.size - 1):
        _mark(indptr, indices, i, slot)
        for e in range(start[i], start[i + 1]):
            cell, a = touching[e] // 10, touching[e] % 10
            c, g = stiffness[which[cell]], gradients[cell]
            less = 1.0 if a < 4 else 0.0
            for k in range(1 if a < 4 else 2):
                corner, linear = (first[a], second[a]) if k == 0 else (second[a], first[a])
                _times_gradient(c, g[corner], scale[cell], t)
                for d in range(4):
                    h[d] = 0.8 - less
                h[linear] += 0.8
                for b in range(10):
                    j = cells[cell, b]
                    if j < i:
                        continue
                    p, q = first[b], second[b]
                    if b < 4:
                        w = h[p] + less - 1.0
                        x, y, z = w * g[p, 0], w * g[p, 1], w * g[p, 2]
                    else:
                        x = h[q] * g[p, 0] + h[p] * g[q, 0]
                        y = h[q] * g[p, 1] + h[p] * g[q, 1]
                        z = h[q] * g[p, 2] + h[p] * g[q, 2]
                    s = slot[j]
                    for r in range(3):
                        u, v, w = _against(t, r, x, y, z)
                        data[s, r, 0] += u
                        data[s, r, 1] += v
                        data[s, r, 2] += w
        _mirror(indptr, indices, i, diagonal, data)


_BATCH = 4096
"""Curved cells whose matrices are formed at once."""
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
        Linear, or quadratic with sides that may be curved.
    stiffness : (6, 6) or (m, 6, 6) array, MPa
        Symmetric, in the global frame, for all cells or for each.
    density : (m,) array, optional
        Factor on the stiffness of each cell.
    where : Pattern, optional
        From `pattern`, if already known.

    Returns
    -------
    bsr_array (3n, 3n) with 3x3 blocks, N/mm
        Its columns are sorted and its ``indptr`` and ``indices`` are those of the pattern.
    """
    where = pattern(mesh) if where is None else where
    stiffness = seen_only(np.asarray(stiffness, dtype=np.float64)).reshape(-1, 6, 6)
    if len(stiffness) not in (1, len(mesh.cells)):
        raise ValueError(
            f"stiffness must have shape (6, 6) or ({len(mesh.cells)}, 6, 6); got "
            f"{len(stiffness)} matrices: give one a cell"
        )
    which = where.order if len(stiffness) > 1 else np.zeros_like(where.order)
    cells = mesh.cells[where.order]
    gradients, scale = np.empty((len(cells), 4, 3)), np.empty(len(cells))
    _gradients(mesh.points, seen_only(cells), gradients, scale)
    if density is not None:
        scale *= density[where.order]
    data = np.zeros((len(where.indices), 3, 3))
    sparse_rows = (where.indptr, where.indices, where.start, where.touching)
    arguments = (sparse_rows, cells, seen_only(which), gradients, scale, stiffness)
    if mesh.order == 1:
        _gather_linear(*arguments, data)
    else:
        _gather_quadratic(*arguments, (_FIRST, _SECOND), data)
    n = 3 * len(mesh.points)
    matrix = sp.bsr_array((data, where.indices, where.indptr), shape=(n, n))
    # Cells with curved sides: the difference from their straight ones, by quadrature.
    for start in range(0, len(mesh.curved), _BATCH):
        rows = mesh.curved[start : start + _BATCH]
        nodes = mesh.points[mesh.cells[rows]]
        law = stiffness[rows] if len(stiffness) > 1 else stiffness
        blocks = _cell_matrices(nodes, law) - _cell_matrices(straightened(nodes), law)
        if density is not None:
            blocks *= density[rows, None, None]
        add_blocks(matrix, mesh.cells[rows], blocks)
    return matrix


def _cell_matrices(nodes: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Stiffness (c, 30, 30), N/mm, of quadratic cells with nodes (c, 10, 3), by quadrature."""
    total = np.zeros((len(nodes), 30, 30))
    strain = np.zeros((len(nodes), 6, 10, 3))
    for weight, at in zip(CELL_WEIGHTS, CELL_POINTS, strict=True):
        x, y, z = np.moveaxis(gradients_at(nodes, at), 2, 0)
        # Voigt strain of a unit displacement of each node along each axis.
        strain[:, 0, :, 0], strain[:, 1, :, 1], strain[:, 2, :, 2] = x, y, z
        strain[:, 3, :, 1], strain[:, 3, :, 2] = z, y
        strain[:, 4, :, 0], strain[:, 4, :, 2] = z, x
        strain[:, 5, :, 0], strain[:, 5, :, 1] = y, x
        b = strain.reshape(len(nodes), 6, 30)
        volume = weight / 6.0 * jacobians(nodes, at)
        total += volume[:, None, None] * (np.swapaxes(b, 1, 2) @ (stiffness @ b))
    return total


@compiled
def _scatter(
    indptr: Int32Array, indices: Int32Array, nodes: IntArray, blocks: FloatArray, data: FloatArray
) -> None:
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
    _scatter(
        matrix.indptr, matrix.indices, seen_only(nodes), np.ascontiguousarray(blocks), matrix.data
    )
