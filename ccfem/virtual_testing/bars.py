"""Fibres as axial bars inside the cells: their strain, and the stiffness that they add.

A piece of length l along t adds the energy ``EA l (m . strain)^2 / 2`` with ``m = (tx^2, ty^2,
tz^2, ty tz, tx tz, tx ty)`` on Voigt strain with engineering shear. With ``b = B^T m`` that is
the element matrix ``EA l b b^T``. In a linear cell the constant stiffness ``EA l m m^T / V`` gives
the very same matrix, so all pieces of a cell are summed before one assembly. In a quadratic cell b
is taken at the middle of the piece.
"""

import numpy as np
import scipy.sparse as sp
from numba import njit

from ccfem.arrays import FloatArray
from ccfem.elasticity.assembly import Pattern, add_blocks, assemble, cell_gradients
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.virtual_testing.strands import Strands

__all__ = ["bar_matrix", "bar_stiffness", "strain_operator"]

_BLOCK = 4000
"""Pieces in quadratic cells that are assembled at once."""


def bar_stiffness(
    strands: Strands, volumes: FloatArray, share: FloatArray | None = None
) -> FloatArray:
    """Stiffness that strands with the axial stiffness EA = 1 N add to each cell.

    Parameters
    ----------
    strands : Strands
    volumes : (m,) array, mm^3
        Of the cells.
    share : (s,) array in [0, 1], optional
        How much of its stiffness each piece lends; default 1.

    Returns
    -------
    (m, 6, 6) array, 1/mm^2
        Multiply by EA, N, for MPa.
    """
    weight = strands.length / volumes[strands.cell]
    result = np.zeros((len(volumes), 6, 6))
    _add_bars(strands.cell, weight if share is None else weight * share, strands.tangent, result)
    return result


@njit(cache=True)
def _add_bars(cell, weight, tangent, result):  # type: ignore[no-untyped-def]  # pragma: no cover
    m = np.empty(6)
    for s in range(len(cell)):
        if weight[s] == 0.0:
            continue
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        m[0], m[1], m[2], m[3], m[4], m[5] = x * x, y * y, z * z, y * z, x * z, x * y
        c = cell[s]
        for i in range(6):
            for j in range(6):
                result[c, i, j] += weight[s] * m[i] * m[j]


def bar_matrix(
    strands: Strands, mesh: TetMesh, where: Pattern, share: FloatArray | None = None
) -> sp.bsr_array:
    """Stiffness matrix (3n, 3n) of strands with the axial stiffness EA = 1 N.

    Parameters
    ----------
    strands : Strands
    mesh : TetMesh
    where : Pattern
        Of the stiffness matrix of the mesh.
    share : (s,) array in [0, 1], optional
        How much of its stiffness each piece lends; default 1.

    Returns
    -------
    bsr_array (3n, 3n) with 3x3 blocks, 1/mm
        On the pattern; multiply by EA, N, for N/mm.
    """
    if mesh.order == 1:
        return assemble(mesh, bar_stiffness(strands, mesh.volumes, share), None, where)
    weight = strands.length if share is None else strands.length * share
    slope, tangent, nodes = _slopes(strands, mesh), strands.tangent, mesh.cells[strands.cell]
    blocks = np.zeros((len(where.indices), 3, 3))
    matrix = sp.bsr_array((blocks, where.indices, where.indptr), shape=2 * (3 * len(mesh.points),))
    for first in range(0, len(strands), _BLOCK):
        at = slice(first, first + _BLOCK)
        b = (slope[at, :, None] * tangent[at, None]).reshape(-1, 3 * slope.shape[1])
        add_blocks(matrix, nodes[at], weight[at, None, None] * b[:, :, None] * b[:, None])
    return matrix


def strain_operator(strands: Strands, mesh: TetMesh) -> sp.csr_array:
    """Operator (s, 3n), 1/mm, from the displacement to the strain of each piece.

    The strain is that along the tangent, at the middle of the piece; ``operator @ u.reshape(-1)``
    for a displacement u (n, 3), mm.
    """
    slope, nodes = _slopes(strands, mesh), mesh.cells[strands.cell]
    values = slope[:, :, None] * strands.tangent[:, None]
    columns = 3 * nodes[:, :, None] + np.arange(3)
    starts = np.arange(len(strands) + 1) * (3 * nodes.shape[1])
    shape = (len(strands), 3 * len(mesh.points))
    return sp.csr_array((values.reshape(-1), columns.reshape(-1), starts), shape=shape)


def _slopes(strands: Strands, mesh: TetMesh) -> FloatArray:
    """Slope (s, q) along each piece of the shape functions of its cell, 1/mm."""
    gradients = cell_gradients(mesh)[strands.cell]
    slope = np.einsum("sak,sk->sa", gradients, strands.tangent)
    if mesh.order == 1:
        return slope
    corner = mesh.points[mesh.corners[strands.cell, 0]]
    weight = np.einsum("sak,sk->sa", gradients, strands.middle - corner)
    weight[:, 0] += 1.0
    i, j = mesh.edges.T
    middle = 4.0 * (weight[:, i] * slope[:, j] + weight[:, j] * slope[:, i])
    return np.hstack([(4.0 * weight - 1.0) * slope, middle])
