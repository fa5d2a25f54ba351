"""Strands parallel to curves, and rings in what they leave."""

import numpy as np
import pytest
import shapely
from shapely import affinity

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


@pytest.mark.parametrize("angle", [0.0, 90.0, 180.0, 270.0])
def test_rings_of_equal_rests_keep_their_order_when_turned(angle):
    """Strands down the middle of a plate leave equal rests: that beside line 0 comes first."""
    plate = affinity.rotate(shapely.box(-10.0, -20.0, 10.0, 20.0), angle, origin=(0, 0))
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, s], [-s, c]])
    strands = [np.array([[x, -21.0], [x, 21.0]]) @ turn for x in (0.5, -0.5)]
    lines = grow(strands, plate, 1.0, 0.6, count=0)
    middles = np.array([line.mean(axis=0) @ turn.T for line in lines[2:]])
    half = len(middles) // 2
    assert half > 3
    assert (middles[:half, 0] > 1.0).all()
    assert (middles[half:, 0] < -1.0).all()
