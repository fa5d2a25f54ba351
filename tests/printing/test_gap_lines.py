"""Lines in what contour and zigzag do not reach: places and widths known from the shape."""

import numpy as np
import pytest
import shapely

from ccfem.printing.matrix_lines import gap_lines

WIDTH = 0.8


def contour(section):
    """A line half a width inside each border of a section without corners that it would lose."""
    inner = shapely.buffer(section, -0.5 * WIDTH, join_style="mitre")
    return [np.array(ring.coords) for ring in (inner.exterior, *inner.interiors)]


def test_a_wall_of_three_widths_gets_its_middle_line():
    # 2.4 mm wide: two lines at its sides leave .8 mm in the middle, from .8 mm on at both ends.
    wall = shapely.box(0.0, 0.0, 20.0, 2.4)
    (line,), (width,) = gap_lines(wall, contour(wall), WIDTH)
    np.testing.assert_allclose(line[:, 1], 1.2, atol=1e-6)
    np.testing.assert_allclose(np.sort(line[:, 0])[[0, -1]], [1.2, 18.8], atol=0.1)
    assert width == pytest.approx(0.8, rel=0.02)


def test_a_ring_gets_a_ring():
    ring = shapely.Point(0, 0).buffer(6.0, 64) - shapely.Point(0, 0).buffer(3.7, 64)
    lines, widths = gap_lines(ring, contour(ring), WIDTH)
    drawn = shapely.MultiLineString(lines)
    # Between 4.5 and 5.2: a circle of radius 4.85 and .7 wide.
    assert drawn.length == pytest.approx(2.0 * np.pi * 4.85, rel=0.01)
    np.testing.assert_allclose(np.linalg.norm(np.concatenate(lines), axis=1), 4.85, atol=0.05)
    assert np.mean(widths) == pytest.approx(0.7, rel=0.02)


def test_what_is_full_or_too_narrow_gets_nothing():
    for side in (1.6, 1.6 + 0.2 * WIDTH):
        wall = shapely.box(0.0, 0.0, 20.0, side)
        assert gap_lines(wall, contour(wall), WIDTH) == ([], [])
