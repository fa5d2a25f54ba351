"""Springs and elastic beds: their stiffness, and the directions they hold."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.fem.elasticity.assembly import add_blocks
from ccfem.fem.elasticity.body import LoadedBody, SupportedProblem
from ccfem.fem.elasticity.nodes import facet_normals, nearest_node, patch_facets, patch_nodes
from ccfem.fem.elasticity.support_kinds import Foundation, PointSpring, Spring

Soft = Spring | PointSpring | Foundation

_LINEAR = (np.ones((3, 3)) + np.eye(3)) / 12.0
_QUADRATIC = (
    np.array(
        [
            [6, -1, -1, 0, -4, 0],
            [-1, 6, -1, 0, 0, -4],
            [-1, -1, 6, -4, 0, 0],
            [0, 0, -4, 32, 16, 16],
            [-4, 0, 0, 16, 32, 16],
            [0, -4, 0, 16, 16, 32],
        ]
    )
    / 180.0
)
"""Integrals of the products of the shape functions over a facet of unit area."""


def soft_supports(problem: SupportedProblem) -> tuple[Soft, ...]:
    """Supports of a problem that are elastic."""
    return tuple(s for s in problem.supports if isinstance(s, Spring | PointSpring | Foundation))


def soft_holds(
    mesh: CellMesh, surface: LoadedBody, support: Soft
) -> list[tuple[IntArray, FloatArray]]:
    """Nodes (k,) and directions (k, 3) that a soft support holds against rigid motions."""
    if isinstance(support, Foundation):
        # At the corners of each facet, since directions differ between them on a curved patch.
        facets = patch_facets(surface, support.patch)
        across = _normal_frames(
            facet_normals(surface, facets, surface.points[facets]).reshape(-1, 3)
        )
        chosen = [across[:, 0]] if support.normal > 0.0 else []
        chosen += [across[:, 1], across[:, 2]] if support.tangential > 0.0 else []
        return [(facets.reshape(-1), held) for held in chosen]
    if isinstance(support, Spring):
        nodes = patch_nodes(mesh, support.patch)
    else:
        nodes = np.array([nearest_node(mesh, support.point, "a spring")])
    axes = [np.eye(3)[k] for k in range(3) if support.stiffness[k] > 0.0]
    return [(nodes, np.tile(axis, (len(nodes), 1))) for axis in axes]


def add_springs(matrix: sp.bsr_array, mesh: LoadedBody, supports: tuple[Soft, ...]) -> None:
    """Add the stiffness of springs and beds, N/mm, to a stiffness matrix (3n, 3n), in place."""
    for support in supports:
        add_blocks(matrix, *_elements(mesh, support))


def spring_forces(
    mesh: LoadedBody, supports: tuple[Soft, ...], displacement: FloatArray
) -> FloatArray:
    """Find the forces (n, 3), N, of springs and beds on the part displaced by (n, 3), mm."""
    result = np.zeros_like(displacement)
    for support in supports:
        nodes, blocks = _elements(mesh, support)
        move = displacement[nodes].reshape(len(nodes), -1)
        forces = np.einsum("kij,kj->ki", blocks, move).reshape(*nodes.shape, 3)
        np.subtract.at(result, nodes, forces)
    return result


def _elements(mesh: LoadedBody, support: Soft) -> tuple[IntArray, FloatArray]:
    """Nodes (k, q) and element matrices (k, 3q, 3q), N/mm, of a soft support."""
    if isinstance(support, PointSpring):
        node = nearest_node(mesh, support.point, "a spring")
        return np.array([[node]]), np.diag(support.stiffness)[None]
    facets = patch_facets(mesh, support.patch)
    area, _ = mesh.facet_areas(facets)
    nodes = mesh.facet_nodes(facets)
    shapes = _LINEAR if nodes.shape[1] == 3 else _QUADRATIC
    if isinstance(support, Spring):
        bed = np.diag(support.stiffness) / area.sum()
        blocks = np.einsum("k,ab,ij->kaibj", area, shapes, bed)
    else:
        # Across and along the bed at each node, interpolated between them.
        normal = facet_normals(mesh, facets, mesh.points[nodes])
        along = np.eye(3) - normal[..., :, None] * normal[..., None, :]
        bed = support.normal * np.einsum("kai,kbj->kabij", normal, normal)
        bed += support.tangential * np.einsum("kail,kblj->kabij", along, along)
        blocks = np.einsum("k,ab,kabij->kaibj", area, shapes, bed)
    return nodes, blocks.reshape(len(nodes), 3 * nodes.shape[1], -1)


def _normal_frames(normal: FloatArray) -> FloatArray:
    """Orthonormal rows (k, 3, 3), the first along a normal (k, 3)."""
    return np.asarray(np.linalg.svd(normal[:, None])[2])
