"""Tetrahedral meshes with named patches."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.body.mesh.curved_cells import (
    EDGES,
    STRAIGHT,
    barycentric,
    curved_cells,
    curved_volumes,
    side_middles,
    unfolded,
)
from ccfem.body.mesh.flaws import first_flaw
from ccfem.body.mesh.pairing import FREE, pair_facets
from ccfem.body.mesh.round_walls import RoundWall, walls_of_facets
from ccfem.body.mesh.smooth_faces import guessed_walls
from ccfem.geometry.facets import positions, unique_edges
from ccfem.geometry.measures import signed_volumes

_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
"""Corner nodes of the face opposite to each corner, outward for a positive cell."""

_COVERED = 0.8
"""Least area of the facets on a wall, over its own: four chords of a circle have 0.9."""
_SEEN = 1e-3
"""Least gap between a side and the wall that it does not follow, over its length."""


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
    walls : tuple of RoundWall, optional
        Round walls of the body that the mesh was made from, where it is known; else they are told
        from the boundary.
    """

    walls: tuple[RoundWall, ...] | None = None

    dimension = 3
    sizes = (4, 10)
    kinds = "linear or quadratic tetrahedra"
    edges = EDGES
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
        """Signed volume of each cell, (m,), mm^3."""
        volumes = signed_volumes(self.points, self.corners)
        if len(self.curved):
            volumes[self.curved] = curved_volumes(self.points[self.cells[self.curved]])
        return read_only(volumes)

    @cached_property
    def curved(self) -> IntArray:
        """Rows of the quadratic cells that have a curved side."""
        none = np.zeros(0, dtype=np.int64)
        return read_only(none if self.order == 1 else curved_cells(self.points, self.cells), int)

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

    def local_coordinates(self, cell: IntArray, weights: FloatArray) -> FloatArray:
        """Barycentric coordinates of places in cells that may have curved sides.

        Parameters
        ----------
        cell : (k,) int array
        weights : (k, 4) array
            Barycentric coordinates of the places in the straight cells of their corners.

        Returns
        -------
        (k, 4) array
            Those at which the shape functions of the cells map to the places.
        """
        curved = np.flatnonzero(np.isin(cell, self.curved))
        if not len(curved):
            return weights
        nodes, at = self.points[self.cells[cell[curved]]], weights[curved]
        result = weights.copy()
        result[curved] = barycentric(nodes, np.einsum("ka,kai->ki", at, nodes[:, :4]), at)
        return result

    @cached_property
    def chords(self) -> tuple[int, float]:
        """Sides of quadratic cells on round walls that stay straight, and the largest gap, mm.

        They would fold a cell if they followed the wall.
        """
        if self.order == 1:
            return 0, 0.0
        _, normal = self.facet_areas(self.boundary)
        walls = (self.round_walls, self.wall_of)
        sides, places = side_middles(self.points, self.boundary, normal, *walls)
        ends = self.cells[:, EDGES].reshape(-1, 2)
        middle = self.points[self.cells[:, 4:].reshape(-1)[positions(sides, ends)]]
        chord = self.points[sides]
        length = np.linalg.norm(chord[:, 1] - chord[:, 0], axis=1)
        gap = np.linalg.norm(places - middle, axis=1)
        off = np.linalg.norm(middle - chord.mean(axis=1), axis=1)
        stay = (off <= STRAIGHT * length) & (gap > _SEEN * length)
        return int(stay.sum()), float(gap[stay].max(initial=0.0))

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
        return first_flaw(self.points, self.cells, self.volumes, self.partners)

    @cached_property
    def round_walls(self) -> tuple[RoundWall, ...]:
        """Cylinders, cones and spheres that parts of the boundary lie on."""
        return self._walls[0]

    @cached_property
    def wall_of(self) -> IntArray:
        """Round wall of each boundary facet, (b,): its place in `round_walls`, -1 for none."""
        return read_only(self._walls[1], int)

    @cached_property
    def _walls(self) -> tuple[tuple[RoundWall, ...], IntArray]:
        if self.walls is not None:
            area, normal = self.facet_areas(self.boundary)
            known = walls_of_facets(self.walls, self.points[self.boundary], normal)
            covered = np.bincount(known + 1, area, len(self.walls) + 1)[1:]
            # Where the boundary misses one, the mesh was moved or bent since it was made.
            if all(covered > _COVERED * np.array([wall.area for wall in self.walls])):
                return self.walls, known
        return guessed_walls(self.points, self.boundary)

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
        """Return the P2 mesh with a node at the middle of every edge; patches stay.

        On round walls that node lies on the wall, not on the chord, unless a cell would fold.
        """
        if self.order == 2:
            return self
        edges, edge = unique_edges(self.cells[:, EDGES].reshape(-1, 2))
        edge = edge.reshape(-1, 6)
        middles = self.points[edges].mean(axis=1)
        _, normal = self.facet_areas(self.boundary)
        sides, places = side_middles(
            self.points, self.boundary, normal, self.round_walls, self.wall_of
        )
        on_wall = positions(sides, edges)
        middles[on_wall] = places
        points = np.concatenate([self.points, middles])
        cells = np.hstack([self.cells, len(self.points) + edge])
        points = unfolded(points, cells, np.unique(len(self.points) + on_wall))
        return TetMesh(points, cells, self.patches, self.axes, self.walls)

    def linear(self) -> "TetMesh":
        """Return the P1 mesh of the corners alone; nodes are renumbered, patches stay."""
        if self.order == 1:
            return self
        kept, cells = np.unique(self.corners, return_inverse=True)
        number = np.full(len(self.points), -1)
        number[kept] = np.arange(len(kept))
        patches = {name: number[facets] for name, facets in self.patches.items()}
        return TetMesh(self.points[kept], cells.reshape(-1, 4), patches, self.axes, self.walls)
