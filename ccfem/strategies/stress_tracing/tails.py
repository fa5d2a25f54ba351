"""Direction in which the tracks of a main path leave the joint that it ends in.

They cross the joint and leave the section. Straight on, they would often run along another main
path, over its strands or between them. Of several turns the one is taken for which they run least
beside other strands, and least long in the section.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.geometry.shapes import Region
from ccfem.strategies.stress_tracing.band import STEP, Band, band, extension
from ccfem.strategies.stress_tracing.counts import places
from ccfem.strategies.stress_tracing.frame import FREE, Frame
from ccfem.strategies.stress_tracing.main_paths import MainPath

_TURNS = np.radians([0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0, 60.0, -60.0])
_NEAR = 0.75
"""Strands nearer than this share of the pitch lie beside each other,"""
_ALONG = np.cos(np.radians(30.0))
"""where they run within 30 degrees of each other."""
_LENGTH = 0.15
"""Cost of a length in the section, over that of a length beside other strands."""
_TURNING = 2.0
"""Cost of a turn of a radian, in mm beside other strands, for each strand."""
_OUTSIDE = 1.5
"""Length, mm, outside the section after which a tail has left it."""
_TIED = 1e-3
"""Share by which turns to the left and to the right must differ in cost, so that a path on an axis
of symmetry stays there."""
_NONE = np.zeros((0, 2))


def tail_turns(
    paths: Sequence[MainPath], frame: Frame, pitch: float, section: Region
) -> list[tuple[float, float]]:
    """Find the turns, radians to the left, of main paths beyond the joints that they end in.

    Parameters
    ----------
    pitch : float, mm
        Distance between neighbouring tracks.
    section : shapely (Multi)Polygon, mm

    Returns
    -------
    list of 2 floats
        At the start and at the end of each; 0 for a free end.
    """
    section = shapely.force_2d(section)
    shapely.prepare(section)
    bands = [band(path, frame) for path in paths]
    shares = [places(strip, pitch, section) for strip in bands]
    fixed = [_fixed(*arguments) for arguments in zip(paths, bands, shares, strict=True)]
    turns_of_tails = []
    for k, (path, strip, share) in enumerate(zip(paths, bands, shares, strict=True)):
        turns = [0.0, 0.0]
        if not path.closed:
            points, along = (
                np.concatenate([other[part] for n, other in enumerate(fixed) if n != k] or [_NONE])
                for part in (0, 1)
            )
            for side, end in enumerate((path.members[0].ends[0], path.members[-1].ends[1])):
                if end != FREE and len(points):
                    tree = cKDTree(points)
                    # Tails in every turn that is tried: their cost against what lies there, and for
                    # turning.
                    tails = _tails(strip, share, side)
                    costs = [
                        _cost(lines, tree, along, pitch, section) + _TURNING * len(lines) * abs(t)
                        for t, lines in zip(_TURNS, tails, strict=True)
                    ]
                    turns[side] = _best(costs)
        turns_of_tails.append((turns[0], turns[1]))
    return turns_of_tails


def _best(costs: Sequence[float]) -> float:
    """Turn of least cost; none if turns to the left and to the right cost the same."""
    best = int(np.argmin(costs))
    # Turns come in pairs behind the first one, which is none.
    other = best + 1 if best % 2 else best - 1
    alike = best > 0 and costs[other] <= (1.0 + _TIED) * costs[best]
    return 0.0 if alike else float(_TURNS[best])


def _fixed(path: MainPath, strip: Band, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (m, 2) of the tracks that do not depend on turns, and their directions (m, 2)."""
    first, last = strip.core.start, strip.core.stop
    if not path.closed:
        first = 0 if path.members[0].ends[0] == FREE else first
        last = len(strip.middle) if path.members[-1].ends[1] == FREE else last
    lines = strip.middle + share[..., None] * strip.half
    along = np.gradient(lines, axis=1)
    along = along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-12)
    kept = (np.abs(share) <= 1.0)[:, first:last]
    return lines[:, first:last][kept], along[:, first:last][kept]


def _tails(strip: Band, share: FloatArray, side: int) -> list[FloatArray]:
    """Lines (k, n, 2) behind the end of a band, for every turn."""
    core = np.column_stack([strip.middle, strip.half, strip.free])[strip.core]
    shares = share[:, strip.core]
    if side == 0:
        core, shares = core[::-1] * [1.0, 1.0, -1.0, -1.0, 1.0], -shares[:, ::-1]
        reach = STEP * strip.core.start
    else:
        reach = STEP * (len(strip.middle) - strip.core.stop)
    there = shares[:, -1:]
    there = there[np.abs(there[:, 0]) <= 1.0]
    ahead = [extension(core, reach, turn) for turn in _TURNS]
    return [tail[:, :2] + there[..., None] * tail[:, 2:4] for tail in ahead]


def _cost(
    lines: FloatArray, tree: cKDTree, along: FloatArray, pitch: float, section: Region
) -> float:
    """Length, mm, of lines (k, n, 2) beside others, plus a share of their length in the section."""
    inside = shapely.contains_xy(section, lines.reshape(-1, 2)).reshape(lines.shape[:2])
    beyond = round(_OUTSIDE / STEP) + 1
    total = 0.0
    for line, within in zip(lines, inside, strict=True):
        outside = np.convolve(~within, np.ones(beyond, dtype=int), mode="valid") == beyond
        stop = int(np.argmax(outside)) if outside.any() else len(line)
        if stop < 2:
            continue
        line, within = line[:stop], within[:stop]
        tangent = np.gradient(line, axis=0)
        tangent = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
        near = tree.query_ball_point(line, _NEAR * pitch)
        beside = [
            bool(within[n] and len(k) and (np.abs(along[k] @ tangent[n]) > _ALONG).any())
            for n, k in enumerate(near)
        ]
        total += STEP * (sum(beside) + _LENGTH * float(within.sum()))
    return total
