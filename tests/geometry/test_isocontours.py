"""Isocurves: against circles and straight lines, and the search against the plain one."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.spatial import Delaunay
from shapely import LineString

from ccfem.geometry.isocontours import isocontours, least_distance
from ccfem.paths.fields.layer_elements import Surface
from ccfem.paths.fields.scalar import extract_levels, levels_at, start_count


def square(count: int = 25, side: float = 20.0, seed: int = 0) -> Surface:
    grid = np.linspace(-side / 2, side / 2, count)
    points = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    inner = (np.abs(points) < side / 2 - 1e-9).all(axis=1)
    jitter = np.random.default_rng(seed).uniform(-0.2, 0.2, points.shape) * side / count
    points = points + np.where(inner[:, None], jitter, 0.0)
    return Surface(points, Delaunay(points).simplices)


def test_circles() -> None:
    surface = square(count=60)
    radius = np.hypot(*surface.points.T)
    curves = isocontours(surface.points, surface.triangles, radius, 2.0, 2.0)
    for level, line in zip(curves.level, curves.lines(), strict=True):
        np.testing.assert_allclose(np.hypot(*line.T), 2.0 + 2.0 * level, atol=0.06)
        if 2.0 + 2.0 * level < 9.9:
            np.testing.assert_array_equal(line[0], line[-1])
            assert LineString(line).length == pytest.approx(2 * np.pi * (2 + 2 * level), rel=0.02)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), step=st.floats(0.3, 3.0))
def test_every_curve_is_simple_and_ends_on_the_boundary(seed: int, step: float) -> None:
    surface = square(count=18, seed=seed)
    random = np.random.default_rng(seed)
    values = sum(
        np.sin(surface.points @ random.normal(0, 0.3, 2) + random.uniform(0, 6)) for _ in range(4)
    )
    curves = isocontours(surface.points, surface.triangles, values, float(values.min()), step)
    np.testing.assert_allclose(
        curves.interpolate(values),
        values.min() + step * np.repeat(curves.level, np.diff(curves.offsets)),
        atol=1e-6,
    )
    for line in curves.lines():
        assert LineString(line).is_simple
        if not np.array_equal(line[0], line[-1]):
            assert np.abs(line[[0, -1]]).max(axis=1) == pytest.approx([10.0, 10.0])


def test_levels_exactly_through_nodes() -> None:
    surface = square(count=11, seed=3)
    grid = np.round(surface.points[:, 0])
    curves = isocontours(surface.points, surface.triangles, grid, -5.0, 1.0)
    assert all(LineString(line).is_simple for line in curves.lines())


def plain_search(surface: Surface, values: np.ndarray, width: float) -> int:
    """Steps 3 to 5 of the paper, with shapely's distances."""

    def distance(count: int) -> float:
        curves = levels_at(surface, values, count)
        lines = [LineString(line) for line in curves.lines()]
        pairs = [
            a.distance(b)
            for i, a in enumerate(lines)
            for j, b in enumerate(lines)
            if curves.level[j] - curves.level[i] == 1
        ]
        return min([*pairs, 2.0 * width])

    count = start_count(surface, values, width)
    d = distance(count)
    while d > width:
        count = int(np.ceil(count * d / width))
        d = distance(count)
    while count > 1 and not d > width:
        count -= 1
        d = distance(count)
    return count


@pytest.mark.parametrize("seed", range(4))
def test_the_search_finds_the_number_of_the_plain_search(seed: int) -> None:
    surface = square(count=16, seed=seed)
    random = np.random.default_rng(seed)
    values = surface.points @ random.normal(0, 1, 2)
    values = values + 2.0 * np.sin(surface.points @ random.normal(0, 0.3, 2))
    curves = extract_levels(surface, values, 1.0)
    expected = levels_at(surface, values, plain_search(surface, values, 1.0))
    np.testing.assert_array_equal(curves.points, expected.points)


def test_least_distance_of_straight_lines() -> None:
    surface = square()
    curves = isocontours(surface.points, surface.triangles, surface.points[:, 0], -9.0, 1.5)
    found = least_distance(curves, 4.0, 0.0)
    assert found == pytest.approx(1.5, rel=1e-6)


def test_halving_the_width_doubles_the_curves_of_a_linear_field() -> None:
    surface = square()
    values = surface.points @ np.array([0.3, 0.1])
    wide = len(extract_levels(surface, values, 1.0).level)
    narrow = len(extract_levels(surface, values, 0.5).level)
    assert narrow == pytest.approx(2 * wide, abs=1)
    assert wide * 1.0 == pytest.approx(np.ptp(values) / np.hypot(0.3, 0.1), abs=1.0)


def test_a_constant_field_has_no_isocurve() -> None:
    surface = square()
    assert len(extract_levels(surface, np.ones(len(surface.points)), 1.0).level) == 0
