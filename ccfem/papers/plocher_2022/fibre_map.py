"""Which fibre lies in which cell of a plate, and at what angle."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.geometry.polylines import arc_lengths, sample_at
from ccfem.judging.evaluation.plane_paths import PlanePaths

_REACH = 2.0
"""Half length, in bead widths, of the chord that gives the angle."""
_STEP = 0.25
"""Distance of samples along a path, in bead widths."""
_NEAR = 0.75
"""Cells farther than this from every path, in bead widths, take the angle of their neighbours."""


@dataclass(frozen=True)
class FibreMap:
    """Fibre of one layer in the cells of a plate.

    Attributes
    ----------
    angle : (m,) array, radians
        From axis x to the fibre; a line, so its half turn means nothing.
    path : (m,) int array
        Path that lies in the cell; -1 where none passes within 0.75 bead widths of its centre.
    """

    angle: FloatArray
    path: IntArray

    def __post_init__(self) -> None:
        freeze(self, angle=float, path=int)


def fibre_map(paths: PlanePaths, centres: FloatArray, bead: float) -> FibreMap:
    """Angle and path of the fibre in every cell of a layer.

    The angle of a cell is that of the path nearest to its centre, by the chord from two bead
    widths before to two behind the nearest point; ends of open paths cut the chord short. Cells
    without a path near take the mean of the 3 x 3 cells round them, in double-angle form, again
    and again until none is left.

    Parameters
    ----------
    centres : (m, 2) array, mm
        Of square cells one bead wide.
    bead : float, mm

    Raises
    ------
    ValueError
        When there is no path.
    """
    if not len(paths):
        raise ValueError("a fibre map needs at least one path")
    points, angle, line = _tangents(paths, bead)
    distance, nearest = cKDTree(points).query(centres)
    known = distance <= _NEAR * bead
    if not known.any():
        known = distance <= distance.min()
    double = np.exp(2.0j * angle[nearest])
    double[~known] = 0.0
    near = cKDTree(centres).query_pairs(1.5 * bead, output_type="ndarray")
    while not known.all():
        total = np.zeros(len(centres), dtype=complex)
        count = np.zeros(len(centres))
        for a, b in (near.T, near.T[::-1]):
            np.add.at(total, a, double[b])
            np.add.at(count, a, known[b].astype(float))
        # A part of the plate that no path reaches takes the angle of the nearest path.
        fresh = ~known & (count > 0.0)
        if not fresh.any():
            fresh, total = ~known, np.exp(2.0j * angle[nearest])
        size = np.abs(total[fresh])
        double[fresh] = np.where(size > 1e-12, total[fresh] / np.maximum(size, 1e-12), 1.0)
        known |= fresh
    path = np.where(distance <= _NEAR * bead, line[nearest], -1)
    return FibreMap(0.5 * np.angle(double), path)


def _tangents(paths: PlanePaths, bead: float) -> tuple[FloatArray, FloatArray, IntArray]:
    """Points along the paths with the angle of the chord round each, and their path."""
    points, offsets, total = paths.points, paths.offsets, paths.lengths
    parts = np.maximum(1, np.ceil(total / (_STEP * bead) - 1e-9)).astype(np.int64)
    line = np.repeat(np.arange(len(total)), parts + 1)
    first = np.cumsum(parts + 1) - (parts + 1)
    position = (np.arange(len(line)) - first[line]) * (total / parts)[line]
    # The given points too: paths on a raster pass through the centres of its cells.
    line_of_point = np.repeat(np.arange(len(total)), np.diff(offsets))
    line = np.concatenate([line, line_of_point])
    position = np.concatenate([position, arc_lengths(points, offsets)])
    ends = []
    for shift in (-_REACH * bead, _REACH * bead):
        at = position + shift
        ring = paths.closed[line]
        at[ring] %= total[line][ring]
        ends.append(sample_at(points, offsets, line, at)[0])
    chord = ends[1] - ends[0]
    # A closed path no longer than the chord closes on itself: there the step counts.
    short = np.linalg.norm(chord, axis=1) < 1e-9 * bead
    here, segment = sample_at(points, offsets, line, position)
    following = np.minimum(segment + 1, len(points) - 1)
    chord[short] = (points[following] - points[segment])[short]
    return here, np.arctan2(chord[:, 1], chord[:, 0]), line
