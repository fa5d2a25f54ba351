"""Strands along the medial axis of a section, and concentric strands in the rest."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.medial_axis import MedialSegment, medial_axis
from ccfem.geometry.parallel_strands import grow
from ccfem.geometry.shapes import Region
from ccfem.geometry.shells import concentric

_SHORTEST = 4.0
"""Segments of the medial axis shorter than this many pitches are left out."""
_BETTER = 0.05
"""Mean misfit, in pitches, by which a pair must be better than one strand on the axis."""


def medial_fill(section: Region, pitch: float, closest: float) -> list[FloatArray]:
    """Strands along the medial axis and parallel to it, and concentric strands in the rest.

    Each is a (k, 2) array, mm. If the width of the section suits an even number of strands, two run
    beside the axis and none on it. Further parallel strands are laid until one would touch the
    border. A section without a medial axis (a disc) gets concentric strands only.

    Parameters
    ----------
    section : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch, closest
        As in `geometry.parallel_strands.grow`.
    """
    axis = medial_axis(section, 0.5 * pitch)
    segments = [s for s in axis.segments if s.length >= _SHORTEST * pitch]
    if not segments:
        return concentric(section, pitch, closest, walls=False)
    pair = _pair(segments, pitch)
    narrowest = min(float(s.radius.min()) for s in segments)
    count = max(int(np.floor(narrowest / pitch - (0.0 if pair else 0.5) + 1e-3)), 0)
    curves = [s.points for s in segments]
    return grow(curves, section, pitch, closest, count, whole=True, pair=pair)


def _pair(segments: Sequence[MedialSegment], pitch: float) -> bool:
    """Whether two strands half a pitch beside the axis leave less gap and overlap than one on it.

    Beside the axis there is room for `radius` / pitch strands, less half a strand if one lies on
    it. The fractional part is a gap or an overlap along the whole length.
    """
    room = np.concatenate([s.radius for s in segments]) / pitch
    weight = np.concatenate([_shares(s.points) for s in segments])
    one, two = (np.average(_misfit(room - half), weights=weight) for half in (0.5, 0.0))
    return bool(two < one - _BETTER)


def _misfit(room: FloatArray) -> FloatArray:
    """Distance of numbers of strands from whole numbers."""
    return np.abs(room - np.round(room))


def _shares(line: FloatArray) -> FloatArray:
    """Length that each point of a line stands for."""
    half = 0.5 * np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.append(half, 0.0) + np.append(0.0, half)
