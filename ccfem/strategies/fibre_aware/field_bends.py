"""Cost of levels of a field that bend more tightly than fibre can follow.

The curvature of a level is ``(g_y^2 s_xx - 2 g_x g_y s_xy + g_x^2 s_yy) / |g|^3``, g the gradient
of the field s.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze

_SMALLEST = 0.05
"""Strands a width below which |g| is rounded off: bends hardly count where little fibre lies."""


@dataclass(frozen=True)
class FieldBends:
    """Cost of bends that are tighter than a radius.

    The cost is the mean over the fibre of ``sqrt(1 + e^2) - 1``. Here e is the share by which the
    curvature exceeds that of the radius; for large e the cost is about e.

    Attributes
    ----------
    slopes : two sparse (m, c) arrays
        Map coefficients to the gradient in each cell, strands a width.
    seconds : three sparse (m, c) arrays
        Map coefficients to the second derivatives xx, xy and yy, strands a width per mm.
    fibre : (m,) array
        Length of fibre in each cell at one strand a width, as a share of that in all cells.
    radius : float, mm
    """

    slopes: tuple[Any, Any]
    seconds: tuple[Any, Any, Any]
    fibre: FloatArray
    radius: float

    def __post_init__(self) -> None:
        freeze(self, fibre=float)

    @cached_property
    def _transposed(self) -> tuple[Any, ...]:
        return tuple(matrix.T.tocsr() for matrix in (*self.slopes, *self.seconds))

    def cost(self, field: FloatArray) -> float:
        """Cost at coefficients (c,)."""
        _, size, _, excess = self._curvature(field)
        return float((self.fibre * size) @ (np.sqrt(1.0 + excess * excess) - 1.0))

    def slope(self, field: FloatArray) -> FloatArray:
        """Return the derivative (c,) of the cost by the coefficients."""
        (x, y, xx, xy, yy), size, curvature, excess = self._curvature(field)
        root = np.sqrt(1.0 + excess * excess)
        # Cost is fibre * size * (root - 1) a cell, curvature is bend / size^3.
        by_curvature = self.fibre * size * excess / root * self.radius * np.sign(curvature)
        by_bend = by_curvature / size**3
        by_size = self.fibre * (root - 1.0) - 3.0 * by_curvature * curvature / size
        by_x = by_size * x / size + by_bend * 2.0 * (x * yy - y * xy)
        by_y = by_size * y / size + by_bend * 2.0 * (y * xx - x * xy)
        parts = (by_x, by_y, by_bend * y * y, -2.0 * by_bend * x * y, by_bend * x * x)
        found = sum(matrix @ part for matrix, part in zip(self._transposed, parts, strict=True))
        return np.asarray(found)

    def _curvature(
        self, field: FloatArray
    ) -> tuple[tuple[FloatArray, ...], FloatArray, FloatArray, FloatArray]:
        """Find derivatives of the field, |g|, curvature of levels, and its excess: (m,) each."""
        found = tuple(matrix @ field for matrix in (*self.slopes, *self.seconds))
        x, y, xx, xy, yy = found
        size = np.sqrt(x * x + y * y + _SMALLEST**2)
        curvature = (y * y * xx - 2.0 * x * y * xy + x * x * yy) / size**3
        return found, size, curvature, np.maximum(self.radius * np.abs(curvature) - 1.0, 0.0)
