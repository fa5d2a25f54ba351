"""Free ends of strands, extended to what lies ahead."""

import numpy as np
import pytest
import shapely

from ccfem.geometry.parallel_strands import extend_free_ends, strips

REGION = shapely.box(0, -10, 20, 10)


def row(x, ends):
    return [np.array([[x, y], [end, y]]) for y, end in ends]


def test_ends_reach_the_border_ahead():
    lines = row(0.0, [(-1.0, 18.4), (0.0, 18.8), (1.0, 18.1)])
    led, rest = extend_free_ends(lines, REGION, 1.0, 0.6, 3.0)
    for line, before in zip(led, lines, strict=True):
        np.testing.assert_array_equal(line[:-1], before)
        np.testing.assert_allclose(line[-1, 0], 20.0, atol=0.05)
        assert line[-1, 0] <= 20.0
    assert rest.area == pytest.approx(REGION.difference(strips(led, 1.0)).area)
    back, _ = extend_free_ends([line[::-1] for line in lines], REGION, 1.0, 0.6, 3.0)
    for line, other in zip(led, back, strict=True):
        np.testing.assert_allclose(other[::-1], line, atol=1e-9)


def test_end_stops_at_the_side_of_the_strand_ahead():
    across = np.array([[15.0, -10.0], [15.0, 10.0]])
    (_, led), _ = extend_free_ends(
        [across, np.array([[0.0, 0.0], [13.0, 0.0]])], REGION, 1.0, 0.6, 3.0
    )
    assert led[-1, 0] == pytest.approx(14.5, abs=0.05)


def test_end_too_far_from_anything_stays():
    lines = [np.array([[0.0, 0.0], [15.0, 0.0]])]
    np.testing.assert_array_equal(extend_free_ends(lines, REGION, 1.0, 0.6, 3.0)[0][0], lines[0])


def test_a_strip_between_strands_side_by_side_is_not_entered():
    """A front that closes at 6 degrees: its strip takes a strand along its middle."""
    slanted = np.array([[0.0, 3.0], [20.0, 0.9]])
    lines = [np.array([[0.0, 0.0], [20.0, 0.0]]), slanted, np.array([[0.0, 1.1], [6.0, 1.1]])]
    led, _ = extend_free_ends(lines, REGION, 1.0, 0.6, 12.0)
    np.testing.assert_array_equal(led[2], lines[2])


def test_strands_led_on_towards_each_other_share_the_room():
    """Where both would take the same place the longer goes through; no area is taken twice."""
    left, right = row(0.0, [(0.0, 9.0)]), row(20.0, [(0.3, 11.0)])
    led, _ = extend_free_ends([*left, *right], shapely.box(0, -2, 20, 2), 1.0, 0.6, 3.0)
    areas = [strips([line], 1.0) for line in led]
    assert areas[0].intersection(areas[1]).area < 1e-9


def test_closed_lines_stay():
    ring = np.array([[5.0, 0.0], [8.0, 0.0], [8.0, 3.0], [5.0, 0.0]])
    np.testing.assert_array_equal(extend_free_ends([ring], REGION, 1.0, 0.6, 3.0)[0][0], ring)
    assert extend_free_ends([], REGION, 1.0, 0.6, 3.0) == ([], REGION)
