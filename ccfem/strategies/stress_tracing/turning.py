"""Tracks turned towards the stress where no rails guide them: in joints and near free ends.

A track may move sideways by u(s). The turned track minimises the sum, over its length, of ::

    cos(2 r) (u' - tan r)^2 + (c u'')^2 + (u / l)^2

with the angle r from the track to the stress. The terms are misalignment, curvature, and distance
from the old position. The distance counts much in members, whose width the tracks fill evenly, and
little in joints. Where r exceeds 45 degrees, in joints that it crosses, a track is not changed.
"""

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import isotonic_regression
from scipy.sparse import diags_array, eye_array
from scipy.sparse.linalg import spsolve

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import Region
from ccfem.slicing.layers.layer_stress import LayerStress
from ccfem.strategies.stress_tracing.band import STEP, Band
from ccfem.strategies.stress_tracing.stress_lines import plane_stress_at, stress_lines

_BENDING = 2.0
_HELD = 2.0
_FREE = 12.0
"""Lengths, mm: c, and l in members and in joints."""
_CLOSEST = 0.9
"""Share of their distance from each other that tracks keep."""
_ROUNDS = 2


def relaxed(
    lines: FloatArray, band: Band, stress: LayerStress, section: Region, share: FloatArray
) -> FloatArray:
    """Turn the tracks of a band towards the stress.

    Parameters
    ----------
    lines : (k, n, 2) array, mm
        Tracks along the points of the band.
    band : Band
    stress : LayerStress
    section : shapely (Multi)Polygon, mm
    share : (k, n) array
        Place of the tracks across the band, from left (1) to right (-1).

    Returns
    -------
    (k, n, 2) array, mm
    """
    along = np.roll(lines, -1, axis=1) - np.roll(lines, 1, axis=1)
    if not band.closed:
        along[:, [0, -1]] = np.diff(lines, axis=1)[:, [0, -1]]
    along = along / np.linalg.norm(along, axis=2, keepdims=True)
    normal = np.stack([-along[..., 1], along[..., 0]], axis=2)
    hold = (1.0 - band.free) / _HELD**2 + band.free / _FREE**2
    moved = np.zeros(lines.shape[:2])
    for _ in range(_ROUNDS):
        weight, slope = _wanted(lines + moved[..., None] * normal, band.closed, stress, section)
        slope += _differences(moved, band.closed) / STEP
        moved = np.stack(
            [_least(w, g, hold, band.closed) for w, g in zip(weight, slope, strict=True)]
        )
        moved = _apart(moved, band, share)
    return lines + moved[..., None] * normal


def _differences(values: FloatArray, closed: bool) -> FloatArray:
    """From each point of lines (k, n, ...) to the next."""
    if closed:
        return np.roll(values, -1, axis=1) - values
    return np.diff(values, axis=1)


def _wanted(
    lines: FloatArray, closed: bool, stress: LayerStress, section: Region
) -> tuple[FloatArray, FloatArray]:
    """Weight and wanted slope (k, n or n - 1) of every step of lines."""
    steps = _differences(lines, closed)
    middles = lines[:, : steps.shape[1]] + 0.5 * steps
    points = middles.reshape(-1, 2)
    found = stress_lines(plane_stress_at(stress, points, STEP))
    x, y = found.direction.T
    heading = np.arctan2(steps[..., 1], steps[..., 0])
    turn = np.arctan2(y, x).reshape(heading.shape) - heading
    turn = (turn + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    counts = found.defined & shapely.contains_xy(section, points)
    weight = np.where(counts.reshape(turn.shape), np.maximum(np.cos(2.0 * turn), 0.0), 0.0)
    return weight, np.where(weight > 0.0, np.tan(turn), 0.0)


def _least(weight: FloatArray, slope: FloatArray, hold: FloatArray, closed: bool) -> FloatArray:
    """Move (n,) of one line that minimises the sum."""
    here = eye_array(len(hold), format="csr")
    ahead = here[np.roll(np.arange(len(hold)), -1)]
    rise = (ahead - here)[: len(weight)] / STEP
    bend = (ahead - 2.0 * here + ahead.T)[slice(None) if closed else slice(1, -1)] / STEP**2
    matrix = rise.T @ (weight[:, None] * rise) + _BENDING**2 * (bend.T @ bend) + diags_array(hold)
    return np.asarray(spsolve(matrix.tocsc(), rise.T @ (weight * slope)))


def _apart(moved: FloatArray, band: Band, share: FloatArray) -> FloatArray:
    """Find the moves (k, n) nearest to the given ones that keep tracks apart."""
    count = len(moved)
    size = np.linalg.norm(band.half, axis=1)
    number = np.arange(count)[:, None]
    even = (1.0 - share) * size
    step = even[1:2] - even[:1] if count > 1 else 0.0 * even
    least = _CLOSEST * step * number
    place = even - moved - least  # from the left, to grow from track to track
    for column in np.flatnonzero((np.diff(place, axis=0) < 0.0).any(axis=0)):
        place[:, column] = isotonic_regression(place[:, column]).x
    mode = "wrap" if band.closed else "nearest"
    return np.asarray(gaussian_filter1d(even - place - least, 1.0 / STEP, axis=1, mode=mode))
