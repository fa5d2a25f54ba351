"""Paths cut back to a length: what is left is known by hand."""

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.paths.planning.equal_fibre import cut_to_length


def lines(*lengths):
    return flat_paths([[[0.0, k, 0.0], [size, k, 0.0]] for k, size in enumerate(lengths)])


@pytest.mark.parametrize(
    ("length", "left"),
    [
        (200.0, [80.0, 50.0, 45.0]),
        (175.0, [80.0, 50.0, 45.0]),
        (173.0, [80.0, 50.0, 43.0]),  # the shortest that stays long enough
        (168.0, [80.0, 43.0, 45.0]),
        (150.0, [55.0, 50.0, 45.0]),
        (131.0, [None, None, None]),
        (125.0, [80.0, 45.0]),  # three of 42 mm do not fit
        (92.0, [42.0, 50.0]),
        (85.0, [None, None]),
        (83.0, [80.0]),  # two of 42 mm do not fit, and one is no longer
        (60.0, [60.0]),
        (41.0, []),
    ],
)
def test_the_shortest_go_and_one_is_cut(length, left):
    found = cut_to_length(lines(80.0, 50.0, 45.0), length, 42.0)
    assert len(found) == len(left)
    assert found.lengths.sum() <= length + 1e-9
    assert found.lengths.min(initial=42.0) >= 42.0 - 1e-9
    for size, wanted in zip(found.lengths, left, strict=True):
        assert wanted is None or size == pytest.approx(wanted)
    if None in left:  # cut on several: nothing is lost
        assert found.lengths.sum() == pytest.approx(length)


def test_a_ring_is_opened_and_keeps_its_way():
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    ring = 20.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    ring[-1] = ring[0]
    paths = flat_paths([ring], closed=True)
    found = cut_to_length(paths, 100.0, 42.0)
    assert found.lengths == pytest.approx([100.0])
    assert not found.closed.any()
    end = 100.0 / 20.0
    assert found.points[-1, :2] == pytest.approx([20 * np.cos(end), 20 * np.sin(end)], abs=0.01)
    assert cut_to_length(paths, 1000.0, 42.0) is paths


@pytest.mark.parametrize(
    ("length", "left"), [(90.0, 90.0), (75.0, 60.0), (55.0, 55.0), (99.0, 99.0)]
)
def test_no_path_ends_in_a_link(length, left):
    """One strand of 100 mm, of which a link takes the way from 60 to 80 mm."""
    points = np.array([[x, 0.0, 0.0] for x in (0.0, 30.0, 60.0, 70.0, 80.0, 100.0)])
    paths = flat_paths([points], link=np.array([False, False, True, True, False, False]))
    found = cut_to_length(paths, length, 42.0)
    assert found.lengths == pytest.approx([left])
    assert not found.link[-1]
    assert found.link.any() == (left > 60.0)
    assert len(cut_to_length(paths, 75.0, 70.0)) == 0
