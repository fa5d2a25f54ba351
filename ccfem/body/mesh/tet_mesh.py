"""Tetrahedral meshes with named patches."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.checks import check_known
from ccfem.base.display import Shown, by_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.curved_cells import (
    CELL_POINTS,
    EDGES,
    NODES,
    STRAIGHT,
    barycentric,
    curved_cells,
    curved_volumes,
    jacobians,
    side_middles,
    unfolded,
)
from ccfem.body.mesh.round_walls import RoundWall, walls_of_facets
from ccfem.body.mesh.smooth_faces import guessed_walls
from ccfem.geometry.facets import (
    areas_and_normals,
    facet_keys,
    paired,
    positions,
    signed_volumes,
    unique_edges,
)
from ccfem.geometry.locate import Simplices, locate

# What meshes in space and in the plane share: nodes, cells, their facets, and named patches.


_MANY = 12
"""Names of patches that a message lists."""
_FEW = 2**17
"""Cells up to which what they are searched by is stored."""
_NONE: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class CellMesh(ABC):
    """A mesh of d-dimensional cells, d = 2 or 3, with named patches of facets.

    Attributes
    ----------
    points : (n, d) array, mm
    cells : (m, q) int array
        Nodes of each cell.
    patches : mapping of name to int arrays
        Boundary facets by their corners.
    axes : mapping of name to (3,) arrays
        Axes of round patches where the rule of the patch states one: a rough wall does not show it.
    """

    points: FloatArray
    cells: IntArray
    patches: Mapping[str, IntArray] = field(default_factory=dict)
    axes: Mapping[str, FloatArray] = field(default_factory=dict)

    dimension: ClassVar[int]
    sizes: ClassVar[tuple[int, ...]]
    """Numbers of nodes that a cell may have."""
    kinds: ClassVar[str]
    """What such cells are called."""

    def __post_init__(self) -> None:
        freeze(self, points=float, cells=int, patches=int, axes=float)
        d, known = self.dimension, " or ".join(f"(m, {size})" for size in self.sizes)
        if self.points.ndim != 2 or self.points.shape[1] != d:
            raise InputError(
                f"mesh points must have shape (n, {d}); got {self.points.shape}: give "
                f"{', '.join('xyz'[:d])} a node"
            )
        if self.cells.ndim != 2 or self.cells.shape[1] not in self.sizes or not len(self.cells):
            raise InputError(
                f"mesh cells must have shape {known} with m >= 1; got {self.cells.shape}: give "
                f"{self.kinds}"
            )
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError(
                f"mesh cells must name nodes 0 to {len(self.points) - 1}; got "
                f"{self.cells.min()} to {self.cells.max()}: check the numbering of the file"
            )

    def __repr__(self) -> str:
        size = " x ".join(f"{side:.4g}" for side in np.ptp(self.bounds, axis=0))
        return (
            f"{type(self).__name__}: {len(self.points):,} nodes, {len(self.cells):,} cells of "
            f"{self.cells.shape[1]}, {size} mm, patches {self.patch_list}"
        )

    @property
    def patch_list(self) -> str:
        """Names of the patches for messages: face_2 before face_10, and at most a dozen."""
        names = sorted(self.patches, key=by_number)
        if len(names) > _MANY:
            names[_MANY - 1 :] = [f"... {names[-1]} ({len(names)} in all)"]
        return ", ".join(names) or "none"

    @property
    @abstractmethod
    def facets(self) -> IntArray:
        """Corners of the facets of all cells, cell by cell, outward."""

    @property
    def corners(self) -> IntArray:
        """Corner nodes of each cell."""
        return self.cells

    @cached_property
    def centres(self) -> FloatArray:
        """Mean of the corners of each cell, (m, d), mm."""
        return read_only(self.points[self.corners].mean(axis=1))

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray]:
        pairs, single = paired(self.facets)
        return read_only(pairs, int), read_only(single, int)

    @property
    def _facets_a_cell(self) -> int:
        return len(self.facets) // len(self.cells)

    @cached_property
    def boundary(self) -> IntArray:
        """Corners of the boundary facets, outward: the part is on their inner side."""
        return read_only(self.facets[self._pairing[1]], int)

    @cached_property
    def boundary_cells(self) -> IntArray:
        """Cell of each boundary facet, (b,)."""
        return read_only(self._pairing[1] // self._facets_a_cell, int)

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of cells that share a facet, (f, 2)."""
        return read_only(self._pairing[0] // self._facets_a_cell, int)

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, (2, d), mm."""
        return read_only(np.stack([self.points.min(axis=0), self.points.max(axis=0)]))

    def facet_nodes(self, facets: IntArray) -> IntArray:
        """All nodes of facets: of linear cells their corners."""
        return facets

    def with_patches(
        self, patches: Mapping[str, IntArray], axes: Mapping[str, FloatArray] = _NONE
    ) -> Self:
        """Return the same mesh with more named patches, and the axes of some of them."""
        kept = {name: axis for name, axis in self.axes.items() if name not in patches}
        return replace(self, patches={**self.patches, **patches}, axes={**kept, **axes})

    def patch(self, name: str) -> IntArray:
        """Facets of a named patch."""
        check_known("patch", name, sorted(self.patches))
        return self.patches[name]


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
    def _simplices(self) -> Simplices:
        return Simplices.of(self.points, self.corners)

    def locate(self, queries: FloatArray) -> tuple[IntArray, FloatArray]:
        """Cell that holds each point (q, 3), as `ccfem.geometry.locate.locate`, its sides straight.

        What it is searched by is stored where cells are few: some 300 bytes each.
        """
        if len(self.cells) > _FEW:
            return locate(self.points, self.corners, queries)
        return self._simplices.locate(queries)

    @cached_property
    def partners(self) -> IntArray:
        """Facet on the other side of each facet, (4 m,): see `pair_facets`."""
        return read_only(pair_facets(self.corners, _FACES), np.int64)

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray]:
        facet = np.flatnonzero(self.partners > np.arange(len(self.partners)))
        pairs = np.stack([facet, self.partners[facet]], axis=1)
        return read_only(pairs, int), read_only(np.flatnonzero(self.partners == FREE), int)

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
        return areas_and_normals(self.points, facets)

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


# What keeps a mesh from being solved on: one line with its cure.


def first_flaw(points: FloatArray, cells: IntArray, volumes: FloatArray, partners: IntArray) -> str:
    """Say what is wrong with a mesh of tetrahedra; empty for a sound one.

    Its points are finite, and partners (4 m,) are those of `pair_facets`.
    """
    if not volumes.min() > 0.0:
        return (
            f"cell {volumes.argmin()} of the mesh has volume {volumes.min():.3g} mm^3: repair flat "
            "and inverted cells first (ccfem.body.mesh.check_mesh)"
        )
    wrong = np.flatnonzero((partners == CROWDED) | (partners == FOLDED))
    if len(wrong):
        cell = wrong[0] // 4
        at = ", ".join(f"{x:.4g}" for x in points[cells[cell, :4]].mean(axis=0))
        return (
            f"cells of the mesh overlap or come twice ({len(wrong)} of their faces belong to cells "
            f"on one side, or to more than two; the first at ({at}) mm): mend it with "
            "ccfem.body.mesh.check_mesh, or mesh the part again"
        )
    return "" if cells.shape[1] == 4 else _folded(points, cells)


def _folded(points: FloatArray, cells: IntArray) -> str:
    """Say which quadratic cell its curved sides turn inside out."""
    curved = curved_cells(points, cells)
    nodes = points[cells[curved]]
    least = np.min([jacobians(nodes, at) for at in (*NODES, *CELL_POINTS)], axis=0)
    folded = curved[least <= 0.0]
    if not len(folded):
        return ""
    at = ", ".join(f"{x:.4g}" for x in points[cells[folded[0], :4]].mean(axis=0))
    return (
        f"{len(folded)} quadratic cells are turned inside out by their curved sides, the first at "
        f"({at}) mm: straighten them with ccfem.body.mesh.check_mesh, or use a finer mesh there"
    )


# Which facets of which tetrahedra lie on each other.


FREE, CROWDED, FOLDED = -1, -2, -3
"""A facet without a partner; one that more than two cells have; one with both cells on one side."""


def pair_facets(corners: IntArray, faces: IntArray) -> IntArray:
    """Partner of every facet: the facet of the neighbouring cell that has the same nodes.

    Parameters
    ----------
    corners : (m, 4) int array
        Positively oriented cells.
    faces : (4, 3) int array
        Corners of the facet opposite to each corner, outward.

    Returns
    -------
    (4 m,) int array
        ``4 * cell + facet`` of the partner; `FREE` on the boundary; `CROWDED` where more than two
        cells have the facet; `FOLDED` where two cells that have it lie on the same side of it.
    """
    facets = corners[:, faces].reshape(-1, 3)
    (key,) = facet_keys(facets)
    order = np.argsort(key, kind="stable")
    alike = np.diff(key[order]) == 0
    one, other = order[:-1][alike], order[1:][alike]
    # Cells on either side of a facet list its nodes in opposite senses.
    a, b, c = facets.T
    odd = (a > b) ^ (b > c) ^ (a > c)
    folded = odd[one] == odd[other]
    partner = np.full(len(facets), FREE)
    partner[one] = np.where(folded, FOLDED, other)
    partner[other] = np.where(folded, FOLDED, one)
    crowd = np.flatnonzero(alike[:-1] & alike[1:])
    partner[order[crowd[:, None] + np.arange(3)]] = CROWDED
    return partner
