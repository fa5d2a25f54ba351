"""Find the triangle or tetrahedron that holds a point, with a uniform grid of buckets."""

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError

# A uniform grid of buckets for boxes, to find neighbours and containing boxes.


_MOST_CELLS = 4_000_000


class Buckets(NamedTuple):
    """Boxes by the cells of a uniform grid.

    Attributes
    ----------
    origin : (d,) array, mm
        Lowest corner of the grid; d is 2 or 3.
    cell : float, mm
        Size of a cell.
    shape : (3,) int array
        Cells along each axis; 1 along a third axis of a plane grid.
    starts, items : int arrays
        Cell (i, j, k) holds the boxes ``items[starts[c]:starts[c + 1]]`` with
        ``c = (i * shape[1] + j) * shape[2] + k``.
    """

    origin: FloatArray
    cell: float
    shape: IntArray
    starts: IntArray
    items: IntArray


def bucket(low: FloatArray, high: FloatArray, cell: float | None = None) -> Buckets:
    """Put boxes into the cells of a grid that they overlap.

    Parameters
    ----------
    low, high : (n, d) arrays, mm
        Corners of at least one box, d = 2 or 3.
    cell : float, mm, optional
        Size of a cell; by default about one box a cell. It is increased if the grid would have more
        than four million cells.
    """
    origin = low.min(axis=0)
    extent = np.maximum(high.max(axis=0) - origin, 1e-12)
    dimension = len(origin)
    if cell is None:
        spread = float((np.prod(extent) / len(low)) ** (1.0 / dimension))
        cell = max(spread, float(np.mean(high - low)))
    while np.prod(np.floor(extent / cell) + 1.0) > _MOST_CELLS:
        cell *= 1.5
    shape = np.ones(3, dtype=np.int64)
    shape[:dimension] = np.floor(extent / cell).astype(np.int64) + 1
    first = np.zeros((len(low), 3), dtype=np.int64)
    last = np.zeros((len(low), 3), dtype=np.int64)
    first[:, :dimension] = np.floor((low - origin) / cell)
    last[:, :dimension] = np.floor((high - origin) / cell)
    last = np.minimum(last, shape - 1)
    # Boxes are counted, then written: this moves the place in every cell to its end.
    place = np.zeros(np.prod(shape), dtype=np.int64)
    _visit_cells(first, last, shape, place, np.zeros(0, dtype=np.int64))
    starts = np.concatenate([[0], np.cumsum(place)])
    items = np.empty(starts[-1], dtype=np.int64)
    _visit_cells(first, last, shape, starts[:-1].copy(), items)
    return Buckets(origin, cell, shape, starts, items)


@compiled
def _visit_cells(
    first: IntArray, last: IntArray, shape: IntArray, place: IntArray, items: IntArray
) -> None:
    """Raise the place in each cell for every box from cell `first` to `last`, and write the box."""
    writing = len(items) > 0
    for box in range(len(first)):
        for i in range(first[box, 0], last[box, 0] + 1):
            for j in range(first[box, 1], last[box, 1] + 1):
                for k in range(first[box, 2], last[box, 2] + 1):
                    c = (i * shape[1] + j) * shape[2] + k
                    if writing:
                        items[place[c]] = box
                    place[c] += 1


@dataclass(frozen=True)
class Simplices:
    """Triangles of the plane, or tetrahedra in space, prepared once to be searched for points.

    Corners (m, d + 1, d) may have either orientation; flat ones are never found. A point counts as
    held up to `rounding`, mm, outside.
    """

    corners: FloatArray
    rounding: float

    @classmethod
    def of(cls, points: FloatArray, simplices: IntArray) -> "Simplices":
        """Those with points (n, d), mm, as corners (m, d + 1)."""
        return cls(points[simplices], _rounding(points))

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray]:
        by_corner = np.moveaxis(self.corners, 1, 0)
        return reduce(np.minimum, by_corner), reduce(np.maximum, by_corner)

    @cached_property
    def _maps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return barycentric_maps(self.corners)

    @cached_property
    def _grid(self) -> Buckets:
        low, high = self._boxes
        return bucket(low - self.rounding, high + self.rounding)

    def locate(self, queries: FloatArray, reach: float = 0.0) -> tuple[IntArray, FloatArray]:
        """Simplex that holds each query point; as the function `locate`."""
        queries = np.ascontiguousarray(queries, dtype=np.float64)
        simplex = np.full(len(queries), -1, dtype=np.int64)
        weights = np.zeros((len(queries), self.corners.shape[1]))
        if not len(queries) or not len(self.corners):
            return simplex, weights
        # First without reach, which needs the fewest candidates; then only what was not found.
        simplex, weights = _search(self._grid, *self._maps, queries, self.rounding)
        left = np.flatnonzero(simplex < 0)
        if reach > 0.0 and len(left):
            low, high = self._boxes
            slack = reach + self.rounding
            grid = bucket(low - slack, high + slack)
            simplex[left], weights[left] = _search(grid, *self._maps, queries[left], slack)
        weights = np.maximum(weights, 0.0)
        total = weights.sum(axis=1, keepdims=True)
        return simplex, weights / np.where(total > 0.0, total, 1.0)


def _rounding(points: FloatArray) -> float:
    return 1e-9 * float(np.abs(points).max(initial=0.0))


def locate(
    points: FloatArray, simplices: IntArray, queries: FloatArray, reach: float = 0.0
) -> tuple[IntArray, FloatArray]:
    """Triangle of the plane, or tetrahedron in space, that holds each query point.

    What is searched more than once is prepared by `Simplices`.

    Parameters
    ----------
    points : (n, d) array, mm
        In d = 2 or 3 dimensions.
    simplices : (m, d + 1) int array
        Of either orientation; flat ones are never found.
    queries : (q, d) array, mm
    reach : float, mm, default 0
        A query outside every simplex takes the one whose sides it exceeds least, by at most this.

    Returns
    -------
    simplex : (q,) int array
        Index into `simplices`, or -1.
    barycentric : (q, d + 1) array in [0, 1]
        Weights of the corners, summing to 1; for a query outside, those of a point of the simplex
        close to it; 0 where `simplex` is -1.
    """
    near = np.flatnonzero(_near(points, simplices, queries, reach + _rounding(points)))
    kept = Simplices(points[simplices[near]], _rounding(points))
    index, weights = kept.locate(queries, reach)
    return np.append(near, -1)[index], weights


def _near(points: FloatArray, simplices: IntArray, queries: FloatArray, border: float) -> BoolArray:
    """Simplices that are not away from all queries, as those off a layer of the part are."""
    if not len(queries):
        return np.zeros(len(simplices), dtype=bool)
    # Bits say on which sides of the box of the queries a point does not lie.
    most, least = np.fmax.reduce(queries) + border, np.fmin.reduce(queries) - border
    sides = np.concatenate([points <= most, points >= least], axis=1)
    bits = np.packbits(sides, axis=1)[:, 0]
    every = np.packbits(np.ones(sides.shape[1], dtype=bool))[0]
    return np.asarray(reduce(np.bitwise_or, bits[simplices].T) == every)


def barycentric_maps(corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First corner, gradients of the barycentric coordinates and heights of each simplex.

    Flat simplices get zero gradients and heights, so that no point is ever inside them.
    """
    edges = corners[:, 1:] - corners[:, :1]
    size = np.abs(np.linalg.det(edges))
    scale = np.einsum("tij,tij->t", edges, edges) ** (0.5 * edges.shape[1])
    flat = size <= 1e-14 * scale
    edges = np.where(flat[:, None, None], np.eye(edges.shape[1]), edges)
    inverse = np.swapaxes(np.linalg.inv(edges), 1, 2)
    gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    gradients[flat] = 0.0
    norm = np.sqrt(np.einsum("tij,tij->ti", gradients, gradients))
    heights = np.divide(1.0, norm, out=np.zeros_like(norm), where=norm > 0.0)
    return np.ascontiguousarray(corners[:, 0]), gradients, heights


@compiled
def _search(
    grid: Buckets,
    origins: FloatArray,
    gradients: FloatArray,
    heights: FloatArray,
    queries: FloatArray,
    slack: float,
) -> tuple[IntArray, FloatArray]:
    """Simplex of each query: the first that holds it, else the least overstepped within slack."""
    count, dimension = queries.shape
    triangle = np.full(count, -1, np.int64)
    weights = np.zeros((count, dimension + 1))
    weight = np.empty(dimension + 1)
    for q in range(count):
        # Bucket that the query lies in.
        c = 0
        outside = False
        for d in range(3):
            i = 0
            if d < dimension:
                i = int(np.floor((queries[q, d] - grid.origin[d]) / grid.cell))
            outside = outside or i < 0 or i >= grid.shape[d]
            c = c * grid.shape[d] + i
        if outside:
            continue
        best = -slack
        for item in range(grid.starts[c], grid.starts[c + 1]):
            k = grid.items[item]
            if heights[k, 0] == 0.0:
                continue
            # Depth inside: the least barycentric coordinate times the height over that side, in mm.
            depth = np.inf
            rest = 1.0
            for corner in range(1, dimension + 1):
                value = 0.0
                for d in range(dimension):
                    value += gradients[k, corner, d] * (queries[q, d] - origins[k, d])
                weight[corner] = value
                rest -= value
                depth = min(depth, value * heights[k, corner])
            weight[0] = rest
            depth = min(depth, rest * heights[k, 0])
            if depth >= best:
                best = depth
                triangle[q] = k
                for corner in range(dimension + 1):
                    weights[q, corner] = weight[corner]
                if depth >= 0.0:
                    break
    return triangle, weights


# Nearest points on a triangulated surface.


@dataclass(frozen=True)
class Nearest:
    """Points (q, 3) of a surface that are nearest to others, and the distance (q,), mm.

    They lie on triangles (q,), at barycentric `weights` (q, 3) in [0, 1].
    """

    triangle: IntArray
    weights: FloatArray
    points: FloatArray
    distance: FloatArray


def nearest_on_triangles(points: FloatArray, triangles: IntArray, queries: FloatArray) -> Nearest:
    """Find the points of a surface that are nearest to given ones.

    Triangles may be of any size; those without area are passed over. Of several triangles at the
    same distance any may be returned.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
    queries : (q, 3) array, mm

    Raises
    ------
    InputError
        For queries that are not finite, and for a surface without area.
    """
    import pyvista as pv
    from vtkmodules.vtkCommonCore import reference
    from vtkmodules.vtkCommonDataModel import vtkStaticCellLocator

    if not np.isfinite(queries).all():
        raise InputError("expected finite points to find the nearest ones of; got NaN or infinity")
    points = np.asarray(points, dtype=np.float64)
    triangle, foot = np.full(len(queries), -1), np.zeros((len(queries), 3))
    locator: Any = vtkStaticCellLocator()
    if len(triangles):
        locator.SetDataSet(pv.PolyData.from_regular_faces(points, triangles))
        locator.BuildLocator()
        at, part, square = [0.0, 0.0, 0.0], reference(0), reference(0.0)
        cell: Any = reference(-1)
        for k, query in enumerate(queries.tolist()):
            cell.set(-1)  # stays where no triangle is at a finite distance
            locator.FindClosestPoint(query, at, cell, part, square)
            triangle[k], foot[k] = cell.get(), at
    if (triangle < 0).any():
        raise InputError(
            "expected a surface with area at a finite distance; got "
            f"{len(triangles)} triangles without"
        )
    weights = _barycentric(points[triangles[triangle]], foot)
    nearest = np.einsum("qk,qkd->qd", weights, points[triangles[triangle]])
    return Nearest(triangle, weights, nearest, np.linalg.norm(nearest - queries, axis=1))


def _barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Coordinates (q, 3) of points (q, 3) of triangles with the given corners (q, 3, 3)."""
    sides = corners[:, [1, 2]] - corners[:, :1]
    normal = np.cross(sides[:, 0], sides[:, 1])
    square = np.maximum(np.einsum("qd,qd->q", normal, normal), np.finfo(float).tiny)
    # Twice the areas that the point spans with two sides, as shares of the triangle's.
    across = np.cross(points[:, None] - corners[:, :1], sides[:, ::-1]) * [[[1.0], [-1.0]]]
    weights = np.clip(np.einsum("qkd,qd->qk", across, normal) / square[:, None], 0.0, 1.0)
    weights = np.column_stack([1.0 - weights.sum(axis=1), weights])
    return np.maximum(weights, 0.0) / np.maximum(weights, 0.0).sum(axis=1, keepdims=True)
