"""Strands that end where they come too near: distances known from geometry."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from ccfem.strategies.winding_curves.spaced import kept_apart


def line(start, end, step=0.25):
    count = int(np.linalg.norm(np.subtract(end, start)) / step) + 1
    return np.linspace(start, end, count)


def circle(radius, step=0.25):
    angle = np.linspace(0.0, 2.0 * np.pi, int(2.0 * np.pi * radius / step) + 1)
    found = radius * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    found[-1] = found[0]
    return found


def test_of_two_lines_that_converge_the_second_ends_where_the_clearance_ends():
    """y = 5 - x / 20 over y = 0 has less than 2 mm to it beyond x = 60."""
    first, second = line((0.0, 0.0, 0.0), (100.0, 0.0, 0.0)), line((0.0, 5.0, 0.0), (100.0, 0.0, 0))
    (kept,) = kept_apart([second], 2.0, 10.0, [first])
    assert kept[0, 0] == 0.0
    assert kept[-1, 0] == pytest.approx(60.0, abs=0.8)
    assert kept_apart([second], 2.0, 70.0, [first]) == []


def test_rings_stay_closed_where_they_keep_the_clearance_and_open_where_they_do_not():
    far, near = circle(10.0), circle(7.0)
    kept = kept_apart([far, near], 2.5, 5.0)
    assert [np.array_equal(each[0], each[-1]) for each in kept] == [True, True]
    # Moved by 1.5 mm, it is further than 7.5 mm from the middle of the other, so nearer than 2.5
    # to it, where 7^2 + 1.5^2 + 2 * 7 * 1.5 cos a > 7.5^2.
    moved = near + np.array([1.5, 0.0, 0.0])
    kept = kept_apart([moved, far], 2.5, 5.0)
    assert len(kept) == 2
    share = np.linalg.norm(np.diff(kept[1], axis=0), axis=1).sum() / (2.0 * np.pi * 7.0)
    assert share == pytest.approx(1.0 - np.arccos((56.25 - 51.25) / 21.0) / np.pi, abs=0.02)


def test_a_hairpin_does_not_lie_beside_itself():
    out, back = line((0.0, 0.0, 0.0), (60.0, 0.0, 0.0)), line((60.0, 1.0, 0.0), (0.0, 1.0, 0.0))
    (kept,) = kept_apart([np.concatenate([out, back])], 2.0, 5.0)
    # It comes back as far as its own bend counts as one: 12 mm of arc.
    assert kept[0, 0] == 0.0
    assert kept[:, 0].max() == 60.0
    assert kept[-1] == pytest.approx([54.5, 1.0, 0.0], abs=1.0)


def test_lines_keep_half_the_clearance_from_the_border():
    border = cKDTree(line((50.0, -1.0, 0.0), (50.0, 1.0, 0.0)))
    kept = kept_apart([line((0.0, 0.0, 0.0), (100.0, 0.0, 0.0))], 4.0, 5.0, (), border)
    ends = [each[[0, -1], 0] for each in kept]
    np.testing.assert_allclose(ends, [[0.0, 48.0], [52.0, 100.0]], atol=0.3)
