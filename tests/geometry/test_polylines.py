"""Arc length, resampling, and turning against shapely and exact shapes."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from ccfem.geometry.polylines import (
    along_line,
    arc_lengths,
    between,
    inner_points,
    is_closed,
    lengths,
    line_length,
    merge_repeated,
    middle_of_longest_run,
    pack,
    point_at,
    points_along,
    resample,
    runs,
    sample_at,
    sample_midpoints,
    starts_segment,
    straight_pieces,
    subdivide,
    turning_angles,
)

RNG = np.random.default_rng(7)
LINES = [RNG.normal(size=(n, 2)).cumsum(axis=0) for n in (2, 3, 17, 60)]

coordinates = st.floats(-100.0, 100.0).map(lambda x: round(x, 3))
polylines = st.integers(2, 12).flatmap(lambda n: arrays(float, (n, 2), elements=coordinates))


def circle(radius: float, count: int) -> np.ndarray:
    angle = np.linspace(0.0, 2.0 * np.pi, count + 1)
    line = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    line[-1] = line[0]
    return line


def test_lengths_are_those_of_shapely() -> None:
    points, offsets = pack(LINES)
    assert lengths(points, offsets) == pytest.approx([shapely.LineString(x).length for x in LINES])


def test_arc_lengths_start_anew_on_each_polyline() -> None:
    points, offsets = pack(
        [np.array([[0.0, 0.0], [3.0, 4.0]]), np.array([[9.0, 9.0], [9.0, 11.0]])]
    )
    assert arc_lengths(points, offsets).tolist() == [0.0, 5.0, 0.0, 2.0]


def test_no_polylines() -> None:
    points, offsets = pack([])
    assert points.shape == (0, 2)
    assert offsets.tolist() == [0]
    assert lengths(points, offsets).shape == (0,)
    assert arc_lengths(points, offsets).shape == (0,)
    assert resample(points, offsets, 1.0)[1].tolist() == [0]
    assert sample_midpoints(points, offsets, 1.0)[0].shape == (0, 2)
    assert turning_angles(points, offsets, np.zeros(0, dtype=bool)).shape == (0,)
    assert merge_repeated(points, offsets)[1].tolist() == [0]
    assert subdivide(points, offsets, 1.0)[1].tolist() == [0]


@pytest.mark.parametrize("step", [0.3, 1.0, 50.0])
def test_resampling_takes_equal_steps_of_arc_length(step: float) -> None:
    points, offsets = resample(*pack(LINES), step)
    for k, line in enumerate(LINES):
        found = points[offsets[k] : offsets[k + 1]]
        curve = shapely.LineString(line)
        parts = max(1, round(curve.length / step))
        expected = curve.interpolate(np.linspace(0.0, curve.length, parts + 1))
        assert found == pytest.approx(shapely.get_coordinates(expected), abs=1e-9)
        assert np.array_equal(found[0], line[0])
        assert np.array_equal(found[-1], line[-1])


def test_resampling_keeps_closed_curves_closed() -> None:
    points, _ = resample(*pack([circle(10.0, 500)]), 1.0)
    assert np.array_equal(points[0], points[-1])
    assert np.hypot(*points.T) == pytest.approx(10.0, abs=1e-3)


def test_sampling_past_the_ends_gives_the_ends() -> None:
    points, offsets = pack(LINES[:2])
    found, segment = sample_at(points, offsets, np.array([0, 0, 1]), np.array([-1.0, 1e9, 1e9]))
    assert found == pytest.approx(np.stack([LINES[0][0], LINES[0][-1], LINES[1][-1]]))
    assert segment.tolist() == [0, 0, 3]


def test_midpoints_carry_the_length_and_the_direction() -> None:
    corner = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 0.0], [4.0, 6.0]])
    points, tangents, weights, line = sample_midpoints(*pack([LINES[2], corner]), 1.0)
    total = shapely.LineString(LINES[2]).length
    assert weights[line == 0].sum() == pytest.approx(total)
    assert weights[line == 1] == pytest.approx(np.ones(10))
    assert points[line == 1][:, 0] == pytest.approx([0.5, 1.5, 2.5, 3.5, 4, 4, 4, 4, 4, 4])
    assert tangents[line == 1] == pytest.approx(np.array([[1, 0]] * 4 + [[0, 1]] * 6))


def test_a_polyline_of_no_length_has_no_midpoint() -> None:
    dot = np.array([[1.0, 1.0], [1.0, 1.0]])
    _, _, weights, line = sample_midpoints(*pack([dot, LINES[0], dot]), 0.5)
    assert set(line) == {1}
    assert weights.sum() == pytest.approx(shapely.LineString(LINES[0]).length)


@pytest.mark.parametrize("count", [3, 4, 7, 100])
def test_a_regular_polygon_turns_by_the_same_angle_everywhere(count: int) -> None:
    points, offsets = pack([circle(5.0, count)])
    closed = turning_angles(points, offsets, np.array([True]))
    assert closed[:-1] == pytest.approx(2.0 * np.pi / count)
    assert closed[-1] == 0.0
    opened = turning_angles(points, offsets, np.array([False]))
    assert opened[1:-1] == pytest.approx(2.0 * np.pi / count)
    assert opened[0] == opened[-1] == 0.0


def test_turning_is_the_same_in_space() -> None:
    points, offsets = pack(LINES)
    closed = np.zeros(len(LINES), dtype=bool)
    turn, _ = np.linalg.qr(RNG.normal(size=(3, 3)))
    space = np.pad(points, ((0, 0), (0, 1))) @ turn
    plane_turning = turning_angles(points, offsets, closed)
    assert turning_angles(space, offsets, closed) == pytest.approx(plane_turning, abs=1e-7)
    assert lengths(space, offsets) == pytest.approx(lengths(points, offsets))


def test_a_hairpin_turns_by_half_a_turn() -> None:
    points, offsets = pack([np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])])
    assert turning_angles(points, offsets, np.array([False]))[1] == pytest.approx(np.pi)


def test_a_line_without_points_turns_nowhere() -> None:
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    points, offsets = pack([corner, np.zeros((0, 2)), corner, np.zeros((0, 2))])
    found = turning_angles(points, offsets, np.zeros(4, dtype=bool))
    assert found == pytest.approx([0.0, np.pi / 2, 0.0, 0.0, np.pi / 2, 0.0])


def test_repeated_points_are_merged() -> None:
    a = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1e-9], [2.0, 0.0]])
    points, offsets, kept = merge_repeated(*pack([a, a[:2]]), tolerance=1e-6)
    assert points.tolist() == [[0, 0], [1, 0], [2, 0], [0, 0]]
    assert offsets.tolist() == [0, 3, 4]
    assert kept.tolist() == [0, 2, 4, 5]


def test_subdividing_keeps_points_and_lengths() -> None:
    points, offsets = pack(LINES)
    finer, ends, segment = subdivide(points, offsets, 0.25)
    assert lengths(finer, ends) == pytest.approx(lengths(points, offsets))
    steps = np.hypot(*np.diff(finer, axis=0).T)
    steps = np.delete(steps, ends[1:-1] - 1)
    assert steps.max() <= 0.25 + 1e-12
    first = np.concatenate([[True], np.diff(segment) > 0])
    assert np.array_equal(finer[first], points)


@given(polylines, st.floats(0.0, 1.0))
def test_point_at_an_arc_length_is_that_of_shapely(line: np.ndarray, share: float) -> None:
    curve = shapely.LineString(line)
    expected = curve.interpolate(share, normalized=True)
    assert point_at(line, share * curve.length) == pytest.approx([expected.x, expected.y], abs=1e-6)


@given(polylines, st.lists(st.floats(0.01, 0.99), max_size=4))
def test_parts_between_arc_lengths_make_up_the_line(line: np.ndarray, shares: list[float]) -> None:
    total = shapely.LineString(line).length
    cuts = [0.0, *sorted({share * total for share in shares}), total]
    pieces = [between(line, *ends) for ends in pairwise(cuts)]
    assert sum(shapely.LineString(p).length for p in pieces) == pytest.approx(total, abs=1e-9)
    assert np.array_equal(pieces[0][0], line[0])
    assert pieces[-1][-1] == pytest.approx(line[-1], abs=1e-9)
    for a, b in pairwise(pieces):
        assert np.array_equal(a[-1], b[0])


def test_part_of_a_line_between_two_arc_lengths() -> None:
    line = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    assert between(line, 1.0, 3.0).tolist() == [[1, 0], [2, 0], [2, 1]]


@given(polylines, st.floats(-np.pi, np.pi), coordinates, st.floats(0.5, 10.0))
def test_resampling_moves_with_the_line(
    line: np.ndarray, angle: float, shift: float, step: float
) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    here, _ = resample(*pack([line]), step)
    there, _ = resample(*pack([line @ turn.T + shift]), step)
    # The number of steps may only differ where the length is a whole number of half steps.
    total = shapely.LineString(line).length
    if abs(total / step % 1.0 - 0.5) > 1e-6:
        assert there == pytest.approx(here @ turn.T + shift, abs=1e-6)


def test_masks_of_segments_and_inner_points():
    """Polylines of 3, 0, 1 and 4 points, the last one closed."""
    offsets = np.array([0, 3, 3, 4, 8])
    assert starts_segment(offsets).astype(int).tolist() == [1, 1, 0, 0, 1, 1, 1, 0]
    closed = np.array([False, True, False, True])
    assert inner_points(offsets, closed).astype(int).tolist() == [0, 1, 0, 0, 1, 1, 1, 0]
    assert starts_segment(np.array([0])).shape == (0,)
    assert starts_segment(np.array([0, 0])).shape == (0,)


@given(polylines)
def test_one_line_is_measured_as_many_are(line):
    points, offsets = pack([line])
    np.testing.assert_allclose(along_line(line), arc_lengths(points, offsets), atol=1e-9)
    assert line_length(line) == pytest.approx(shapely.LineString(line).length, abs=1e-9)
    assert is_closed(np.concatenate([line, line[:1]]))
    assert not is_closed(np.concatenate([line, line[:1] + 1.0]))


def test_points_along_a_line_are_those_of_shapely():
    line = LINES[2]
    along = along_line(line)
    positions = RNG.uniform(0.0, along[-1], 40)
    wanted = shapely.line_interpolate_point(shapely.LineString(line), positions)
    found = points_along(line, along, positions)
    np.testing.assert_allclose(found, shapely.get_coordinates(wanted), atol=1e-9)


def test_straight_pieces_follow_the_lines():
    pieces = straight_pieces(LINES)
    wanted = [pair for line in LINES for pair in pairwise(line.tolist())]
    np.testing.assert_array_equal(pieces, wanted)
    assert straight_pieces([]).shape == (0, 2, 2)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("", []), ("...", []), ("##.#", [[0, 2], [3, 4]]), (".###", [[1, 4]]), ("#", [[0, 1]])],
)
def test_runs_of_a_mask(text, wanted):
    assert runs(np.array([letter == "#" for letter in text], dtype=bool)).tolist() == wanted


@pytest.mark.parametrize(
    ("text", "middle"),
    [("#....###..", 6), ("##.##...##", 0), ("..#####", 4), ("#.###....", 3), ("###.#.####", 9)],
)
def test_middle_of_the_longest_run_of_a_ring(text, middle):
    ring = np.array([letter == "#" for letter in text])
    for turn in range(len(text)):
        assert middle_of_longest_run(np.roll(ring, turn)) == (middle + turn) % len(text)
