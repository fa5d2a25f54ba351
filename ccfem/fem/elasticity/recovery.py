"""Stress from displacement: in the cells, and averaged at the nodes."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.tensor import from_voigt
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import EDGES, NODES, gradients_at
from ccfem.fem.elasticity.assembly import cell_gradients


def voigt_strain(gradient: FloatArray) -> FloatArray:
    """Voigt strain (..., 6) of displacement gradients (..., 3, 3) with entries du_p / dx_r."""
    g = gradient
    return np.stack(
        [
            g[..., 0, 0],
            g[..., 1, 1],
            g[..., 2, 2],
            g[..., 1, 2] + g[..., 2, 1],
            g[..., 0, 2] + g[..., 2, 0],
            g[..., 0, 1] + g[..., 1, 0],
        ],
        axis=-1,
    )


def times(stiffness: FloatArray, strain: FloatArray) -> FloatArray:
    """Stress (m, ..., 6) of strain (m, ..., 6) with one stiffness or one per cell."""
    if stiffness.ndim == 2:
        return strain @ stiffness.T
    return (strain.reshape(len(strain), -1, 6) @ stiffness.transpose(0, 2, 1)).reshape(strain.shape)


def shape_gradients(gradients: FloatArray, at: FloatArray, edges: IntArray) -> FloatArray:
    """Gradients (m, 10, 3) of the quadratic shape functions at barycentric coordinates (4,)."""
    corner = (4.0 * at - 1.0)[:, None] * gradients
    i, j = edges.T
    middle = 4.0 * (at[j][:, None] * gradients[:, i] + at[i][:, None] * gradients[:, j])
    return np.concatenate([corner, middle], axis=1)


def slopes_at(mesh: TetMesh, gradients: FloatArray, at: FloatArray) -> FloatArray:
    """Gradients (m, 10, 3) of the shape functions of all cells, those with curved sides too."""
    result = shape_gradients(gradients, at, mesh.edges)
    result[mesh.curved] = gradients_at(mesh.points[mesh.cells[mesh.curved]], at)
    return result


def cell_strain(mesh: TetMesh, displacement: FloatArray) -> FloatArray:
    """Voigt strain (m, 6) with engineering shear, at the centroid of each cell."""
    gradients = cell_gradients(mesh)
    if mesh.order == 2:
        gradients = slopes_at(mesh, gradients, np.full(4, 0.25))
    return voigt_strain(displacement[mesh.cells].transpose(0, 2, 1) @ gradients)


def strain_at_nodes(mesh: TetMesh, displacement: FloatArray) -> FloatArray:
    """Voigt strain (m, q, 6) of each cell at its own nodes (q = 4, or 10 on quadratic cells)."""
    if mesh.order == 1:
        return np.repeat(cell_strain(mesh, displacement)[:, None], 4, axis=1)
    gradients, i, j = cell_gradients(mesh), *mesh.edges.T
    # In cells with straight sides it is linear: at the middle of a side it is the mean of its ends.
    along = _FROM_CORNERS @ displacement[mesh.cells]
    along = along.reshape(-1, 4, 4, 3).swapaxes(2, 3) @ gradients[:, None]
    corners = voigt_strain(along)
    result = np.concatenate([corners, 0.5 * (corners[:, i] + corners[:, j])], axis=1)
    if len(mesh.curved):
        cells = mesh.cells[mesh.curved]
        u = displacement[cells].transpose(0, 2, 1)
        curved = [voigt_strain(u @ gradients_at(mesh.points[cells], at)) for at in NODES]
        result[mesh.curved] = np.stack(curved, axis=1)
    return result


def _slopes_from_corners() -> FloatArray:
    """Slopes (16, 10) of the quadratic shape functions along each barycentric coordinate.

    Four rows for each corner in turn: ``3 u_a`` along its own, ``4 u_ab - u_b`` along others.
    """
    result = np.zeros((4, 4, 10))
    for k, (a, b) in enumerate(EDGES.tolist()):
        result[a, b, 4 + k] = result[b, a, 4 + k] = 4.0
    for a in range(4):
        result[:, a, a] = -1.0
        result[a, a, a] = 3.0
    return result.reshape(16, 10)


_FROM_CORNERS = _slopes_from_corners()


def cell_stress(
    mesh: TetMesh, displacement: FloatArray, stiffness: FloatArray, free: FloatArray | None = None
) -> FloatArray:
    """Stress of each cell, at its centroid: (m, 3, 3) MPa.

    `free` (m, 4, 6), Voigt, is a strain without stress at the corners, such as thermal strain.
    """
    strain = cell_strain(mesh, displacement)
    return from_voigt(times(stiffness, strain if free is None else strain - free.mean(axis=1)))


def nodal_stress(
    mesh: TetMesh, displacement: FloatArray, stiffness: FloatArray, free: FloatArray | None = None
) -> FloatArray:
    """Stress (n, 3, 3), MPa, at the nodes: volume-weighted average over the cells round each node.

    In quadratic cells the stress of a cell is taken at the node itself. It is zero at nodes without
    a cell.
    """
    m, q = mesh.cells.shape
    if mesh.order == 1:
        strain = cell_strain(mesh, displacement)
        stress = times(stiffness, strain if free is None else strain - free.mean(axis=1))
        entries = np.repeat(np.arange(m), q)
    else:
        strain = strain_at_nodes(mesh, displacement)
        stress = times(stiffness, strain if free is None else strain - NODES @ free)
        stress = stress.reshape(-1, 6)
        entries = np.arange(m * q)
    weights = np.repeat(mesh.volumes, q)
    nodes, n = mesh.cells.reshape(-1), len(mesh.points)
    average = sp.csc_array(sp.coo_array((weights, (nodes, entries)), shape=(n, len(stress))))
    total = np.bincount(nodes, weights, n)
    return from_voigt((average @ stress) / np.where(total > 0.0, total, 1.0)[:, None])
