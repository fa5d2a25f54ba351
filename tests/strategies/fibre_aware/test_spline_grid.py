import numpy as np
import pytest

from ccfem.strategies.fibre_aware.spline_grid import SplineGrid


@pytest.fixture
def grid_and_points(rng):
    points = rng.uniform(-5.0, 9.0, (300, 2))
    c, s = np.cos(0.4), np.sin(0.4)
    return SplineGrid.over(points, np.array([0.3, -0.2]), np.array([[c, s], [-s, c]]), 2.0), points


def test_quadratic_fields_are_exact(grid_and_points):
    # Quadratic B-splines span all quadratic polynomials.
    grid, points = grid_and_points
    x, y = points.T
    wanted = 1.0 + 2.0 * x - 3.0 * y + 0.5 * x * y - 0.25 * y * y
    matrix = grid.values(points).toarray()
    field = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    np.testing.assert_allclose(matrix @ field, wanted, atol=1e-9)


def test_splines_add_up_to_one(grid_and_points):
    grid, points = grid_and_points
    ones = np.ones(len(grid))
    np.testing.assert_allclose(grid.values(points) @ ones, 1.0, rtol=1e-13)
    for slope in grid.slopes(points):
        np.testing.assert_allclose(slope @ ones, 0.0, atol=1e-13)


def test_slopes_are_those_of_the_values(grid_and_points, rng):
    grid, points = grid_and_points
    field, inside = rng.standard_normal(len(grid)), points[:50]
    # Away from the sides of the squares, where the second derivative jumps.
    place = (inside - grid.centre) @ grid.axes.T / grid.size
    inside = inside[(np.abs(place - np.round(place)) > 0.01).all(axis=1)]
    for axis, slope in enumerate(grid.slopes(inside)):
        step = 1e-4 * np.eye(2)[axis]
        difference = (grid.values(inside + step) - grid.values(inside - step)) @ field / 2e-4
        np.testing.assert_allclose(slope @ field, difference, atol=1e-7)


def test_points_elsewhere_are_refused(grid_and_points):
    grid, points = grid_and_points
    with pytest.raises((ValueError, IndexError)):
        grid.values(points + 100.0)


def test_laplacian_is_symmetric_and_blind_to_constants(grid_and_points):
    laplacian = grid_and_points[0].laplacian
    assert abs(laplacian - laplacian.T).max() == 0.0
    np.testing.assert_allclose(laplacian @ np.ones(laplacian.shape[0]), 0.0, atol=1e-12)
    assert np.linalg.eigvalsh(laplacian.toarray()).min() > -1e-9
