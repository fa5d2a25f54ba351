"""Polylines in even steps: against circles, squares and lines made by hand."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.geometry.even_steps import even_steps
from ccfem.geometry.polylines import line_length


def evened(line, step=1.0, tolerance=0.01, fixed=None):
    line = np.asarray(line, dtype=np.float64)
    held = np.zeros(len(line), dtype=bool) if fixed is None else fixed
    return even_steps(line, np.array([0, len(line)]), held, step, tolerance)


def test_a_straight_line_is_cut_into_equal_steps():
    found, offsets, source, share = evened([[0.0, 0.0], [0.1, 0.0], [0.1, 0.0], [7.3, 0.0]])
    np.testing.assert_allclose(found[:, 0], np.linspace(0.0, 7.3, 9))
    assert offsets.tolist() == [0, 9]
    assert (source[:-1] == [0, 3]).all()
    np.testing.assert_allclose(share[:-1], np.arange(8) / 8)


def test_corners_and_the_seam_stay_and_lengths_too():
    square = np.array([[0, 0], [5, 0], [5, 3.5], [5, 3.5], [0, 3.5], [0, 0]])
    found, _, _, _ = evened(square)
    for corner in square:
        assert np.linalg.norm(found - corner, axis=1).min() == 0.0
    assert line_length(found) == pytest.approx(17.0)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert steps.min() > 0.8
    assert steps.max() <= 1.0 + 1e-12


@pytest.mark.parametrize("radius", [3.85, 10.0, 60.0])
def test_a_circle_of_many_points_gets_few(radius):
    """An arc of radius r and chord c is c^2 / (8 r) high."""
    angle = np.linspace(0.0, 2.0 * np.pi, 20001)
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    circle[-1] = circle[0]
    found, _, _, _ = evened(circle)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    longest = min(np.sqrt(8.0 * radius * 0.01), 1.0)
    assert steps.max() <= longest * (1.0 + 1e-3)
    assert steps.mean() > 0.45 * longest
    middle = 0.5 * (found[1:] + found[:-1])
    assert radius - np.hypot(*middle.T).min() <= 0.0101


def test_fixed_points_stay_and_a_line_of_no_length_keeps_one_point():
    line = np.column_stack([np.arange(11.0) / 10.0, np.zeros(11)])
    fixed = np.arange(11) == 3
    found, _, source, _ = evened(line, fixed=fixed)
    np.testing.assert_allclose(found[:, 0], [0.0, 0.3, 1.0])
    assert source[:-1].tolist() == [[0, 3], [3, 10]]
    both = np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 0.0], [0.5, 0.0]])
    found, offsets, _, _ = even_steps(both, np.array([0, 2, 4]), np.zeros(4, bool), 1.0, 0.01)
    assert offsets.tolist() == [0, 1, 3]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_points_left_out_lie_within_the_tolerance(seed):
    random = np.random.default_rng(seed)
    line = np.cumsum(random.normal(0.0, 0.2, (60, 3)), axis=0)
    found, _, _, _ = evened(line, step=0.5, tolerance=0.05)
    a, b = found[:-1], found[1:]
    for point in line:
        way, chord = point - a, b - a
        share = np.clip((way * chord).sum(1) / (chord**2).sum(1), 0.0, 1.0)
        assert np.linalg.norm(way - share[:, None] * chord, axis=1).min() <= 0.05 + 1e-12
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert steps.min() > 0.0
    assert steps.max() <= 0.5 + 1e-9
