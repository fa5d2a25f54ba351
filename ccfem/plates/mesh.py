"""Meshes of triangles or quadrilaterals in the plane, with named patches of edges."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ccfem.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.errors import InputError

__all__ = ["PlaneMesh", "Sheet"]


@dataclass(frozen=True)
class PlaneMesh:
    """A mesh of linear triangles or of bilinear quadrilaterals in the plane.

    Attributes
    ----------
    points : (n, 2) array, mm
    cells : (m, 3) or (m, 4) int array
        Corners of each cell, counter-clockwise.
    patches : mapping of name to (k, 2) or (k, 1) int arrays
        Boundary edges by their ends, or single nodes (which can be held, not loaded: give a
        `PointForce`).
    """

    points: FloatArray
    cells: IntArray
    patches: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))
        object.__setattr__(self, "cells", read_only(self.cells, np.int64))
        patches = {name: read_only(edges, np.int64) for name, edges in self.patches.items()}
        object.__setattr__(self, "patches", MappingProxyType(patches))
        if self.points.ndim != 2 or self.points.shape[1] != 2:
            raise InputError(
                f"plane mesh points must have shape (n, 2); got {self.points.shape}: give x, y a "
                "node"
            )
        if self.cells.ndim != 2 or self.cells.shape[1] not in (3, 4) or not len(self.cells):
            raise InputError(
                f"plane mesh cells must have shape (m, 3) or (m, 4) with m >= 1; got "
                f"{self.cells.shape}: give triangles or quadrilaterals"
            )
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError(
                f"plane mesh cells must name nodes 0 to {len(self.points) - 1}; got "
                f"{self.cells.min()} to {self.cells.max()}: check the numbering"
            )
        for name, edges in self.patches.items():
            if edges.ndim != 2 or edges.shape[1] not in (1, 2):
                raise InputError(
                    f"patch '{name}' of a plane mesh must have shape (k, 2) or (k, 1); got "
                    f"{edges.shape}: give edges by their ends, or nodes"
                )

    @property
    def corners(self) -> IntArray:
        """Corners of each cell: `cells`."""
        return self.cells

    @cached_property
    def areas(self) -> FloatArray:
        """Signed area of each cell, (m,), mm^2."""
        first, second = self.points[self.cells[:, 1:]], self.points[self.cells[:, :1]]
        x, y = np.moveaxis(first - second, 2, 0)
        return read_only(0.5 * (x[:, :-1] * y[:, 1:] - x[:, 1:] * y[:, :-1]).sum(axis=1))

    @cached_property
    def centres(self) -> FloatArray:
        """Mean of the corners of each cell, (m, 2), mm."""
        return read_only(self.points[self.cells].mean(axis=1))

    @cached_property
    def congruent(self) -> bool:
        """Whether all cells are the same up to a translation, to 1e-9 of their size."""
        shape = self.points[self.cells] - self.points[self.cells[:, :1]]
        return bool(np.abs(shape - shape[0]).max() <= 1e-9 * np.abs(shape[0]).max())

    @cached_property
    def _edges(self) -> IntArray:
        """Edges of all cells, (m * q, 2), each walked with its cell on the left."""
        return np.stack([self.cells, np.roll(self.cells, -1, axis=1)], axis=2).reshape(-1, 2)

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray, IntArray]:
        """Edges sorted so that equal ones are adjacent: order, first of a pair, single ones."""
        low, high = np.sort(self._edges, axis=1).T
        key = low * len(self.points) + high
        order = np.argsort(key, kind="stable")
        first = np.flatnonzero(key[order[1:]] == key[order[:-1]])
        single = np.ones(len(key), dtype=bool)
        single[first] = single[first + 1] = False
        return order, first, np.sort(order[single])

    @cached_property
    def boundary(self) -> IntArray:
        """Boundary edges, (b, 2), walked with the part on the left."""
        return read_only(self._edges[self._pairing[2]], np.int64)

    @cached_property
    def boundary_cells(self) -> IntArray:
        """Cell of each boundary edge, (b,)."""
        return read_only(self._pairing[2] // self.cells.shape[1], np.int64)

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of cells that share an edge, (f, 2)."""
        order, first, _ = self._pairing
        pairs = np.stack([order[first], order[first + 1]], axis=1)
        return read_only(pairs // self.cells.shape[1], np.int64)

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, (2, 2), mm."""
        return read_only(np.stack([self.points.min(axis=0), self.points.max(axis=0)]))

    def with_patches(self, patches: Mapping[str, IntArray]) -> "PlaneMesh":
        """Return the same mesh with more named patches."""
        return replace(self, patches={**self.patches, **patches})

    def patch(self, name: str) -> IntArray:
        """Edges (k, 2), or nodes (k, 1), of a named patch.

        Raises
        ------
        InputError
            When there is no patch of that name; the known ones are listed.
        """
        if name not in self.patches:
            known = ", ".join(sorted(self.patches)) or "none"
            raise InputError(f"no patch named '{name}'; the mesh has: {known}")
        return self.patches[name]

    def facet_nodes(self, edges: IntArray) -> IntArray:
        """Nodes of edges: their ends, (k, 2) as they are."""
        return edges

    def boundary_where(self, chosen: BoolArray) -> IntArray:
        """Boundary edges (k, 2) with both ends among the nodes chosen by an (n,) mask."""
        return self.boundary[chosen[self.boundary].all(axis=1)]

    def nearest_nodes(self, points: ArrayLike) -> IntArray:
        """Node (k,) of some cell that is nearest to each of some points (k, 2), mm."""
        used = np.unique(self.cells)
        wanted = np.atleast_2d(np.asarray(points, dtype=np.float64))
        distance = np.linalg.norm(self.points[used] - wanted[:, None], axis=2)
        return used[distance.argmin(axis=1)]


@dataclass(frozen=True)
class Sheet:
    """A plane mesh with the thickness of its cells: what loads act on.

    Attributes
    ----------
    mesh : PlaneMesh
    thickness : (m,) array, mm
    """

    mesh: PlaneMesh
    thickness: FloatArray

    @property
    def points(self) -> FloatArray:
        """Points of the mesh, (n, 2), mm."""
        return self.mesh.points

    @property
    def cells(self) -> IntArray:
        """Cells of the mesh."""
        return self.mesh.cells

    @property
    def boundary(self) -> IntArray:
        """Boundary edges of the mesh, (b, 2)."""
        return self.mesh.boundary

    def patch(self, name: str) -> IntArray:
        """Edges (k, 2) of a patch that can carry a load."""
        edges = self.mesh.patch(name)
        if edges.shape[1] != 2:
            raise InputError(
                f"patch '{name}' is of nodes and carries no load: give edges, or a PointForce"
            )
        return edges

    def facet_nodes(self, edges: IntArray) -> IntArray:
        """Nodes of edges: their ends, (k, 2) as they are."""
        return edges

    def facet_areas(self, edges: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas (k,), mm^2, and outward unit normals (k, 2) of boundary edges (k, 2)."""
        n = len(self.points)
        a, b = np.sort(self.boundary, axis=1).T
        order = np.argsort(a * n + b)
        known = (a * n + b)[order]
        low, high = np.sort(edges, axis=1).T
        at = np.minimum(np.searchsorted(known, low * n + high), len(known) - 1)
        if (known[at] != low * n + high).any():
            raise InputError("a loaded patch has edges inside the part: name boundary edges")
        at = order[at]
        first, second = np.moveaxis(self.points[self.boundary[at]], 1, 0)
        x, y = (second - first).T
        length = np.hypot(x, y)
        normal = np.stack([y, -x], axis=1) / np.maximum(length, 1e-300)[:, None]
        return length * self.thickness[self.mesh.boundary_cells[at]], normal
