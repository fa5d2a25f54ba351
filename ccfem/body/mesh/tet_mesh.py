"""Tetrahedral meshes with named patches."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.body.mesh.flaws import first_flaw
from ccfem.body.mesh.pairing import FREE, pair_facets
from ccfem.geometry.facets import positions, unique_edges
from ccfem.geometry.measures import signed_volumes

_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corner nodes of the face opposite to each corner, outward for a positive cell."""

_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corner nodes of the edge that carries mid-side node 4 + k (VTK order)."""


@dataclass(frozen=True, repr=False)
class TetMesh(CellMesh, Shown):
    """A tetrahedral mesh, linear (P1) or quadratic (P2), with named boundary patches.

    Attributes
    ----------
    points : (n, 3) array, mm
    cells : (m, 4) or (m, 10) int array
        Nodes of each tetrahedron, positively oriented; quadratic cells in VTK order.
    patches : mapping of name to (k, 3) int arrays
        Boundary facets by their corner nodes.
    axes : mapping of name to (3,) arrays
        Axes of round patches where the rule of the patch states one.
    """

    dimension = 3
    sizes = (4, 10)
    kinds = "linear or quadratic tetrahedra"
    edges = _EDGES
    faces = _FACES

    @property
    def order(self) -> int:
        """Polynomial order of the displacement: 1 or 2."""
        return 1 if self.cells.shape[1] == 4 else 2

    @property
    def corners(self) -> IntArray:
        """Corner nodes of each cell, (m, 4)."""
        return self.cells[:, :4]

    @cached_property
    def volumes(self) -> FloatArray:
        """Signed volume of each (straight-sided) cell, (m,), mm^3."""
        return read_only(signed_volumes(self.points, self.corners))

    @cached_property
    def aspects(self) -> FloatArray:
        """Longest edge over least height of each cell, (m,), 1.22 or more; infinite where flat."""
        corner = self.points[self.corners]
        edges = corner[:, self.edges[:, 1]] - corner[:, self.edges[:, 0]]
        longest = np.sqrt(np.einsum("ijk,ijk->ij", edges, edges).max(axis=1))
        a, b, c = np.moveaxis(corner[:, self.faces], 2, 0)
        largest = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=2).max(axis=1)
        with np.errstate(divide="ignore"):
            return read_only(longest * largest / (3.0 * np.abs(self.volumes)))

    @property
    def facets(self) -> IntArray:
        """Corner nodes of the faces of all cells, (4 m, 3), outward."""
        return self.corners[:, _FACES].reshape(-1, 3)

    @cached_property
    def partners(self) -> IntArray:
        """Facet on the other side of each facet, (4 m,): see `pair_facets`."""
        return read_only(pair_facets(self.corners, _FACES), np.int64)

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray]:
        facet = np.flatnonzero(self.partners > np.arange(len(self.partners)))
        pairs = np.stack([facet, self.partners[facet]], axis=1)
        return pairs, np.flatnonzero(self.partners == FREE)

    @cached_property
    def flaw(self) -> str:
        """What keeps the mesh from being solved on, with its cure; empty for a sound mesh."""
        if not np.isfinite(self.points).all():
            return "the mesh has points that are NaN or infinite: correct its coordinates"
        return first_flaw(self.points, self.cells, _EDGES, self.volumes, self.partners)

    @cached_property
    def across(self) -> IntArray:
        """Cell across the face opposite to each corner, (m, 4); -1 where there is none."""
        first, second = self._pairing[0].T
        table = np.full(4 * len(self.cells), -1, dtype=np.int64)
        table[first], table[second] = second // 4, first // 4
        return read_only(table.reshape(-1, 4), int)

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas (k,), mm^2, and unit normals (k, 3) of facets (k, 3)."""
        a, b, c = np.moveaxis(self.points[facets], 1, 0)
        normal = 0.5 * np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1)
        return area, normal / np.maximum(area, 1e-300)[:, None]

    def facet_nodes(self, facets: IntArray) -> IntArray:
        """Nodes of facets: their corners, and on a quadratic mesh the middles of their sides.

        Parameters
        ----------
        facets : (k, 3) int array

        Returns
        -------
        (k, 3) or (k, 6) int array
            Middles in the order of the sides 01, 12, 20.
        """
        if self.order == 1 or not len(facets):
            return facets
        on_facet = np.zeros(len(self.points), dtype=bool)
        on_facet[facets] = True
        ends = self.cells[:, self.edges].reshape(-1, 2)
        chosen = np.flatnonzero(on_facet[ends].all(axis=1))
        at = positions(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), ends[chosen])
        if (at < 0).any():
            raise InputError(
                "a patch has facets that no cell of the mesh has: name boundary facets"
            )
        return np.hstack([facets, self.cells[:, 4:].reshape(-1)[chosen[at]].reshape(-1, 3)])

    def quadratic(self) -> "TetMesh":
        """Return the P2 mesh with a node at the middle of every edge; patches stay."""
        if self.order == 2:
            return self
        edges, edge = unique_edges(self.cells[:, _EDGES].reshape(-1, 2))
        points = np.concatenate([self.points, self.points[edges].mean(axis=1)])
        extra = len(self.points) + edge.reshape(-1, 6)
        return TetMesh(points, np.hstack([self.cells, extra]), self.patches, self.axes)

    def linear(self) -> "TetMesh":
        """Return the P1 mesh of the corners alone; nodes are renumbered, patches stay."""
        if self.order == 1:
            return self
        kept, cells = np.unique(self.corners, return_inverse=True)
        number = np.full(len(self.points), -1)
        number[kept] = np.arange(len(kept))
        patches = {name: number[facets] for name, facets in self.patches.items()}
        return TetMesh(self.points[kept], cells.reshape(-1, 4), patches, self.axes)
