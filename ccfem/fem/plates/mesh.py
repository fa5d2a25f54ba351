"""Meshes of triangles or quadrilaterals in the plane, with named patches of edges."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.base.errors import InputError
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.geometry.facets import positions


@dataclass(frozen=True, repr=False)
class PlaneMesh(CellMesh):
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

    dimension = 2
    sizes = (3, 4)
    kinds = "triangles or quadrilaterals"
    order = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, edges in self.patches.items():
            if edges.ndim != 2 or edges.shape[1] not in (1, 2):
                raise InputError(
                    f"patch '{name}' of a plane mesh must have shape (k, 2) or (k, 1); got "
                    f"{edges.shape}: give edges by their ends, or nodes"
                )

    @cached_property
    def facets(self) -> IntArray:
        """Edges of all cells, (m * q, 2), each walked with its cell on the left."""
        return np.stack([self.cells, np.roll(self.cells, -1, axis=1)], axis=2).reshape(-1, 2)

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
        at = positions(edges, self.boundary)
        if (at < 0).any():
            raise InputError("a loaded patch has edges inside the part: name boundary edges")
        first, second = np.moveaxis(self.points[self.boundary[at]], 1, 0)
        x, y = (second - first).T
        length = np.hypot(x, y)
        normal = np.stack([y, -x], axis=1) / np.maximum(length, 1e-300)[:, None]
        return length * self.thickness[self.mesh.boundary_cells[at]], normal
