"""Filters against checkerboards and mesh dependence: of densities, or of sensitivities."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError


@dataclass(frozen=True)
class ConeFilter:
    """Averages over the cells round each one, with weights that fall linearly to zero.

    Attributes
    ----------
    weights : csr_array (m, m)
        ``max(0, radius - distance)`` between the centres, times the volume of the column's cell.
    volumes : (m,) array, mm^3
    """

    weights: sp.csr_array
    volumes: FloatArray

    @classmethod
    def of_cells(cls, centres: FloatArray, volumes: FloatArray, radius: float) -> "ConeFilter":
        """Filter of cells with given centres (m, d), mm, and volumes (m,).

        Parameters
        ----------
        centres, volumes : arrays
        radius : float, mm
            Above 0; below the distance of the centres, nothing is averaged.

        Raises
        ------
        InputError
            For a radius so large that it reaches too many cells.
        """
        m = len(centres)
        tree = cKDTree(centres)
        sample = centres[:: max(1, m // 100)]
        around = np.mean([len(neighbours) for neighbours in tree.query_ball_point(sample, radius)])
        if around * m > 1e8:
            raise InputError(
                f"filter radius {radius} mm reaches {around:.0f} cells round each of {m}: give a "
                "smaller one"
            )
        first, second = tree.query_pairs(radius, output_type="ndarray").T
        near = radius - np.linalg.norm(centres[first] - centres[second], axis=1)
        cells = np.arange(m)
        row, column = np.concatenate([first, second, cells]), np.concatenate([second, first, cells])
        weight = np.concatenate([near, near, np.full(m, radius)])
        matrix = sp.csr_array((weight * volumes[column], (row, column)), shape=(m, m))
        return cls(matrix, volumes)

    @cached_property
    def _total(self) -> FloatArray:
        return np.asarray(self.weights.sum(axis=1)).reshape(-1)

    def average(self, values: FloatArray) -> FloatArray:
        """Weighted mean (m, ...) of values (m, ...) round each cell."""
        total = self._total.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(self.weights @ values) / total

    def transposed(self, gradient: FloatArray) -> FloatArray:
        """Gradient (m,) by the values, of the gradient by their averages: the chain rule."""
        return np.asarray(self.weights.T @ (gradient / self._total))

    def sensitivities(self, density: FloatArray, gradient: FloatArray) -> FloatArray:
        """Sigmund's filtered sensitivities (Struct. Multidisc. Optim. 21 (2001) 120, eq. 5).

        Parameters
        ----------
        density : (m,) array
        gradient : (m,) array
            Of the objective by the density of each cell.
        """
        mean = np.asarray(self.weights @ (density * gradient / self.volumes)) / self._total
        return self.volumes * mean / np.maximum(density, 1e-3)
