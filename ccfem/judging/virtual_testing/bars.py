"""Fibres as axial bars inside the cells: their strain, and the stiffness that they add.

A piece of length l along t adds the energy ``EA l (m . strain)^2 / 2`` with ``m = (tx^2, ty^2,
tz^2, ty tz, tx tz, tx ty)`` on Voigt strain with engineering shear. With ``b = B^T m`` that is
the element matrix ``EA l b b^T``. In a linear cell the constant stiffness ``EA l m m^T / V`` gives
the very same matrix. In a quadratic cell b is taken at the middle of the piece. No matrix is
assembled: the set of carrying pieces changes from solve to solve, and products with b and its
transpose are cheap.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray, Int32Array, IntArray, freeze
from ccfem.body.mesh.curved_cells import gradients_at
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.judging.virtual_testing.strands import Strands


def bar_stiffness(
    strands: Strands, volumes: FloatArray, share: FloatArray | None = None
) -> FloatArray:
    """Stiffness that strands with the axial stiffness EA = 1 N add to each cell.

    Parameters
    ----------
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
def _add_bars(
    cell: IntArray, weight: FloatArray, tangent: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
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


@dataclass(frozen=True)
class Bars:
    """Pieces of fibre as axial bars, ready to be applied to displacements.

    Attributes
    ----------
    nodes : (s, q) int array
        Nodes of the cell of each piece.
    slope : (s, q) array, 1/mm
        Slopes of its shape functions along the piece.
    tangent : (s, 3) array
    length : (s,) array, mm
    """

    nodes: IntArray
    slope: FloatArray
    tangent: FloatArray
    length: FloatArray

    def __post_init__(self) -> None:
        freeze(self, nodes=np.int32, slope=float, tangent=float, length=float)

    def strain(self, displacement: FloatArray) -> FloatArray:
        """Strain (s,) along the pieces, at their middles, of a displacement (n, 3), mm."""
        result = np.empty(len(self.length))
        u = _seen(displacement)
        _strain(self.nodes, self.slope, self.tangent, u, result)
        return result

    def forces(self, stiffness: FloatArray, displacement: FloatArray) -> FloatArray:
        """Return the forces (n, 3), N, that hold the pieces in a displacement (n, 3), mm.

        Parameters
        ----------
        stiffness : (s,) array, N
            EA of each piece; those of zero stiffness cost nothing.
        displacement : (n, 3) array, mm
        """
        u = _seen(displacement)
        result = np.zeros(u.shape)
        _bar_forces(self.nodes, self.slope, self.tangent, stiffness * self.length, u, result)
        return result


def _seen(displacement: FloatArray) -> FloatArray:
    """Read-only view: loops are then compiled for one kind of array only."""
    view = np.ascontiguousarray(displacement, dtype=np.float64).view()
    view.flags.writeable = False
    return view


# One loop each, without slices, which would double the time.
@njit(cache=True)
def _strain(
    nodes: Int32Array, slope: FloatArray, tangent: FloatArray, u: FloatArray, result: FloatArray
) -> None:  # pragma: no cover
    for s in range(len(nodes)):
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        total = 0.0
        for a in range(nodes.shape[1]):
            i = nodes[s, a]
            total += slope[s, a] * (x * u[i, 0] + y * u[i, 1] + z * u[i, 2])
        result[s] = total


@njit(cache=True)
def _bar_forces(
    nodes: Int32Array,
    slope: FloatArray,
    tangent: FloatArray,
    weight: FloatArray,
    u: FloatArray,
    result: FloatArray,
) -> None:  # pragma: no cover
    for s in range(len(nodes)):
        if weight[s] == 0.0:
            continue
        x, y, z = tangent[s, 0], tangent[s, 1], tangent[s, 2]
        size = 0.0
        for a in range(nodes.shape[1]):
            i = nodes[s, a]
            size += slope[s, a] * (x * u[i, 0] + y * u[i, 1] + z * u[i, 2])
        size *= weight[s]
        for a in range(nodes.shape[1]):
            i, k = nodes[s, a], size * slope[s, a]
            result[i, 0] += k * x
            result[i, 1] += k * y
            result[i, 2] += k * z


def bars(strands: Strands, mesh: TetMesh) -> Bars:
    """Make the pieces of fibre in a mesh ready to be applied to displacements."""
    nodes = mesh.cells[strands.cell]
    return Bars(nodes, _slopes(strands, mesh), strands.tangent, strands.length)


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
    result = np.hstack([(4.0 * weight - 1.0) * slope, middle])
    # In the few cells with a side on a round wall the shape functions follow that.
    rows = np.flatnonzero(np.isin(strands.cell, mesh.curved))
    at = mesh.local_coordinates(strands.cell[rows], weight[rows])
    curved = gradients_at(mesh.points[mesh.cells[strands.cell[rows]]], at)
    result[rows] = np.einsum("sak,sk->sa", curved, strands.tangent[rows])
    return result
