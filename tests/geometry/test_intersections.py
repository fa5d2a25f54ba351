"""Crossings against shapely and on exact degenerate shapes."""

import tracemalloc

import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st

from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation.indices.crossings import find_crossings


def count(*lines: list[tuple[float, float]]) -> int:
    points, offsets = pack([np.array(line, dtype=float) for line in lines])
    closed = np.array([line[0] == line[-1] and len(line) > 2 for line in lines])
    return len(find_crossings(points, offsets, closed))


CROSS = [(-2.0, 0.0), (2.0, 0.0)]


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        ([(0, -1), (0, 1)], 1),
        ([(0, 1), (0, 2)], 0),
        # Through a point of the other one, both ways, and through a common point.
        ([(0, -1), (0, 0), (0, 1)], 1),
        ([(0, -1), (0, 0), (1, -1)], 0),
        # An end on the line.
        ([(0, 1), (0, 0)], 0),
        ([(0, 0), (0, 1)], 0),
        # On top of each other for a while.
        ([(-1, 1), (-1, 0), (1, 0), (1, -1)], 0),
        ([(-1, 0), (1, 0)], 0),
        # There and back.
        ([(-1, 1), (0, -1), (1, 1)], 2),
    ],
)
def test_a_line_and_another_one(other: list[tuple[float, float]], expected: int) -> None:
    assert count(CROSS, other) == count(other, CROSS) == expected
    bent = [CROSS[0], (0.0, 0.0), CROSS[1]]
    assert count(bent, other) == count(other[::-1], bent[::-1]) == expected


def test_common_points_count_only_where_the_lines_change_sides() -> None:
    corner = [(-1.0, 0.0), (0.0, 0.0), (0.0, -1.0)]
    assert count(corner, [(1.0, 0.0), (0.0, 0.0), (0.0, 1.0)]) == 0
    assert count(corner, [(-1.0, -1.0), (0.0, 0.0), (1.0, 1.0)]) == 1
    assert count(corner, [(-1.0, -1.0), (0.0, 0.0), (-1.0, -2.0)]) == 0


def test_a_polyline_crosses_itself() -> None:
    assert count([(0, 0), (2, 2), (2, 0), (0, 2)]) == 1
    # Two loops through one point: once passing through each other there, once only touching.
    assert count([(0, 0), (1, 1), (1, -1), (0, 0), (-1, 1), (-1, -1), (0, 0)]) == 1
    assert count([(0, 0), (1, 1), (1, -1), (0, 0), (-1, -1), (-1, 1), (0, 0)]) == 0
    assert count([(-1, -1), (0, 0), (1, 1), (1, -1), (0, 0), (-1, 1)]) == 1


def test_a_closed_polyline_is_crossed_where_it_closes() -> None:
    square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)]
    assert count(square) == 0
    assert count(square, [(-1.0, -1.0), (1.0, 1.0)]) == 1
    assert count(square, [(-1.0, -1.0), (0.0, 0.0), (1.0, 1.0)]) == 1
    assert count(square, [(-1.0, 1.0), (0.0, 0.0), (1.0, -1.0)]) == 0
    assert count(square, [(-1.0, 1.0), (3.0, 1.0)]) == 2


def test_no_polyline_and_a_single_segment() -> None:
    assert (
        len(find_crossings(np.zeros((0, 2)), np.zeros(1, dtype=int), np.zeros(0, dtype=bool))) == 0
    )
    assert count(CROSS) == 0


def brute_force(points: np.ndarray, offsets: np.ndarray) -> set[tuple[int, int]]:
    first = np.setdiff1d(np.arange(len(points)), offsets[1:] - 1)
    segments = shapely.linestrings(np.stack([points[first], points[first + 1]], axis=1))
    i, j = shapely.STRtree(segments).query(segments, predicate="crosses")
    return {(int(first[a]), int(first[b])) for a, b in zip(i, j, strict=True) if a < b}


@given(st.integers(0, 10**6), st.integers(1, 6), st.floats(0.01, 30.0))
def test_random_polylines_cross_where_shapely_says(seed: int, lines: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    made = [rng.normal(size=(rng.integers(2, 30), 2)).cumsum(axis=0) for _ in range(lines)]
    points, offsets = pack([size * line for line in made])
    found = find_crossings(points, offsets, np.zeros(lines, dtype=bool))
    assert {(int(a), int(b)) for a, b in found} == brute_force(points, offsets)
    # The other way round there are as many.
    points, offsets = pack([size * line[::-1] for line in made[::-1]])
    assert len(find_crossings(points, offsets, np.zeros(lines, dtype=bool))) == len(found)


def test_memory_grows_with_the_number_of_points_alone() -> None:
    """Many points on straight lines: those of one line near each other are no pairs to look at."""
    along = np.linspace(0.0, 50.0, 5001)
    lines = [np.column_stack([along, np.full(len(along), 2.0 * k)]) for k in range(4)]
    across = np.array([[20.001, -1.0], [20.001, 7.0]])
    points, offsets = pack([*lines, across])
    tracemalloc.start()
    found = find_crossings(points, offsets, np.zeros(5, dtype=bool))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(found) == 4
    assert most < 2000 * len(points)
