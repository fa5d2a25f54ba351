"""Tetrahedral meshes with named patches."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from ccfem.arrays import FloatArray, IntArray, read_only
from ccfem.errors import InputError
from ccfem.mesh.flaws import first_flaw
from ccfem.mesh.pairing import FREE, pair_facets

__all__ = ["TetMesh", "signed_volumes"]

_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corner nodes of the face opposite to each corner, outward for a positive cell."""

_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""Corner nodes of the edge that carries mid-side node 4 + k (VTK order)."""


@dataclass(frozen=True)
class TetMesh:
    """A tetrahedral mesh, linear (P1) or quadratic (P2), with named boundary patches.

    Attributes
    ----------
    points : (n, 3) array, mm
    cells : (m, 4) or (m, 10) int array
        Nodes of each tetrahedron, positively oriented; quadratic cells in VTK order.
    patches : mapping of name to (k, 3) int arrays
        Boundary facets by their corner nodes.
    """

    points: FloatArray
    cells: IntArray
    patches: Mapping[str, IntArray] = field(default_factory=dict)

    edges = _EDGES
    faces = _FACES

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))
        object.__setattr__(self, "cells", read_only(self.cells, np.int64))
        patches = {name: read_only(facets, np.int64) for name, facets in self.patches.items()}
        object.__setattr__(self, "patches", MappingProxyType(patches))
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise InputError(
                f"mesh points must have shape (n, 3); got {self.points.shape}: give x, y, z a node"
            )
        if self.cells.ndim != 2 or self.cells.shape[1] not in (4, 10) or not len(self.cells):
            raise InputError(
                f"mesh cells must have shape (m, 4) or (m, 10) with m >= 1; got "
                f"{self.cells.shape}: give linear or quadratic tetrahedra"
            )
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError(
                f"mesh cells must name nodes 0 to {len(self.points) - 1}; got "
                f"{self.cells.min()} to {self.cells.max()}: check the numbering of the file"
            )

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

    @cached_property
    def partners(self) -> IntArray:
        """Facet on the other side of each facet, (4 m,): see `ccfem.mesh.pairing.pair_facets`."""
        return read_only(pair_facets(self.corners, _FACES, len(self.points)), np.int64)

    @cached_property
    def flaw(self) -> str:
        """What keeps the mesh from being solved on, with its cure; empty for a sound mesh."""
        return first_flaw(self.points, self.cells, _EDGES, self.volumes, self.partners)

    @cached_property
    def boundary(self) -> IntArray:
        """Corner nodes of the boundary facets, (b, 3), outward."""
        facet = np.flatnonzero(self.partners == FREE)
        return read_only(self.corners[facet[:, None] // 4, _FACES[facet % 4]], np.int64)

    @cached_property
    def boundary_cells(self) -> IntArray:
        """Cell of each boundary facet, (b,)."""
        return read_only(np.flatnonzero(self.partners == FREE) // 4, np.int64)

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of cells that share a face, (f, 2)."""
        facet = np.flatnonzero(self.partners > np.arange(len(self.partners)))
        return read_only(np.stack([facet, self.partners[facet]], axis=1) // 4, np.int64)

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, (2, 3), mm."""
        return read_only(np.stack([self.points.min(axis=0), self.points.max(axis=0)]))

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
        n = len(self.points)
        on_facet = np.zeros(n, dtype=bool)
        on_facet[facets] = True
        ends = self.cells[:, self.edges].reshape(-1, 2)
        chosen = np.flatnonzero(on_facet[ends].all(axis=1))
        ends = np.sort(ends[chosen], axis=1)
        keys, first = np.unique(ends[:, 0] * n + ends[:, 1], return_index=True)
        middle = self.cells[:, 4:].reshape(-1)[chosen[first]]
        sides = np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        wanted = sides[..., 0] * n + sides[..., 1]
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        if (keys[at] != wanted).any():
            raise InputError(
                "a patch has facets that no cell of the mesh has: name boundary facets"
            )
        return np.hstack([facets, middle[at]])

    def with_patches(self, patches: Mapping[str, IntArray]) -> "TetMesh":
        """Return the same mesh with more named patches, (k, 3) facets each."""
        return replace(self, patches={**self.patches, **patches})

    def patch(self, name: str) -> IntArray:
        """Facets (k, 3) of a named patch.

        Raises
        ------
        InputError
            When there is no patch of that name; the known ones are listed.
        """
        if name not in self.patches:
            known = ", ".join(sorted(self.patches)) or "none"
            raise InputError(f"no patch named '{name}'; the mesh has: {known}")
        return self.patches[name]

    def quadratic(self) -> "TetMesh":
        """Return the P2 mesh with a node at the middle of every edge; patches stay."""
        if self.order == 2:
            return self
        pairs = np.sort(self.cells[:, _EDGES].reshape(-1, 2), axis=1)
        key = pairs[:, 0] * len(self.points) + pairs[:, 1]
        _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
        middle = self.points[pairs[first]].mean(axis=1)
        extra = len(self.points) + inverse.reshape(-1, 6)
        return TetMesh(
            np.concatenate([self.points, middle]), np.hstack([self.cells, extra]), self.patches
        )


def signed_volumes(points: FloatArray, cells: IntArray) -> FloatArray:
    """Signed volume (m,), mm^3, of straight-sided tetrahedra (m, 4) between points (n, 3), mm."""
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)
