"""Smooth scalar fields in the plane: quadratic B-splines on a square grid."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze


@dataclass(frozen=True)
class SplineGrid:
    """Quadratic B-splines on the squares of a grid that a part touches.

    A field has one coefficient a spline. Fields and their gradients are continuous.

    Attributes
    ----------
    centre : (2,) array, mm
        A corner of the grid.
    axes : (2, 2) array
        Rows: unit vectors along the sides of the squares.
    size : float, mm
        Side of a square.
    used : (k, 2) int array
        Numbers of the splines that have a coefficient: spline (i, j) covers the squares i - 1 to
        i + 1 and j - 1 to j + 1, and square (0, 0) begins at `centre`. Sorted.
    """

    centre: FloatArray
    axes: FloatArray
    size: float
    used: IntArray

    def __post_init__(self) -> None:
        freeze(self, centre=float, axes=float, used=int)

    @classmethod
    def over(
        cls, points: FloatArray, centre: FloatArray, axes: FloatArray, size: float
    ) -> "SplineGrid":
        """Grid with all splines that reach any of the points (n, 2), mm."""
        square = np.floor((points - centre) @ axes.T / size).astype(np.int64)
        square = _different(square)
        near = square[:, None] + np.stack(np.meshgrid(*2 * [[-1, 0, 1]]), axis=-1).reshape(-1, 2)
        return cls(centre, axes, size, _different(near.reshape(-1, 2)))

    def __len__(self) -> int:
        return len(self.used)

    @cached_property
    def _number(self) -> tuple[IntArray, IntArray]:
        """Smallest (i, j), and a table from (i, j) to the coefficient; -1 where there is none."""
        low = self.used.min(axis=0)
        table = np.full(np.ptp(self.used, axis=0) + 1, -1, dtype=np.int64)
        table[tuple((self.used - low).T)] = np.arange(len(self.used))
        return low, table

    def covers(self, points: FloatArray) -> BoolArray:
        """Whether all splines that reach a point have a coefficient, for points (n, 2): (n,)."""
        low, table = self._number
        square = np.floor((points - self.centre) @ self.axes.T / self.size).astype(np.int64) - low
        padded = np.pad(table, 2, constant_values=-1)
        near = np.clip(square, -1, table.shape)[:, None] + 2
        near = near + np.stack(np.meshgrid(*2 * [[-1, 0, 1]]), axis=-1).reshape(-1, 2)
        return np.asarray((padded[near[..., 0], near[..., 1]] >= 0).all(axis=1))

    def values(self, points: FloatArray) -> Any:
        """Matrix (n, k) from coefficients to values at points (n, 2)."""
        return self._matrices(points, ((0, 0),))[0]

    def slopes(self, points: FloatArray) -> tuple[Any, Any]:
        """Matrices (n, k) from coefficients to both components of the gradient, 1/mm."""
        along, across = self._matrices(points, ((1, 0), (0, 1)))
        (a, b), (c, d) = self.axes.T
        return (a * along + b * across).tocsr(), (c * along + d * across).tocsr()

    def derivatives(self, points: FloatArray) -> tuple[Any, ...]:
        """Matrices (n, k) to the two first and three second derivatives at points (n, 2).

        Along the sides of the squares: x, y in 1/mm, then xx, xy and yy in 1/mm^2; xx and yy jump
        at the lines of the grid.
        """
        return self._matrices(points, ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)))

    def _matrices(self, points: FloatArray, orders: tuple[tuple[int, int], ...]) -> tuple[Any, ...]:
        """Find derivatives of some orders along the sides of the squares; of order 0 the value."""
        low, table = self._number
        place = (points - self.centre) @ self.axes.T / self.size
        square = np.floor(place).astype(np.int64)
        x = place - square
        weight = np.stack([0.5 * (1.0 - x) ** 2, 0.5 + x - x * x, 0.5 * x * x], axis=2)
        slope = np.stack([x - 1.0, 1.0 - 2.0 * x, x], axis=2) / self.size
        second = np.broadcast_to(np.array([1.0, -2.0, 1.0]) / self.size**2, weight.shape)
        i = square[:, 0, None] + np.arange(-1, 2) - low[0]
        j = square[:, 1, None] + np.arange(-1, 2) - low[1]
        column = table[i[:, :, None], j[:, None, :]].reshape(-1)
        if len(column) and column.min() < 0:
            raise ValueError("points must lie in squares that the grid was made over")
        row = np.repeat(np.arange(len(points)), 9)

        def matrix(first: FloatArray, second: FloatArray) -> Any:
            entries = (first[:, :, None] * second[:, None, :]).reshape(-1)
            return sp.csr_array((entries, (row, column)), shape=(len(points), len(self)))

        by_order = (weight, slope, second)
        return tuple(matrix(by_order[a][:, 0], by_order[b][:, 1]) for a, b in orders)

    @cached_property
    def laplacian(self) -> Any:
        """Graph Laplacian (k, k) of neighbouring splines: positive semi-definite, no unit."""
        _, table = self._number
        padded = np.pad(table, 1, constant_values=-1)
        pairs = []
        for first, second in (
            (padded[:-1], padded[1:]),
            (padded[:, :-1], padded[:, 1:]),
        ):
            both = (first >= 0) & (second >= 0)
            pairs.append(np.stack([first[both], second[both]]))
        i, j = np.concatenate(pairs, axis=1)
        links = sp.coo_array((np.ones(len(i)), (i, j)), shape=2 * (len(self),)).tocsr()
        links = links + links.T
        return (sp.diags_array(links.sum(axis=1)) - links).tocsr()


def _different(pairs: IntArray) -> IntArray:
    """Different ones of pairs (n, 2), sorted: `numpy.unique` of rows, many times quicker."""
    low = pairs.min(axis=0)
    rows = int(np.ptp(pairs[:, 1])) + 1
    number = np.unique((pairs[:, 0] - low[0]) * rows + pairs[:, 1] - low[1])
    return np.stack([number // rows, number % rows], axis=1) + low
