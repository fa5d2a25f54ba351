"""Strands along the medial axis of a section, and concentric ones in the rest."""

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.geometry.medial_axis import medial_axis
from ccfem.geometry.parallel_strands import grow
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import concentric

__all__ = ["medial_fill"]

_SHORTEST = 4.0
"""Segments of the medial axis shorter than this many pitches are left out."""


def medial_fill(section: Region, pitch: float, closest: float) -> list[FloatArray]:
    """Strands along the medial axis and parallel to it, and concentric ones in what they leave.

    Each is a (k, 2) array, mm. Parallel strands follow until the first of them would touch the
    border. A section without a medial axis (a disc) is filled by concentric strands alone.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch, closest
        As in `geometry.parallel_strands.grow`.
    """
    axis = medial_axis(section, 0.5 * pitch)
    segments = [s for s in axis.segments if s.length >= _SHORTEST * pitch]
    if segments:
        narrowest = min(float(s.radius.min()) for s in segments)
        count = max(int(np.floor(narrowest / pitch - 0.5 + 1e-3)), 0)
        return grow([s.points for s in segments], section, pitch, closest, count, whole=True)
    return concentric(section, pitch, closest, walls=False)
