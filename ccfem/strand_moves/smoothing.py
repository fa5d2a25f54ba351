"""Vectors at the points of strands, smoothed along each of them."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.arrays import BoolArray, FloatArray, IntArray

__all__ = ["Smoothing", "across"]

_BEND, _TURN = 20.0, 200.0
"""Weights of second and fourth differences."""

_HELD = 1e6
"""Weight of nothing at points that are held."""


@dataclass(frozen=True)
class Smoothing:
    """Solves ``(1 + 20 D2 + 200 D4) v = f`` along each strand, v being nothing at held points.

    Attributes
    ----------
    offsets : (K + 1,) int array
        Of the strands' points.
    held : (P,) bool array
    """

    offsets: IntArray
    held: BoolArray
    factor: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = int(self.offsets[-1])
        inner = np.ones(count, dtype=bool)
        inner[self.offsets[:-1]] = inner[self.offsets[1:] - 1] = False
        step = np.ones(count, dtype=bool)
        step[self.offsets[1:] - 1] = False
        first = np.flatnonzero(step)
        one = np.ones(len(first))
        row = np.tile(np.arange(len(first)), 2)
        slope = sp.csr_array(
            (np.concatenate([-one, one]), (row, np.concatenate([first, first + 1]))),
            shape=(len(first), count),
        )
        d2 = slope.T @ slope
        bend = sp.diags_array(inner.astype(float)) @ d2
        matrix = sp.eye_array(count) + _BEND * d2 + _TURN * (bend.T @ bend)
        matrix = matrix + sp.diags_array(_HELD * self.held)
        # Strand after strand, the points are in the order of a band already.
        options = {"SymmetricMode": True}
        factor = splu(matrix.tocsc(), "NATURAL", diag_pivot_thresh=0.0, options=options)
        object.__setattr__(self, "factor", factor)

    def __call__(self, vectors: FloatArray) -> FloatArray:
        """Smooth vectors (P, 2)."""
        return np.asarray(self.factor.solve(np.where(self.held[:, None], 0.0, vectors)))


def across(points: FloatArray, offsets: IntArray, vectors: FloatArray) -> FloatArray:
    """Parts of vectors (P, 2) across polylines (P, 2), whose way is the chord of two neighbours."""
    before = np.maximum(np.arange(len(points)) - 1, np.repeat(offsets[:-1], np.diff(offsets)))
    after = np.minimum(np.arange(len(points)) + 1, np.repeat(offsets[1:] - 1, np.diff(offsets)))
    chord = points[after] - points[before]
    chord /= np.maximum(np.linalg.norm(chord, axis=1), 1e-300)[:, None]
    return np.asarray(vectors - (vectors * chord).sum(axis=1)[:, None] * chord)
