"""The boundary of a part that has no cells yet: a surface to try rules of patches on."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.body.mesh.tet_mesh import CellMesh

_MOST = 400_000
"""Triangles at which a surface is fine enough."""
_SIDES = np.array([[0, 1], [1, 2], [2, 0]])


class Shell(CellMesh):
    """A closed surface of triangles, outward, as the only cells of a mesh; one rigid body."""

    dimension = 3
    sizes = (3,)
    kinds = "triangles"

    @property
    def facets(self) -> IntArray:
        """Sides of the triangles."""
        return self.cells[:, _SIDES].reshape(-1, 2)

    @cached_property
    def boundary(self) -> IntArray:
        """All triangles."""
        return self.cells

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of triangles in a row: what a surface encloses hangs together."""
        row = np.arange(len(self.cells))
        return read_only(np.stack([row[:-1], row[1:]], axis=1), int)

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas (k,), mm^2, and unit normals (k, 3) of triangles (k, 3)."""
        a, b, c = np.moveaxis(self.points[facets], 1, 0)
        across = 0.5 * np.cross(b - a, c - a)
        area = np.linalg.norm(across, axis=1)
        return area, across / np.maximum(area, 1e-300)[:, None]


def refined(
    points: ArrayLike, triangles: ArrayLike, length: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Cut triangles until no side is longer than a length, or there are very many.

    Parameters
    ----------
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Closed.
    length : float, mm

    Returns
    -------
    points : (p, 3) array
    triangles : (q, 3) int array
        Closed as before.
    origin : (q,) int array
        The triangle that each is a piece of.
    """
    points = np.asarray(points, dtype=np.float64)
    triangles = np.asarray(triangles, dtype=np.int64)
    origin = np.arange(len(triangles))
    while len(triangles) < _MOST:
        sides = np.sort(triangles[:, _SIDES].reshape(-1, 2), axis=1)
        edges, place = np.unique(sides, axis=0, return_inverse=True)
        ends = points[edges]
        long = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) > length
        if not long.any():
            break
        middle = np.where(long, len(points) + np.cumsum(long) - 1, -1)
        points = np.concatenate([points, ends[long].mean(axis=1)])
        triangles, parent = _split_triangles(triangles, middle[place.reshape(-1)].reshape(-1, 3))
        origin = origin[parent]
    return points, triangles, origin


def _split_triangles(triangles: IntArray, middle: IntArray) -> tuple[IntArray, IntArray]:
    """Cut triangles at the middles (t, 3) of their sides, -1 for a side that stays; parents."""
    count = (middle >= 0).sum(axis=1)
    pieces, parents = [triangles[count == 0]], [np.flatnonzero(count == 0)]

    def add(rows: IntArray, *corners: tuple[IntArray, IntArray, IntArray]) -> None:
        for corner in corners:
            pieces.append(np.stack(corner, axis=1))
            parents.append(rows)

    for k in range(3):
        order = [k, (k + 1) % 3, (k + 2) % 3]
        rows = np.flatnonzero((count == 1) & (middle[:, k] >= 0))
        (a, b, c), (m, *_) = triangles[rows][:, order].T, middle[rows][:, order].T
        add(rows, (a, m, c), (m, b, c))
        rows = np.flatnonzero((count == 2) & (middle[:, k] < 0))
        (a, b, c), (_, m, n) = triangles[rows][:, order].T, middle[rows][:, order].T
        add(rows, (m, c, n), (a, b, m), (a, m, n))
    rows = np.flatnonzero(count == 3)
    (a, b, c), (m, n, o) = triangles[rows].T, middle[rows].T
    add(rows, (a, m, o), (m, b, n), (o, n, c), (m, n, o))
    return np.concatenate(pieces), np.concatenate(parents)
