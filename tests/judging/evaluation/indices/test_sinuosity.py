"""Sinuosity of paths, and paths over 40 mm."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.geometry.polylines import pack
from ccfem.judging.evaluation.indices.sinuosity import (
    TOLERANCES,
    SinuositySamples,
    path_sinuosity,
    sample_sinuosity,
    sinuosity_indices,
)


def sinuosity(*lines, width=1.0):
    return path_sinuosity(*pack([np.array(line, dtype=float) for line in lines]), width)


def douglas_peucker(line, tolerance):
    """Textbook recursion, distance to the chord as a segment."""
    a, b = line[0], line[-1]
    d = b - a
    t = np.clip((line - a) @ d / (d @ d), 0.0, 1.0)
    off = np.linalg.norm(line - a - t[:, None] * d, axis=1)
    k = int(off.argmax())
    if off[k] <= tolerance:
        return np.array([a, b])
    head, tail = douglas_peucker(line[: k + 1], tolerance), douglas_peucker(line[k:], tolerance)
    return np.concatenate([head[:-1], tail])


def length(line):
    return np.linalg.norm(np.diff(line, axis=0), axis=1).sum()


def test_straight_lines_have_one():
    assert sinuosity([[0, 0], [10, 0]], [[1, 1], [2, 2], [5, 5]]) == pytest.approx([1.0, 1.0])


def test_corner_larger_than_every_tolerance_has_one():
    assert sinuosity([[0, 0], [10, 0], [10, 8]]) == pytest.approx([1.0])


def test_staircase_is_length_over_chord_but_for_the_finest_tolerance():
    stairs = [[(k + 1) // 2, k // 2] for k in range(21)]
    # Steps of one bead lie 0.707 off the diagonal: only the tolerance 0.001 keeps them.
    expected = (1.0 + 3.0 * 20.0 / np.hypot(10.0, 10.0)) / 4.0
    assert sinuosity(stairs) == pytest.approx([expected])
    assert sinuosity(0.8 * np.array(stairs), width=0.8) == pytest.approx([expected])


def test_square_ring_splits_at_its_farthest_corner():
    assert sinuosity([[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]]) == pytest.approx([1.0])


def test_ring_smaller_than_the_tolerances_becomes_its_diameter():
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    ring = 0.3 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring[-1] = ring[0]
    # Halves lie 0.3 off the diameter: simplified to it for 0.8, 1 and 1.2.
    fine = length(ring) / (2.0 * length(douglas_peucker(ring[:201], TOLERANCES[0])))
    assert sinuosity(ring) == pytest.approx([(fine + 3.0 * np.pi / 2.0) / 4.0], rel=1e-4)


def test_path_out_and_back_is_straight():
    assert sinuosity([[0, 0], [5, 0], [0, 0]]) == pytest.approx([1.0])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**9), closed=st.booleans())
def test_against_the_textbook_recursion(seed, closed):
    rng = np.random.default_rng(seed)
    line = rng.normal(size=(12, 2)).cumsum(axis=0)
    parts = [line]
    if closed:
        line = np.concatenate([line, line[:1]])
        k = int(np.linalg.norm(line - line[0], axis=1).argmax())
        parts = [line[: k + 1], line[k:]]
    expected = np.mean(
        [length(line) / sum(length(douglas_peucker(p, t)) for p in parts) for t in TOLERANCES]
    )
    # Between other paths, so that no line reads its neighbour's points.
    found = sinuosity([[0, 0], [1, 0]], line, [[3, 3], [3, 5]])
    assert found == pytest.approx([1.0, max(expected, 1.0), 1.0])


def test_indices_of_a_layer(pulled):
    stairs = [[(k + 1) // 2, k // 2] for k in range(21)]
    paths = pulled.plane([[1, 30], [51, 30]], stairs)
    found = sinuosity_indices(sample_sinuosity(paths, 1.0))
    winding = (1.0 + 3.0 * np.sqrt(2.0)) / 4.0
    assert found["sinuosity_mean"] == pytest.approx((1.0 + winding) / 2.0)
    assert found["sinuosity"] == pytest.approx((50.0 + 20.0 * winding) / 70.0)
    assert found["over_40_count"] == 0.5
    assert found["over_40_length"] == pytest.approx(50.0 / 70.0)


def test_forty_millimetres_are_not_over_forty():
    samples = SinuositySamples(np.array([40.0, 40.0 + 1e-12, 40.1]), np.ones(3))
    assert sinuosity_indices(samples)["over_40_count"] == pytest.approx(1.0 / 3.0)


def test_no_path():
    found = sinuosity_indices(SinuositySamples(np.zeros(0), np.zeros(0)))
    assert len(found) == 4
    assert np.isnan(list(found.values())).all()
