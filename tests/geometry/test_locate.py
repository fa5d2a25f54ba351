"""Point location against scipy, and stress at points against a linear field."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Problem, Support
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.materials import isotropic
from ccfem.geometry.locate import bucket, locate

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_simplex_found_is_the_one_that_holds_the_point(dimension: int) -> None:
    points = RNG.random((400, dimension)) * [50.0, 3.0, 20.0][:dimension]
    mesh = Delaunay(points)
    queries = RNG.random((5000, dimension)) * [50.0, 3.0, 20.0][:dimension]
    found, weights = locate(points, mesh.simplices.astype(np.int64), queries)
    expected = mesh.find_simplex(queries)
    inside = expected >= 0
    assert inside.sum() > 2000
    assert np.array_equal(found[inside], expected[inside])
    assert (found[~inside] == -1).all()
    assert (weights[~inside] == 0.0).all()
    assert weights.min() >= 0.0
    assert weights[inside].sum(axis=1) == pytest.approx(1.0)
    corners = points[mesh.simplices[found[inside]]]
    assert np.einsum("qk,qkd->qd", weights[inside], corners) == pytest.approx(queries[inside])


def test_points_slightly_outside_take_the_nearest_triangle() -> None:
    points = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    queries = np.array([[2.0, -0.4], [2.0, 4.4], [2.0, -0.6], [-3.0, 2.0], [np.nan, 1.0]])
    found, weights = locate(points, triangles, queries, reach=0.5)
    assert found.tolist() == [0, 1, -1, -1, -1]
    moved = np.einsum("qk,qkd->qd", weights[:2], points[triangles[found[:2]]])
    assert np.abs(moved - [[2.0, 0.0], [2.0, 4.0]]).max() < 0.5


def test_flat_triangles_hold_nothing() -> None:
    points = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [2.0, 0.0]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    found, _ = locate(points, triangles, np.array([[1.0, 1.0], [1.0, 0.5]]), reach=0.1)
    assert found.tolist() == [1, 1]


def test_nothing_to_find_and_nothing_to_find_it_in() -> None:
    points = np.eye(3)[:, :2]
    found, weights = locate(points, np.array([[0, 1, 2]]), np.zeros((0, 2)))
    assert found.shape == (0,)
    assert weights.shape == (0, 3)
    found, _ = locate(points, np.zeros((0, 3), dtype=np.int64), np.zeros((2, 2)))
    assert found.tolist() == [-1, -1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_buckets_hold_every_box_that_overlaps_their_cell(dimension: int) -> None:
    low = RNG.random((60, dimension)) * 10.0
    high = low + RNG.random((60, dimension)) * 3.0
    grid = bucket(low, high, 0.7)
    i, j, k = np.unravel_index(np.arange(len(grid.starts) - 1), tuple(grid.shape))
    corner = grid.origin + grid.cell * np.stack([i, j, k], axis=1)[:, :dimension]
    for c in range(len(corner)):
        overlap = ((low < corner[c] + grid.cell) & (high > corner[c])).all(axis=1)
        held = grid.items[grid.starts[c] : grid.starts[c + 1]]
        assert set(np.flatnonzero(overlap)) <= set(held)
        assert len(set(held)) == len(held)
        near = (low[held] <= corner[c] + grid.cell + 1e-9) & (high[held] >= corner[c] - 1e-9)
        assert near.all()


def test_buckets_of_a_huge_grid_get_larger_cells() -> None:
    low = np.array([[0.0, 0.0], [1e6, 1e6]])
    grid = bucket(low, low + 1.0, 0.01)
    assert len(grid.starts) - 1 <= 4_000_000


def linear_field() -> tuple[StressField, np.ndarray]:
    """Stress that is linear in x, y, z, and its gradient (3, 3, 3)."""
    mesh = box_mesh((4.0, 2.0, 3.0), (3, 2, 2))
    gradient = RNG.normal(size=(3, 3, 3))
    gradient += gradient.swapaxes(0, 1)
    problem = Problem(mesh, isotropic(1000.0, 0.3), (Support("x_min"),))
    nothing = np.zeros_like(mesh.points)
    nodal = np.einsum("ijd,nd->nij", gradient, mesh.points)
    record = SolveRecord("by hand", 0, 0.0, 0.0, 0.0, 0)
    cell = np.zeros((len(mesh.cells), 3, 3))
    return StressField(problem, "pull", nothing, cell, nodal, nothing, 0.0, record), gradient


def test_stress_at_points_of_a_linear_field_is_exact() -> None:
    stress, gradient = linear_field()
    points = RNG.random((200, 3)) * [4.0, 2.0, 3.0]
    expected = np.einsum("ijd,nd->nij", gradient, points)
    assert stress.at(points) == pytest.approx(expected, abs=1e-12)


def test_stress_outside_the_part_is_refused() -> None:
    stress, _ = linear_field()
    stress.at(np.array([[4.0005, 1.0, 1.0]]))
    with pytest.raises(InputError, match=r"1 of 2 points lie outside, the first at \[4\.1, 1\.0"):
        stress.at(np.array([[1.0, 1.0, 1.0], [4.1, 1.0, 1.0]]))
