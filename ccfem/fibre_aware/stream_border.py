"""Where strands of a stream function end: on the borders of the layers."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import FloatArray
from ccfem.fibre_aware.spline_grid import SplineGrid
from ccfem.geometry.offsets import rings
from ccfem.geometry.polylines import resample
from ccfem.layers.layer import Layer

__all__ = ["border_points", "border_rise"]


def border_points(layer: Layer, step: float) -> list[FloatArray]:
    """Points (n, 2), mm, about a step apart along each border ring of a layer, the first again."""
    return [
        resample(ring, np.array([0, len(ring)]), step)[0] for ring in rings(layer.plane.polygon)
    ]


def border_rise(grid: SplineGrid, borders: Sequence[Sequence[FloatArray]]) -> Any:
    """Matrix (b, c) from the coefficients of several fields to their rise along the borders.

    Parameters
    ----------
    grid : SplineGrid
        Of every field.
    borders : sequence of sequences of (n, 2) arrays, mm
        For each field the rings that its strands may end on.

    Returns
    -------
    sparse matrix
        One row for each step from point to point; field k has the k-th block of ``len(grid)``
        columns.
    """
    blocks = []
    for border in borders:
        values = [grid.values(ring) for ring in border]
        blocks.append(sp.vstack([value[1:] - value[:-1] for value in values]))
    return sp.block_diag(blocks, format="csr")
