"""Smooth scalar fields in the plane or in space: quadratic B-splines on a regular grid."""

from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add, mul
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze


@dataclass(frozen=True)
class SplineGrid:
    """Quadratic B-splines on the squares of a grid that a part touches; in space on its cubes.

    A field has one coefficient a spline. Fields and their gradients are continuous. The number of
    dimensions d is 2 or 3.

    Attributes
    ----------
    centre : (d,) array, mm
        A corner of the grid.
    axes : (d, d) array
        Rows: unit vectors along the sides of the squares.
    size : float, mm
        Side of a square.
    used : (k, d) int array
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
        """Grid with all splines that reach any of the points (n, d), mm."""
        square = np.floor((points - centre) @ axes.T / size).astype(np.int64)
        near = _different(square)[:, None] + _stencil(len(centre))
        return cls(centre, axes, size, _different(near.reshape(-1, len(centre))))

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
        """Whether all splines that reach a point have a coefficient, for points (n, d): (n,)."""
        low, table = self._number
        square = np.floor((points - self.centre) @ self.axes.T / self.size).astype(np.int64) - low
        padded = np.pad(table, 2, constant_values=-1)
        near = np.clip(square, -1, table.shape)[:, None] + 2 + _stencil(len(self.centre))
        return np.asarray((padded[tuple(np.moveaxis(near, -1, 0))] >= 0).all(axis=1))

    def values(self, points: FloatArray) -> Any:
        """Matrix (n, k) from coefficients to values at points (n, d)."""
        return self._matrices(points, (len(self.centre) * (0,),))[0]

    def slopes(self, points: FloatArray) -> tuple[Any, ...]:
        """Matrices (n, k) from coefficients to the d components of the gradient, 1/mm."""
        orders = np.eye(len(self.centre), dtype=np.int64)
        along = self._matrices(points, tuple(map(tuple, orders.tolist())))
        return tuple(
            reduce(add, (a * matrix for a, matrix in zip(axis, along, strict=True))).tocsr()
            for axis in self.axes.T
        )

    def derivatives(self, points: FloatArray) -> tuple[Any, ...]:
        """Matrices (n, k) to the two first and three second derivatives at points (n, 2) if d is 2.

        Along the sides of the squares: x, y in 1/mm, then xx, xy and yy in 1/mm^2; xx and yy jump
        at the lines of the grid.
        """
        return self._matrices(points, ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2)))

    def _matrices(self, points: FloatArray, orders: tuple[tuple[int, ...], ...]) -> tuple[Any, ...]:
        """Find derivatives of some orders along the sides of the squares; of order 0 the value."""
        low, table = self._number
        place = (points - self.centre) @ self.axes.T / self.size
        square = np.floor(place).astype(np.int64)
        x = place - square
        weight = np.stack([0.5 * (1.0 - x) ** 2, 0.5 + x - x * x, 0.5 * x * x], axis=2)
        slope = np.stack([x - 1.0, 1.0 - 2.0 * x, x], axis=2) / self.size
        second = np.broadcast_to(np.array([1.0, -2.0, 1.0]) / self.size**2, weight.shape)
        near = square[:, :, None] + np.arange(-1, 2) - low[:, None]
        column = table[*(_spread(near[:, k], k, len(low)) for k in range(len(low)))].reshape(-1)
        if len(column) and column.min() < 0:
            raise ValueError("points must lie in squares that the grid was made over")
        row = np.repeat(np.arange(len(points)), 3 ** len(low))
        by_order = (weight, slope, second)

        def matrix(order: tuple[int, ...]) -> Any:
            factors = (_spread(by_order[n][:, k], k, len(low)) for k, n in enumerate(order))
            entries = reduce(mul, factors).reshape(-1)
            return sp.csr_array((entries, (row, column)), shape=(len(points), len(self)))

        return tuple(map(matrix, orders))

    @cached_property
    def laplacian(self) -> Any:
        """Graph Laplacian (k, k) of neighbouring splines: positive semi-definite, no unit."""
        _, table = self._number
        padded = np.pad(table, 1, constant_values=-1)
        pairs = []
        for axis in range(padded.ndim):
            lined = np.moveaxis(padded, axis, 0)
            first, second = (np.moveaxis(part, 0, axis) for part in (lined[:-1], lined[1:]))
            both = (first >= 0) & (second >= 0)
            pairs.append(np.stack([first[both], second[both]]))
        i, j = np.concatenate(pairs, axis=1)
        links = sp.coo_array((np.ones(len(i)), (i, j)), shape=2 * (len(self),)).tocsr()
        links = links + links.T
        return (sp.diags_array(links.sum(axis=1)) - links).tocsr()


def _spread(values: FloatArray | IntArray, axis: int, dimensions: int) -> Any:
    """Values (n, 3) along one of the axes of arrays (n, 3, 3, ..)."""
    return values[(slice(None), *(slice(None) if k == axis else None for k in range(dimensions)))]


def _stencil(dimensions: int) -> IntArray:
    """Offsets (3^d, d) of the splines that reach a square."""
    offsets = np.stack(np.meshgrid(*dimensions * [[-1, 0, 1]]), axis=-1)
    return offsets.reshape(-1, dimensions)


def _different(numbers: IntArray) -> IntArray:
    """Different ones of numbers (n, d), sorted: `numpy.unique` of rows, many times quicker."""
    low, shape = numbers.min(axis=0), np.ptp(numbers, axis=0) + 1
    number = np.unique(np.ravel_multi_index(tuple((numbers - low).T), tuple(shape)))
    return np.stack(np.unravel_index(number, tuple(shape)), axis=1) + low
