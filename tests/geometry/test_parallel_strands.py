"""Strands parallel to curves, and rings in what they leave."""

import numpy as np
import shapely

from ccfem.geometry.parallel_strands import grow
from ccfem.geometry.polylines import is_closed
from ccfem.geometry.shapes import strings


def turns(ring):
    """Corners (k, 2) of a closed line, and the angles by which it turns there, degrees."""
    ways = np.diff(np.concatenate([ring, ring[1:2]]), axis=0)
    angle = np.degrees(np.arctan2(ways[:, 1], ways[:, 0]))
    return ring[1:], np.abs((np.diff(angle) + 180.0) % 360.0 - 180.0)


def test_rings_beside_ends_in_steps_are_smooth():
    # Thirty strands that end in steps of .8 mm along a slanted line; rings fill the rest.
    plate = shapely.box(0.0, 0.0, 60.0, 30.0)
    rows = np.arange(30) + 0.5
    strands = [np.array([[-1.0, y], [8.0 + 0.8 * y, y]]) for y in rows]
    lines = grow(strands, plate, 1.0, 0.6, count=0)
    covered = shapely.union_all(shapely.buffer(strings(lines), 0.5))
    assert plate.difference(covered).area < 0.01 * plate.area
    outer = [line for line in lines if is_closed(line) and np.ptp(line[:, 1]) > 28.0]
    assert len(outer) == 1
    # Nowhere on the slanted side, away from its ends, does the ring follow the steps.
    place, turn = turns(outer[0])
    slanted = (place[:, 0] < 35.0) & (np.abs(place[:, 1] - 15.0) < 11.0)
    assert slanted.any()
    assert turn[slanted].max() < 60.0
    for line in strings(lines):
        assert line.is_simple
