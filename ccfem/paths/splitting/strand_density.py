"""How much fibre lies where: volume of strands per area, spread over about a fibre width."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.polylines import pack, sample_midpoints

_CELL = 0.25
_SPREAD = 0.5
"""Cell of the grid on which fibre is counted, and standard deviation of the bell curve that spreads
it, in fibre widths: strands a width apart then have the same density everywhere to 1.5 %."""


@dataclass(frozen=True)
class StrandDensity:
    """Volume of strands per area on a grid.

    Attributes
    ----------
    values : (a, b) array, mm
    low : (2,) array, mm
        Corner of the grid.
    cell : float, mm
    """

    values: FloatArray
    low: FloatArray
    cell: float

    @classmethod
    def of(
        cls,
        strands: Sequence[FloatArray],
        sections: Sequence[float],
        width: float,
        places: FloatArray | None = None,
    ) -> "StrandDensity":
        """Count strands (n, 2) of some sections, mm^2, on a grid round places, or round themselves.

        `width` is that of a fibre, mm.
        """
        cell = _CELL * width
        lines, offsets = pack(strands)
        around = lines if places is None else places
        samples, _, length, line = sample_midpoints(lines, offsets, 0.5 * cell)
        low = around.min(axis=0) - 4.0 * width
        shape = tuple(np.ceil((around.max(axis=0) + 4.0 * width - low) / cell).astype(int) + 1)
        index = np.floor((samples - low) / cell).astype(int)
        inside = ((index >= 0) & (index < shape)).all(axis=1)
        flat = np.ravel_multi_index(tuple(index[inside].T), shape)
        weight = (length * np.asarray(sections)[line])[inside]
        count = np.bincount(flat, weight, int(np.prod(shape))).reshape(shape)
        spread = gaussian_filter(count / cell**2, _SPREAD / _CELL, mode="constant")
        return cls(spread, low, cell)

    def at(self, places: FloatArray) -> FloatArray:
        """Values at places (k, 2)."""
        where = (places - self.low) / self.cell - 0.5
        return np.asarray(map_coordinates(self.values, where.T, order=1, mode="nearest"))

    def index(self, places: FloatArray) -> tuple[IntArray, IntArray]:
        """Cells that places (k, 2) lie in."""
        where = np.floor((places - self.low) / self.cell).astype(np.int64)
        where = np.clip(where, 0, np.array(self.values.shape) - 1)
        return where[:, 0], where[:, 1]

    def place(self, index: IntArray) -> FloatArray:
        """Middles (k, 2) of cells (k, 2)."""
        return np.asarray(self.low + (index + 0.5) * self.cell)
