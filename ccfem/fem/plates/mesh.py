"""Meshes in the plane with named patches of edges, and plates as images."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import CellMesh
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
    """A plane mesh with the thickness (m,), mm, of its cells: what loads act on."""

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


# Plates as images: a mesh of the pixels of a mask, and values of its cells as an image.


def raster_mesh(
    mask: BoolArray, size: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> PlaneMesh:
    """Mesh of the true pixels of an image, one square cell each.

    Parameters
    ----------
    mask : (H, W) bool array
        Row 0 is the top, so pixel (i, j) covers x from ``j * size`` and y from
        ``(H - 1 - i) * size``.
    size : float, mm
        Side of a pixel.
    origin : tuple of 2 floats, mm
        Lower left corner of the image.

    Returns
    -------
    PlaneMesh
        Cells in the order of ``mask``: ``image[mask]`` are values per cell and ``image[mask] =
        values`` puts them back. Corners from the lower left one, counter-clockwise. Nodes are
        numbered along the shorter side first. Patches x_min, x_max, y_min, y_max: the edges on
        the sides of the box that holds the part.
    """
    mask = np.asarray(mask, dtype=bool)
    if mask.ndim != 2 or not mask.any() or not size > 0.0:
        raise InputError(
            f"a raster needs an (H, W) mask with a true pixel and a pixel size > 0 mm; got shape "
            f"{mask.shape}, {int(mask.sum())} true pixels and size {size}"
        )
    (height, width), (rows, columns) = mask.shape, np.nonzero(mask)
    left, low = columns, height - 1 - rows
    x = left[:, None] + np.array([0, 1, 1, 0])
    y = low[:, None] + np.array([0, 0, 1, 1])
    # Numbered along the shorter side first: a narrow band.
    number = x * (height + 1) + y if height <= width else y * (width + 1) + x
    used, cells = np.unique(number, return_inverse=True)
    divisor = height + 1 if height <= width else width + 1
    place = np.stack(np.divmod(used, divisor), axis=1)
    place = place if height <= width else place[:, ::-1]
    mesh = PlaneMesh(place * size + np.array(origin), cells.reshape(-1, 4))
    patches = {}
    for k, axis in enumerate("xy"):
        for side, level in (("min", place[:, k].min()), ("max", place[:, k].max())):
            patches[f"{axis}_{side}"] = mesh.boundary_where(place[:, k] == level)
    return mesh.with_patches(patches)


class Raster(NamedTuple):
    """Values of the cells of a raster mesh as an image.

    Attributes
    ----------
    image : (H, W) array
        Row 0 is the top; zero where there is no cell.
    inside : (H, W) bool array
        Pixels that are cells.
    size : float, mm
        Side of a pixel.
    origin : (2,) array, mm
        Lower left corner of the image.
    """

    image: FloatArray
    inside: BoolArray
    size: float
    origin: FloatArray


def raster_image(mesh: PlaneMesh, values: FloatArray) -> Raster:
    """Values (m,) of the cells of a raster mesh as an image: `raster_mesh` backwards."""
    low, high = (mesh.points[mesh.cells].min(axis=1), mesh.points[mesh.cells].max(axis=1))
    size = float((high - low)[0, 0])
    place = (low - mesh.bounds[0]) / size
    pixel = np.rint(place).astype(np.int64)
    square = np.abs(high - low - size).max() <= 1e-6 * size
    if mesh.cells.shape[1] != 4 or not square or np.abs(place - pixel).max() > 1e-6:
        raise InputError("an image needs a mesh of equal squares on one grid: use raster_mesh")
    width, height = pixel.max(axis=0) + 1
    rows, columns = height - 1 - pixel[:, 1], pixel[:, 0]
    image, inside = np.zeros((height, width)), np.zeros((height, width), dtype=bool)
    image[rows, columns], inside[rows, columns] = values, True
    return Raster(image, inside, size, np.array(mesh.bounds[0]))
