"""Closed curves: the holes of a layer, and rings too short for the cutter."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.errors import InputError
from ccfem.layers.layer import Layer

__all__ = ["close_short_ring", "holes_on"]


def holes_on(layer: Layer, patches: Iterable[str]) -> list[Any]:
    """Holes of a flat layer whose edge touches one of the patches, as shapely Polygons.

    Raises
    ------
    InputError
        For a patch that the part does not have.
    """
    touched: set[int] = set()
    for name in patches:
        if name not in layer.patches:
            known = ", ".join(sorted(layer.patches)) or "none"
            raise InputError(f"no patch named '{name}' for conformal curves; there are: {known}")
        touched |= set(layer.patches[name].ravel().tolist())
    rings = [shapely.Polygon(layer.plane_points[loop]) for loop in layer.loops if len(loop) > 2]
    loops = [loop for loop in layer.loops if len(loop) > 2]
    return [
        ring
        for ring, loop in zip(rings, loops, strict=True)
        if not ring.exterior.is_ccw and touched & set(loop.tolist())
    ]


def close_short_ring(line: FloatArray, least_length: float, overlap: float = 0.1) -> FloatArray:
    """Let a closed line that is just too short run on over its own start.

    Parameters
    ----------
    line : (n, 2) array, mm
        Returned as it is when it is open, long enough, or shorter than the overlap can mend.
    least_length : float, mm
    overlap : float, default 0.1
        Largest part of the ring's length that is laid twice [Chen et al. 2021: the ring round a
        hole of 10.9 mm is 40.8 mm long, against a minimum of 42 mm].

    Returns
    -------
    (n, 2) array
        The line, open and exactly `least_length` long where it was lengthened.
    """
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    missing = least_length - length
    if not np.array_equal(line[0], line[-1]) or not 0.0 < missing <= overlap * length:
        return line
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    again = along[(along > 0.0) & (along < missing)]
    again = np.concatenate([again, [missing * (1.0 + 1e-12)]])
    twice = np.column_stack([np.interp(again, along, line[:, axis]) for axis in (0, 1)])
    return np.concatenate([line, twice])
