import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.meshing import triangulate
from ccfem.paths.fields.streamlines import streamlines

POINTS, TRIANGLES = triangulate(shapely.box(0, 0, 40, 20), 2.0)
RING = shapely.Point(0, 0).buffer(20, quad_segs=32) - shapely.Point(0, 0).buffer(5, quad_segs=32)


def stress(largest, smallest, angle):
    """s11, s22, s12 at each point of principal values and the angle of the first, radians."""
    mean, half = 0.5 * (largest + smallest), 0.5 * (largest - smallest)
    values = np.stack([mean + half * np.cos(2 * angle), mean - half * np.cos(2 * angle)])
    return np.stack([*values, half * np.sin(2 * angle)], axis=1)


@given(angle=st.floats(-1.5, 1.5), sign=st.sampled_from([1.0, -1.0]))
@settings(max_examples=20, deadline=None)
def test_uniform_field_has_straight_lines_from_border_to_border(angle, sign):
    uniform = np.full(len(POINTS), 1.0)
    field = stress(3.0 * sign * uniform, 1.0 * sign * uniform, angle * uniform)
    (line,) = streamlines(POINTS, TRIANGLES, field, [[20.0, 10.0]], 0.3)
    across = np.array([-np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose((line - [20.0, 10.0]) @ across, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(line, axis=0), axis=1), 0.3, atol=1e-9)
    gaps = shapely.distance(shapely.points(line[[0, -1]]), shapely.box(0, 0, 40, 20).exterior)
    assert gaps.max() < 0.3


def test_size_of_the_stress_and_its_sign_decide_the_family():
    """Compression of 3 along x outweighs tension of 1 along y."""
    uniform = np.full(len(POINTS), 1.0)
    field = stress(uniform, -3.0 * uniform, 0.5 * np.pi * uniform)
    (line,) = streamlines(POINTS, TRIANGLES, field, [[20.0, 10.0]], 0.3)
    np.testing.assert_allclose(line[:, 1], 10.0, atol=1e-9)
    np.testing.assert_array_equal(
        streamlines(POINTS, TRIANGLES, 1024.0 * field, [[20.0, 10.0]], 0.3)[0], line
    )


def test_hoop_field_has_closed_circles():
    points, triangles = triangulate(RING, 1.0)
    angle = np.arctan2(points[:, 1], points[:, 0])
    ones = np.ones(len(points))
    field = stress(ones, 0.0 * ones, angle + 0.5 * np.pi)
    lines = streamlines(points, triangles, field, [[10.0, 0.0], [9.0, 12.0]], 0.4)
    for line, radius in zip(lines, (10.0, 15.0), strict=True):
        np.testing.assert_array_equal(line[0], line[-1])
        np.testing.assert_allclose(np.hypot(*line.T), radius, atol=0.01)
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        assert length == pytest.approx(2.0 * np.pi * radius, rel=2e-3)


def test_lines_stop_where_tension_and_compression_take_turns():
    """Tension along x left of x = 20, compression of more than its size along y right of it."""
    first = (25.0 - POINTS[:, 0]) / 5.0
    field = np.stack([first, first - 2.0, 0.0 * first], axis=1)
    (line,) = streamlines(POINTS, TRIANGLES, field, [[5.0, 10.0]], 0.25)
    assert line[:, 0].min() < 0.3
    assert line[:, 0].max() == pytest.approx(20.0, abs=0.3)


def test_lines_stop_where_the_stress_has_no_direction():
    ones = np.ones(len(POINTS))
    assert len(streamlines(POINTS, TRIANGLES, stress(ones, ones, ones), [[5, 5]], 0.3)[0]) == 0
    fading = np.clip((20.0 - POINTS[:, 0]) / 20.0, 0.0, 1.0)
    field = stress(fading, 0.0 * ones, 0.0 * ones)
    (line,) = streamlines(POINTS, TRIANGLES, field, [[5.0, 10.0]], 0.2, least=0.1)
    assert line[:, 0].max() == pytest.approx(18.0, abs=0.5)


def test_starts_outside_give_nothing_and_steps_are_positive():
    field = np.ones((len(POINTS), 3))
    assert len(streamlines(POINTS, TRIANGLES, field, [[-5, 5]], 0.3)[0]) == 0
    assert streamlines(POINTS, TRIANGLES, field, np.zeros((0, 2)), 0.3) == []
    with pytest.raises(InputError, match="step"):
        streamlines(POINTS, TRIANGLES, field, [[5, 5]], 0.0)


@given(turn=st.floats(0.0, 6.28))
@settings(max_examples=10, deadline=None)
def test_lines_turn_with_the_part_and_keep_their_sense(turn):
    """Here the sign of an eigenvector changes between a turn of 0 and one of half a circle."""
    uniform = np.full(len(POINTS), 1.0)
    start = np.array([[20.0, 10.0]])
    (line,) = streamlines(
        POINTS, TRIANGLES, stress(uniform, 0.0 * uniform, 0.3 * uniform), start, 1.0
    )
    turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    field = stress(uniform, 0.0 * uniform, (0.3 + turn) * uniform)
    (other,) = streamlines(POINTS @ turned, TRIANGLES, field, start @ turned, 1.0)
    np.testing.assert_allclose(other, line @ turned, atol=1e-9)
