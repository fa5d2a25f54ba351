import numpy as np
import pytest

from ccfem.strategies.mps import clear_ends

WALL = np.array([[10.0, -20.0], [10.0, 20.0]])


@pytest.mark.parametrize("degrees", [90.0, 60.0, 30.0])
def test_an_end_stops_a_width_before_the_strand_that_it_runs_into(degrees):
    """Square to the wall the last half width goes; slanted, that over the sine of the angle."""
    way = np.array([np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    tip = np.array([9.5, 0.0])
    strand = np.array([tip - 15.0 * way, tip])
    wall, cut = clear_ends([WALL, strand], 1.0)
    np.testing.assert_array_equal(wall, WALL)
    np.testing.assert_allclose(cut[0], strand[0])
    np.testing.assert_allclose(10.0 - cut[-1, 0], 1.0, atol=0.01)
    np.testing.assert_allclose((cut[-1] - cut[0]) @ [-way[1], way[0]], 0.0, atol=1e-9)


def test_neighbours_and_other_ends_hold_nothing_off():
    beside = [np.array([[0.0, y], [9.0, y]]) for y in (0.0, 0.8, 1.6)]
    facing = [np.array([[0.0, 5.0], [4.0, 5.0]]), np.array([[4.4, 5.0], [9.0, 5.0]])]
    ring = np.array([[0.0, 8.0], [5.0, 8.0], [5.0, 12.0], [0.0, 12.0], [0.0, 8.0]])
    lines = [*beside, *facing, ring]
    for line, same in zip(clear_ends(lines, 1.0), lines, strict=True):
        np.testing.assert_array_equal(line, same)
    near = np.array([[0.0, 0.0], [9.5, 0.0]])
    assert len(clear_ends([WALL, near], 1.0, first=2)[1]) == 2
    np.testing.assert_array_equal(clear_ends([WALL, near], 1.0, first=2)[1], near)
