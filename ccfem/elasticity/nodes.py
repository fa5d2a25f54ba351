"""Nodes of patches, of the edges where they meet, and nearest to points."""

from collections.abc import Sequence

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.elasticity.body import LoadedBody
from ccfem.errors import InputError
from ccfem.mesh.cell_mesh import CellMesh

__all__ = ["edge_nodes", "nearest_node", "patch_facets", "patch_nodes", "patch_normals"]


def patch_facets(mesh: CellMesh | LoadedBody, name: str) -> IntArray:
    """Facets of a patch, which must not be empty."""
    facets = mesh.patch(name)
    if not len(facets):
        raise InputError(f"patch '{name}' is empty: no boundary facet matches its rule")
    return facets


def patch_nodes(mesh: CellMesh, name: str) -> IntArray:
    """Nodes (k,) of a patch, ascending."""
    return np.unique(mesh.facet_nodes(patch_facets(mesh, name)))


def edge_nodes(mesh: CellMesh, names: tuple[str, str]) -> IntArray:
    """Nodes (k,) that two patches have in common."""
    first, second = (patch_nodes(mesh, name) for name in names)
    common = np.intersect1d(first, second)
    if not len(common):
        raise InputError(
            f"patches '{names[0]}' and '{names[1]}' do not meet: name two with a common edge"
        )
    return common


def nearest_node(mesh: CellMesh | LoadedBody, point: Sequence[float], what: str) -> int:
    """Node of some cell that is nearest to a point of the part.

    Raises
    ------
    InputError
        When the point is farther from it than the cells there are long, that is outside the part.
    """
    used = np.unique(mesh.cells)
    wanted = np.asarray(point, dtype=np.float64)[: mesh.points.shape[1]]
    distance = np.linalg.norm(mesh.points[used] - wanted, axis=1)
    node = int(used[distance.argmin()])
    near = mesh.cells[(mesh.cells == node).any(axis=1)]
    reach = float(np.linalg.norm(mesh.points[near] - mesh.points[node], axis=2).max())
    if not distance.min() <= reach:
        at = ", ".join(f"{x:.4g}" for x in mesh.points[node])
        raise InputError(
            f"{what} at {tuple(float(x) for x in point)} mm lies {distance.min():.4g} mm from the "
            f"nearest node, ({at}), where cells are {reach:.4g} mm long: give a point of the part"
        )
    return node


def patch_normals(mesh: LoadedBody, facets: IntArray, nodes: IntArray) -> FloatArray:
    """Average unit normals (k, 3) at nodes of facets, weighted by the areas of the facets."""
    area, normal = mesh.facet_areas(facets)
    all_nodes = mesh.facet_nodes(facets)
    total = np.zeros(mesh.points.shape)
    for column in all_nodes.T:
        np.add.at(total, column, area[:, None] * normal)
    found = total[nodes]
    size = np.linalg.norm(found, axis=1)
    return found / np.maximum(size, 1e-300)[:, None]
