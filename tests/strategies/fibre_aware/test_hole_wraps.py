"""Strands led round holes, against circles about them."""

import numpy as np
import pytest
import shapely

from ccfem.body.meshing.planform import extrude
from ccfem.machine import Machine
from ccfem.paths.folds import folds_in
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies.fibre_aware.hole_wraps import led_round_holes
from ccfem.strategies.fibre_aware.stream_paths import slid_out

HOLE = shapely.Point(0.0, 0.0).buffer(6.0, 64)
PLATE = shapely.box(-40.0, -40.0, 40.0, 40.0) - HOLE


def legs(*degrees):
    """Pairs of strands that touch the circle 6.5 mm about the hole at an angle, and end there."""
    lines = []
    for angle in np.radians(degrees):
        tip = 6.5 * np.array([np.cos(angle), np.sin(angle)])
        start = tip - 30.0 * np.array([np.sin(angle), -np.cos(angle)])
        leg = np.linspace(start, tip, 41)
        lines += [leg, leg * [-1.0, 1.0]]
    return lines


def arch(radius, degrees=120.0):
    """A strand that is led round the hole already, and leaves its circle at an angle."""
    angle = np.radians(np.linspace(degrees, 180.0 - degrees, 60))
    top = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    start = top[0] - 30.0 * np.array([np.sin(angle[0]), -np.cos(angle[0])])
    return np.concatenate([[start], top, [start * [-1.0, 1.0]]])


def test_strands_that_meet_the_wall_from_both_sides_become_one():
    """Round a free wall: half a width off it, from one leg to the other."""
    (led,) = led_round_holes(legs(180.0), PLATE, 1.0, 2.9)
    np.testing.assert_allclose(np.sort(led[[0, -1], 0]), [-6.5, 6.5])
    over = led[led[:, 1] > 0.0]
    np.testing.assert_allclose(np.linalg.norm(over, axis=1), 6.5, atol=0.15)


def test_strands_across_the_wall_stay():
    """Two that meet the wall at a right angle, and a hole too small to be led round."""
    across = [np.array([(-35.0, y), (-6.5, y)]) * [s, 1.0] for y in (0.0,) for s in (1.0, -1.0)]
    assert len(led_round_holes(across, PLATE, 1.0, 2.9)) == 2
    assert len(led_round_holes(legs(180.0), PLATE, 1.0, 7.0)) == 2
    assert led_round_holes([], PLATE, 1.0, 2.9) == []


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_so_many_strands_are_led_round_as_asked_for(levels):
    assert len(led_round_holes(legs(180.0, 150.0), PLATE, 1.0, 2.9, levels)) == 4 - levels


def test_strands_at_the_wall_make_room():
    """Two pairs under a strand at the wall: all three lie about circles a width apart."""
    width, machine = 1.0, Machine()
    layer = Planar(count=1).cut(extrude(PLATE, 2.0, 4.0))[0]
    lines = led_round_holes([arch(6.5), arch(7.6), *legs(180.0, 150.0)], PLATE, width, 2.9)
    assert len(lines) == 4
    paths = slid_out(Toolpaths.from_plane(lines, layer), layer, machine, 0.5, 2, 0.0)
    tops = np.sort([path[np.argmin(np.abs(path[:, 0]) - path[:, 1]), 1] for path in paths])
    assert tops[0] == pytest.approx(6.5, abs=0.1)
    assert np.diff(tops).min() > 0.97
    assert tops[-1] < 6.5 + 3.0 + 0.5
    assert not folds_in(paths, machine).counts.any()
