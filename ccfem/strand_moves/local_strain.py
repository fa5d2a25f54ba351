"""Strain and its slope anywhere in a part, by moving least squares over the cells near by.

In linear cells the strain is constant and jumps from cell to cell: it has no slope. A straight line
fitted to the cells round a point has both.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from ccfem.arrays import FloatArray, IntArray

__all__ = ["LocalStrain", "StrainThere"]

_NEIGHBOURS = 24
"""Cells that a fit takes."""

_RIDGE = 1e-3
"""Weight of a slope of nothing, against the cells: where all of them lie in one plane, the slope
across it is not known."""


class StrainThere(NamedTuple):
    """Strain at points.

    Attributes
    ----------
    value : (k, 3) array
        Strains 11, 22 and 12 (engineering shear) in the plane of the layers.
    slope : (k, 3, 2) array, 1/mm
        Of each strain along the two axes in the plane.
    """

    value: FloatArray
    slope: FloatArray


@dataclass(frozen=True)
class LocalStrain:
    """Moving least squares over the centroids of cells.

    Attributes
    ----------
    centroids : (m, 3) array, mm
        In the frame of the layers: the first two coordinates lie in their plane.
    volumes : (m,) array, mm^3
    """

    centroids: FloatArray
    volumes: FloatArray
    tree: cKDTree = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "tree", cKDTree(self.centroids))

    def near(self, points: FloatArray) -> IntArray:
        """Cells (k, n) that fits at points (k, 3), mm, and at points close to them take."""
        count = min(_NEIGHBOURS, len(self.centroids))
        return np.asarray(self.tree.query(points, count)[1]).reshape(len(points), count)

    def at(self, points: FloatArray, near: IntArray, strain: FloatArray) -> StrainThere:
        """Strain at points.

        Parameters
        ----------
        points : (k, 3) array, mm
        near : (k, n) int array
            From `near`, at these points or at where they were.
        strain : (m, 3) array
            Of the cells.
        """
        value, slope = np.empty((len(points), 3)), np.empty((len(points), 3, 2))
        size = float(np.cbrt(6.0 * self.volumes.mean()))
        weight = self.volumes / self.volumes.mean()
        _fit(points, near, self.centroids, weight, strain, size, value, slope)
        return StrainThere(value, slope)


@njit(cache=True, nogil=True)
def _fit(points, near, centroids, weight, strain, size, value, slope):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Fit ``a + b . (x - point) / size`` by the weights ``V exp(-(d / size)^2)``."""
    matrix, right, basis = np.empty((4, 4)), np.empty((4, 3)), np.empty(4)
    for k in range(len(points)):
        for i in range(4):
            for j in range(4):
                matrix[i, j] = 0.0
            for j in range(3):
                right[i, j] = 0.0
        for n in range(near.shape[1]):
            cell = near[k, n]
            square = 0.0
            basis[0] = 1.0
            for i in range(3):
                basis[i + 1] = (centroids[cell, i] - points[k, i]) / size
                square += basis[i + 1] * basis[i + 1]
            share = weight[cell] * np.exp(-square)
            for i in range(4):
                for j in range(4):
                    matrix[i, j] += share * basis[i] * basis[j]
                for j in range(3):
                    right[i, j] += share * basis[i] * strain[cell, j]
        ridge = _RIDGE * matrix[0, 0]
        for i in range(1, 4):
            matrix[i, i] += ridge
        # Gauss: the matrix is positive definite and needs no pivots.
        for i in range(4):
            for row in range(i + 1, 4):
                factor = matrix[row, i] / matrix[i, i]
                for j in range(i, 4):
                    matrix[row, j] -= factor * matrix[i, j]
                for j in range(3):
                    right[row, j] -= factor * right[i, j]
        for back in range(4):
            i = 3 - back
            for j in range(3):
                total = right[i, j]
                for column in range(i + 1, 4):
                    total -= matrix[i, column] * right[column, j]
                right[i, j] = total / matrix[i, i]
        for j in range(3):
            value[k, j] = right[0, j]
            slope[k, j, 0] = right[1, j] / size
            slope[k, j, 1] = right[2, j] / size
