"""What loads and supports act on: nodes of patches, of edges where they meet, near points."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, smooth_faces
from ccfem.body.mesh.tet_mesh import CellMesh
from ccfem.fem.elasticity.load_kinds import Load
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.geometry.facets import positions

# Protocols of the bodies and problems that loads and supports act on, in space or in the plane.


class LoadedBody(Protocol):
    """A mesh whose boundary facets have areas and outward normals, so that loads act on it."""

    @property
    def points(self) -> FloatArray:
        """Nodes, (n, d), mm."""
        ...

    @property
    def cells(self) -> IntArray:
        """Nodes of each cell, (m, q)."""
        ...

    def patch(self, name: str) -> IntArray:
        """Facets of a named patch that can carry a load."""
        ...

    def facet_nodes(self, facets: IntArray) -> IntArray:
        """All nodes of facets: their corners, and the middles of their sides."""
        ...

    @property
    def boundary(self) -> IntArray:
        """Boundary facets by their corners, the part on their inner side."""
        ...

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas, mm^2, and unit normals of facets."""
        ...


class SupportedProblem(Protocol):
    """A problem as seen by supports and loads."""

    @property
    def mesh(self) -> CellMesh:
        """The mesh that supports act on."""
        ...

    @property
    def body(self) -> LoadedBody:
        """The body that loads act on."""
        ...

    @property
    def supports(self) -> tuple[AnySupport, ...]:
        """The supports."""
        ...

    @property
    def loads(self) -> Mapping[str, tuple[Load, ...]]:
        """Loads of each load case by its name."""
        ...


FACET_PRODUCTS = {
    3: (np.ones((3, 3)) + np.eye(3)) / 12.0,
    6: np.array(
        [
            [6, -1, -1, 0, -4, 0],
            [-1, 6, -1, 0, 0, -4],
            [-1, -1, 6, -4, 0, 0],
            [0, 0, -4, 32, 16, 16],
            [-4, 0, 0, 16, 32, 16],
            [0, -4, 0, 16, 16, 32],
        ]
    )
    / 180.0,
}
"""Integrals of the products of the shape functions over a facet of unit area, by its nodes."""
_SAME = 1e-9
"""Distance of two places over the size of the part that counts as none."""
_COARSE = 50.0
"""Feature angle, degrees, at which a bore of 8 facets is a round wall, and a hexagon is none."""


def patch_facets(mesh: CellMesh | LoadedBody, name: str) -> IntArray:
    """Facets of a patch, which must not be empty."""
    facets = mesh.patch(name)
    if not len(facets):
        raise InputError(
            f"patch '{name}' is empty: no boundary facet is in it, as of a group inside the "
            "part: choose one of its outside"
        )
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


def nearest_nodes(
    mesh: CellMesh | LoadedBody, points: Sequence[Sequence[float]], what: str
) -> IntArray:
    """Nodes (k,) of some cells that are nearest to points (k, 3) of the part.

    Raises
    ------
    InputError
        When a point is farther from it than the cells there are long, that is outside the part, or
        when two nodes lie there, as on both sides of a slit.
    """
    used = np.unique(mesh.cells)
    wanted = np.asarray(points, dtype=np.float64)[:, : mesh.points.shape[1]]
    tree = cKDTree(mesh.points[used])
    distance, at = tree.query(wanted)
    size = float(np.linalg.norm(np.ptp(mesh.points[used], axis=0)))
    nodes = used[at]
    for k in np.flatnonzero(~(distance <= _SAME * size)).tolist():
        node = nodes[k]
        near = mesh.cells[(mesh.cells == node).any(axis=1)]
        reach = float(np.linalg.norm(mesh.points[near] - mesh.points[node], axis=2).max())
        if not distance[k] <= reach:
            place = ", ".join(f"{x:.4g}" for x in mesh.points[node])
            raise InputError(
                f"{what} at {tuple(float(x) for x in points[k])} mm lies {distance[k]:.4g} mm from "
                f"the nearest node, ({place}), where cells are {reach:.4g} mm long: give a point "
                "of the part"
            )
    several = tree.query_ball_point(mesh.points[nodes], _SAME * size, return_length=True) > 1
    if several.any():
        place = ", ".join(f"{x:.4g}" for x in mesh.points[nodes[several.argmax()]])
        raise InputError(
            f"{what} acts at ({place}) mm, where two nodes lie, as on both sides of a slit: merge "
            "them (merge_nodes = true), or take another point"
        )
    return nodes


def nearest_node(mesh: CellMesh | LoadedBody, point: Sequence[float], what: str) -> int:
    """Node of some cell that is nearest to a point of the part: see `nearest_nodes`."""
    return int(nearest_nodes(mesh, [point], what)[0])


def facet_normals(mesh: LoadedBody, facets: IntArray, places: FloatArray) -> FloatArray:
    """Outward unit normals (k, q, 3) of facets (k, 3) at places on them (k, q, 3), mm.

    On round walls they are those of the wall, be the patch ever so small a part of it: the normals
    of its facets are off by degrees, which holds a part against turning on a bore. Elsewhere those
    of the facets.
    """
    _, normal = mesh.facet_areas(facets)
    result = np.repeat(normal[:, None], places.shape[1], axis=1)
    rows = np.arange(len(facets))
    if isinstance(mesh, TetMesh):
        at = positions(facets, mesh.boundary)
        wall = np.where(at >= 0, mesh.wall_of[at], -1)
        for k in np.unique(wall[wall >= 0]).tolist():
            on_wall = wall == k
            normals = mesh.round_walls[k].normals_at(places[on_wall].reshape(-1, 3))
            result[on_wall] = normals.reshape(-1, *result.shape[1:])
        rows = np.flatnonzero(wall < 0)
    # Faces that are cylinders or cones within rounding have normals of their own: first those of
    # few facets, whose edges are blunt, then the rest by the usual angle.
    for angle in (_COARSE, FEATURE_ANGLE):
        flat = []
        for face in smooth_faces(mesh.points, facets[rows], angle):
            chosen = rows[face.facets]
            exact = face.normals_at(places[chosen].reshape(-1, 3))
            if exact is None:
                flat.append(chosen)
            else:
                result[chosen] = exact.reshape(-1, *result.shape[1:])
        rows = np.concatenate([*flat, np.zeros(0, dtype=np.int64)])
    return result


def patch_normals(mesh: LoadedBody, facets: IntArray, nodes: IntArray) -> FloatArray:
    """Average unit normals (k, 3) at nodes of facets, weighted by the areas of the facets."""
    area, _ = mesh.facet_areas(facets)
    all_nodes = mesh.facet_nodes(facets)
    weighted = area[:, None, None] * facet_normals(mesh, facets, mesh.points[all_nodes])
    total = np.zeros(mesh.points.shape)
    np.add.at(total, all_nodes, weighted)
    size = np.linalg.norm(total[nodes], axis=1)
    return total[nodes] / np.maximum(size, 1e-300)[:, None]
