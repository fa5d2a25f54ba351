"""Quadratic energies of a scalar field on linear tetrahedra, as sparse matrices over its nodes."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.geometry.facets import signed_volumes

_NEAREST = 0.3
"""Least distance between the centres of neighbouring cells that is used, in cube roots of the mean
volume (half a mean edge): flat cells would otherwise outweigh all others."""


def _assemble(blocks: FloatArray, nodes: IntArray, n: int) -> sp.csr_array:
    """Sum of blocks (b, k, k) over the nodes (b, k) that they stand for."""
    k = nodes.shape[1]
    rows, columns = np.repeat(nodes, k, axis=1).ravel(), np.tile(nodes, (1, k)).ravel()
    return sp.coo_array((blocks.ravel(), (rows, columns)), shape=(n, n)).tocsr()


def alignment_energy(
    gradients: FloatArray, cells: IntArray, direction: FloatArray, weight: FloatArray, n: int
) -> sp.csr_array:
    """Matrix of ``sum_e weight_e (grad G . direction_e)^2`` (Fang et al. 2024, eq. 1).

    Parameters
    ----------
    gradients : (m, 4, 3) array, 1/mm
        Of the barycentric coordinates.
    cells : (m, 4) int array
    direction : (m, 3) array
    weight : (m,) array
        Volume times importance.
    n : int
        Number of nodes.
    """
    used = np.flatnonzero(weight > 0.0)
    along = np.einsum("eid,ed->ei", gradients[used], direction[used])
    blocks = weight[used, None, None] * along[:, :, None] * along[:, None, :]
    return _assemble(blocks, cells[used], n)


def gradient_energy(
    gradients: FloatArray, cells: IntArray, weight: FloatArray, n: int
) -> sp.csr_array:
    """Matrix of ``sum_e weight_e |grad G|^2``; parameters as in `alignment_energy`."""
    used = np.flatnonzero(weight > 0.0)
    g = gradients[used]
    return _assemble(weight[used, None, None] * (g @ g.transpose(0, 2, 1)), cells[used], n)


def gradient_source(
    gradients: FloatArray, cells: IntArray, vector: FloatArray, weight: FloatArray, n: int
) -> FloatArray:
    """Vector (n,) of the linear form ``sum_e weight_e grad G . vector``."""
    used = np.flatnonzero(weight > 0.0)
    values = weight[used, None] * (gradients[used] @ vector)
    return np.bincount(cells[used].ravel(), values.ravel(), minlength=n).astype(np.float64)


def smoothness_energy(
    points: FloatArray,
    gradients: FloatArray,
    cells: IntArray,
    faces: IntArray,
    across: IntArray,
    n: int,
) -> sp.csr_array:
    """Matrix of ``sum_f A_f / h_f |grad G - grad' G|^2`` (eq. 2), over the faces between cells.

    With h_f, the distance of the centres, it approximates the integral of the squared second
    derivatives times a length squared, independent of the mesh.

    Parameters
    ----------
    points : (p, 3) array, mm
    gradients : (m, 4, 3) array, 1/mm
    cells : (m, 4) int array
    faces : (4, 3) int array
        Corners of the face opposite to each corner.
    across : (m, 4) int array
        Cell across that face; -1 where there is none.
    n : int
        Number of nodes.
    """
    first, second, area, apart = faces_between(points, cells, faces, across)
    size = np.linalg.norm(area, axis=1)
    normal = area / np.maximum(size, 1e-300)[:, None]
    weight = np.sqrt(size / apart)
    nodes, jump = _jumps(cells, gradients, first, second, normal, weight)
    return _assemble(jump[:, :, None] * jump[:, None, :], nodes, n)


def faces_between(
    points: FloatArray, cells: IntArray, faces: IntArray, across: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Find both cells of each inner face, its area vector (f, 3), and the distance of the cells.

    Parameters as in `smoothness_energy`. The distance (f,), mm, is that of the centres, but at
    least that of `_NEAREST`.
    """
    first, side = np.nonzero(across > np.arange(len(cells))[:, None])
    second = across[first, side]
    corners = points[cells[first[:, None], faces[side]]]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = points[cells].mean(axis=1)
    apart = np.linalg.norm(centre[first] - centre[second], axis=1)
    least = _NEAREST * float(np.cbrt(np.abs(signed_volumes(points, cells)).mean()))
    return first, second, area, np.maximum(apart, least)


@compiled
def _jumps(
    cells: IntArray,
    gradients: FloatArray,
    first: IntArray,
    second: IntArray,
    normal: FloatArray,
    weight: FloatArray,
) -> tuple[IntArray, FloatArray]:
    """Weighted jump of the gradient across each face as a form of its five nodes (f, 5).

    Both gradients are equal along the face, so the jump is normal to it.
    """
    nodes = np.empty((len(first), 5), np.int64)
    jump = np.zeros((len(first), 5))
    for f in range(len(first)):
        a, b = first[f], second[f]
        for i in range(4):
            nodes[f, i] = cells[a, i]
            for d in range(3):
                jump[f, i] += weight[f] * gradients[a, i, d] * normal[f, d]
        for j in range(4):
            at = 4
            for i in range(4):
                if cells[a, i] == cells[b, j]:
                    at = i
            if at == 4:
                nodes[f, 4] = cells[b, j]
            for d in range(3):
                jump[f, at] -= weight[f] * gradients[b, j, d] * normal[f, d]
    return nodes, jump
