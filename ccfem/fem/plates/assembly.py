"""Stiffness matrix of plane cells: triangles of constant strain, quadrilaterals with 2x2 Gauss."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.fem.elasticity.assembly import Pattern, pattern
from ccfem.fem.plates.mesh import PlaneMesh

_GAUSS = 1.0 / np.sqrt(3.0)
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Components of a symmetric (3, 3) matrix, each once."""


def _shape_gradients(points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients (c, q, 2) of the shape functions of cells (c, q, 2), and Jacobians (c,)."""
    if points.shape[1] == 3:
        local = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    else:
        local = 0.25 * _CORNERS * (1.0 + (_CORNERS * at)[:, ::-1])
    jacobian = np.swapaxes(points, 1, 2) @ local  # dx_i / dxi_j
    a, b, c, d = jacobian.reshape(-1, 4).T
    determinant = a * d - b * c
    inverse = np.stack([d, -b, -c, a], axis=1).reshape(-1, 2, 2) / determinant[:, None, None]
    return local @ inverse, determinant


def _strain_matrices(points: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Strain of nodal displacements at one local point (2,) in [-1, 1] of each cell (c, q, 2).

    Matrices B (c, 3, 2q), 1/mm, with ``[e11, e22, 2 e12] = B @ [u0, v0, u1, v1, ...]``, and the
    area per local area (c,), mm^2; the local triangle has area 1/2, the local square 4.
    """
    gradient, determinant = _shape_gradients(points, at)
    count, q, _ = gradient.shape
    matrix = np.zeros((count, 3, q, 2))
    matrix[:, 0, :, 0] = matrix[:, 2, :, 1] = gradient[:, :, 0]
    matrix[:, 1, :, 1] = matrix[:, 2, :, 0] = gradient[:, :, 1]
    return matrix.reshape(count, 3, 2 * q), determinant


@dataclass(frozen=True)
class PlaneElements:
    """All that the stiffness matrices of one plane mesh share.

    Attributes
    ----------
    mesh : PlaneMesh
    """

    mesh: PlaneMesh

    @cached_property
    def where(self) -> Pattern:
        """Pattern of the stiffness matrix."""
        return pattern(self.mesh)

    @cached_property
    def _slots(self) -> IntArray:
        """Block of the matrix that each pair of corners of each cell belongs to, (m * q * q,)."""
        n, where, cells = len(self.mesh.points), self.where, self.mesh.cells
        known = np.repeat(np.arange(n), np.diff(where.indptr)) * n + where.indices
        wanted = cells[:, :, None] * n + cells[:, None, :]
        return read_only(np.searchsorted(known, wanted.reshape(-1)), np.int64)

    @cached_property
    def shapes(self) -> FloatArray:
        """Corners of the cells that differ: (1, q, 2) where all are congruent, else (m, q, 2)."""
        corners = self.mesh.points[self.mesh.cells]
        return corners[:1] - corners[:1, :1] if self.mesh.congruent else corners

    @cached_property
    def gauss(self) -> list[tuple[FloatArray, FloatArray]]:
        """Strain matrices (c, 3, 2q) and weights (c,), mm^2, of every Gauss point."""
        if self.mesh.cells.shape[1] == 3:
            matrix, jacobian = _strain_matrices(self.shapes, np.zeros(2))
            return [(matrix, 0.5 * jacobian)]
        return [_strain_matrices(self.shapes, _GAUSS * corner) for corner in _CORNERS]

    @cached_property
    def _constant(self) -> FloatArray:
        """Element matrices (6, 4 q^2) of unit stiffness components, where cells are congruent."""
        result = np.zeros((6, *2 * (2 * self.mesh.cells.shape[1],)))
        for matrix, weight in self.gauss:
            for k, (i, j) in enumerate(_PAIRS):
                product = weight[0] * np.outer(matrix[0, i], matrix[0, j])
                result[k] += product if i == j else product + product.T
        return result.reshape(6, -1)

    def matrices(self, stiffness: FloatArray) -> FloatArray:
        """Element matrices for a thickness of 1 mm.

        Parameters
        ----------
        stiffness : (c, 3, 3) array, MPa
            Symmetric; of each cell, or of any number where the cells are congruent.

        Returns
        -------
        (c, 2q, 2q) array, N/mm per mm
        """
        size = 2 * self.mesh.cells.shape[1]
        if self.mesh.congruent:
            rows, columns = np.array(_PAIRS).T
            # Without the threads of a BLAS, which cost more than they save here.
            own = np.einsum("ck,kl->cl", stiffness[:, rows, columns], self._constant)
            return own.reshape(-1, size, size)
        result = np.zeros((len(stiffness), size, size))
        for matrix, weight in self.gauss:
            result += np.swapaxes(matrix, 1, 2) @ ((weight[:, None, None] * stiffness) @ matrix)
        return result

    def assemble(self, matrices: FloatArray) -> sp.bsr_array:
        """Sum element matrices (m, 2q, 2q), N/mm, to the (2n, 2n) matrix with 2x2 blocks.

        Its columns are sorted; ``indptr`` and ``indices`` are those of the pattern.
        """
        blocks = len(self.where.indices)
        data = np.empty((blocks, 2, 2))
        for i in range(2):
            for j in range(2):
                entries = matrices[:, i::2, j::2].reshape(-1)
                data[:, i, j] = np.bincount(self._slots, entries, blocks)
        n = 2 * len(self.mesh.points)
        return sp.bsr_array((data, self.where.indices, self.where.indptr), shape=(n, n))

    def cell_displacement(self, displacement: FloatArray) -> FloatArray:
        """Displacement (n, 2) of the corners of each cell, (m, 2q)."""
        return displacement[self.mesh.cells].reshape(len(self.mesh.cells), -1)

    def centre_strain(self, displacement: FloatArray) -> FloatArray:
        """Strain [e11, e22, 2 e12] at the centre of each cell, (m, 3)."""
        matrix, _ = _strain_matrices(self.shapes, np.zeros(2))
        return np.einsum(
            "...ij,...j->...i",
            matrix[0] if self.mesh.congruent else matrix,
            self.cell_displacement(displacement),
        )
