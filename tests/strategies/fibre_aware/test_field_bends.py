"""Bends of levels, against circles."""

import numpy as np
import pytest

from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.stream_design import FieldBends

ANGLE = 0.4


def bends_at(points, radius):
    """Cost of bends at points that each have the same fibre, and a matrix to values there."""
    axes = np.array([[np.cos(ANGLE), np.sin(ANGLE)], [-np.sin(ANGLE), np.cos(ANGLE)]])
    grid = SplineGrid.over(points, np.array([1.0, 2.0]), axes, 1.5)
    x, y, *seconds = grid.derivatives(points)
    share = np.full(len(points), 1.0 / len(points))
    return FieldBends((x, y), tuple(seconds), share, radius), grid.values(points)


def circles(points, values):
    """Coefficients of half of the squared distance from the origin: quadratic splines hold it."""
    wanted = 0.5 * (points**2).sum(axis=1)
    return np.linalg.lstsq(values.toarray(), wanted, rcond=None)[0]


@pytest.mark.parametrize("radius", [3.0, 6.0, 20.0])
def test_circles_cost_what_they_are_tighter(rng, radius):
    points = rng.uniform(-12.0, 12.0, (3000, 2))
    points = points[np.linalg.norm(points, axis=1) > 2.0]
    bends, values = bends_at(points, radius)
    r = np.linalg.norm(points, axis=1)
    excess = np.maximum(radius / r - 1.0, 0.0)
    exact = np.mean(r * (np.sqrt(1.0 + excess**2) - 1.0))
    assert bends.cost(circles(points, values)) == pytest.approx(exact, rel=1e-2)


def test_slope_is_that_of_finite_differences(rng):
    points = rng.uniform(-8.0, 8.0, (500, 2))
    bends, values = bends_at(points, 6.0)
    field = circles(points, values)
    field = field + 0.3 * rng.standard_normal(len(field))
    direction = rng.standard_normal(len(field))
    ends = [bends.cost(field + step * direction) for step in (1e-5, -1e-5)]
    assert bends.slope(field) @ direction == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5)


def test_straight_levels_cost_nothing(rng):
    points = rng.uniform(-8.0, 8.0, (2000, 2))
    bends, values = bends_at(points, 1e3)
    field = np.linalg.lstsq(values.toarray(), points @ [0.5, -0.8], rcond=None)[0]
    assert bends.cost(field) == pytest.approx(0.0, abs=1e-12)
