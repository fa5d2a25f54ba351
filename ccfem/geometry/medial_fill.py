"""Strands along the medial axis of a section, and concentric ones in the rest."""

from functools import lru_cache
from typing import Any

import numpy as np

from ccfem.arrays import FloatArray, read_only
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.parallel_strands import grow
from ccfem.geometry.shells import concentric

__all__ = ["medial_fill"]

_SHORTEST = 4.0
"""Segments of the medial axis shorter than so many pitches are left out."""
_SECTIONS = 32
"""Sections whose strands are remembered."""


@lru_cache(maxsize=_SECTIONS)
def medial_fill(section: Any, pitch: float, closest: float) -> tuple[FloatArray, ...]:
    """Strands along the medial axis and parallel to it, and concentric ones in what they leave.

    Parallel strands follow until the first of them would touch the border. A section without a
    medial axis (a disc) is filled by concentric strands alone. Remembered for equal sections, as
    the layers of a part often are.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Distance of neighbouring strands.
    closest : float
        As in `geometry.dilation.parallels`.

    Returns
    -------
    tuple of (k, 2) arrays, mm
        Read-only.
    """
    axis = medial_axis(section, 0.5 * pitch)
    segments = [s for s in axis.segments if s.length >= _SHORTEST * pitch]
    if segments:
        narrowest = min(float(s.radius.min()) for s in segments)
        count = max(int(np.floor(narrowest / pitch - 0.5 + 1e-3)), 0)
        lines = grow([s.points for s in segments], section, pitch, closest, count, whole=True)
    else:
        lines = concentric(section, pitch, closest, walls=False)
    return tuple(read_only(line) for line in lines)
