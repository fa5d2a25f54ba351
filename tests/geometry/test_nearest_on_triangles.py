"""Nearest points of a surface, against a plane, and against sampled triangles."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

from ccfem.base.errors import InputError
from ccfem.geometry.locate import nearest_on_triangles


def wavy(count=400):
    rng = np.random.default_rng(5)
    plane = rng.uniform(0.0, 20.0, (count, 2))
    triangles = Delaunay(plane).simplices
    return np.column_stack([plane, np.sin(0.4 * plane[:, 0])]), triangles


def test_over_a_square_the_nearest_point_is_the_foot_or_on_the_border():
    points = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    queries = np.array([[1.0, 3.0, 2.0], [-3.0, 2.0, 4.0], [7.0, 8.0, 0.0], [2.0, 2.0, -1.0]])
    found = nearest_on_triangles(points, triangles, queries)
    np.testing.assert_allclose(found.distance, [2.0, 5.0, 5.0, 1.0])
    np.testing.assert_allclose(found.points, [[1, 3, 0], [0, 2, 0], [4, 4, 0], [2, 2, 0]])


def test_no_sample_of_the_surface_is_nearer():
    points, triangles = wavy()
    queries = np.random.default_rng(6).uniform([2, 2, -2], [18, 18, 3], (200, 3))
    found = nearest_on_triangles(points, triangles, queries)
    share = np.random.default_rng(7).dirichlet(np.ones(3), 300)
    samples = np.einsum("sk,tkd->tsd", share, points[triangles]).reshape(-1, 3)
    sampled, _ = cKDTree(samples).query(queries)
    assert (found.distance <= sampled + 1e-9).all()
    assert (sampled - found.distance).max() < 0.35
    np.testing.assert_allclose(found.weights.sum(axis=1), 1.0)
    assert found.weights.min() >= 0.0


def test_large_triangles_beside_many_small_ones_are_found():
    """A wall of two triangles, and a fine patch beside it whose middles are all nearer."""
    small, corners = wavy(4000)
    small = small * [0.1, 0.1, 0.0] + [0.0, 0.0, 1.0]
    wall = np.array([[-500.0, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]])
    points = np.concatenate([small, wall])
    triangles = np.concatenate([corners, len(small) + np.array([[0, 1, 2], [0, 2, 3]])])
    queries = np.random.default_rng(8).uniform([0.1, 0.1, 0.0], [1.9, 1.9, 1.0], (300, 3))
    found = nearest_on_triangles(points, triangles, queries)
    np.testing.assert_allclose(found.distance, np.minimum(queries[:, 2], 1.0 - queries[:, 2]))
    assert (found.triangle >= len(corners)).any()


def test_a_fan_of_many_slivers_has_its_nearest_one_found():
    """Five hundred slivers meet in a corner far away: their middles say little of what is near."""
    rim = np.linspace(0.0, 10.0, 501)
    points = np.concatenate(
        [[[200.0, 5.0, 0.0]], np.column_stack([np.zeros(501), rim, np.zeros(501)])]
    )
    triangles = np.column_stack([np.zeros(500, int), np.arange(1, 501), np.arange(2, 502)])
    queries = np.column_stack([np.full(50, 1.0), np.linspace(0.5, 9.5, 50), np.zeros(50)])
    found = nearest_on_triangles(points, triangles, queries)
    np.testing.assert_allclose(found.distance, 0.0, atol=1e-9)


def test_far_from_a_long_strip_the_nearest_point_is_exact():
    plane = np.random.default_rng(9).uniform(0.0, 1.0, (200, 2))
    plane = np.concatenate([plane, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]])
    triangles = Delaunay(plane).simplices
    points = np.column_stack([plane * [4.0, 500.0], np.zeros(len(plane))])
    queries = np.random.default_rng(10).normal(0.0, 3000.0, (300, 3))
    found = nearest_on_triangles(points, triangles, queries)
    inside = np.clip(queries, [0.0, 0.0, 0.0], [4.0, 500.0, 0.0])
    np.testing.assert_allclose(found.points, inside, atol=1e-9)
    np.testing.assert_allclose(found.distance, np.linalg.norm(inside - queries, axis=1))


def test_triangles_without_area_are_passed_over():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    found = nearest_on_triangles(
        points, np.array([[0, 0, 1], [0, 1, 2], [0, 2, 3]]), points[[1]] - [[0, 2, 0]]
    )
    assert found.triangle.tolist() == [2]
    np.testing.assert_allclose(found.points, points[[1]])


@pytest.mark.parametrize(
    ("triangles", "query", "wanted"),
    [
        ([[0, 1, 2]], [0.0, 0.0, 0.0], "area at a finite distance; got 1 tri"),
        (np.zeros((0, 3), int), [0.0, 0.0, 0.0], "area at a finite distance; got 0 tri"),
        ([[0, 1, 3]], [1e200, 0.0, 0.0], "a surface with area at a finite distance"),
        ([[0, 1, 3]], [np.nan, 0.0, 0.0], "finite points"),
    ],
)
def test_nothing_is_nearest(triangles, query, wanted):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    with pytest.raises(InputError, match=wanted):
        nearest_on_triangles(points, np.array(triangles), np.array([query]))
