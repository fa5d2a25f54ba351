"""Paths cut back to a length: what is left is known by hand."""

import numpy as np
import pytest

from ccfem.planning.cutting import cut_to_length
from ccfem.toolpaths import Toolpaths


def lines(*lengths):
    points = np.concatenate([[[0.0, k, 0.0], [size, k, 0.0]] for k, size in enumerate(lengths)])
    count = len(lengths)
    return Toolpaths(
        points,
        np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        2 * np.arange(count + 1),
        np.zeros(count, dtype=int),
        np.zeros(count, dtype=int),
        np.zeros(count, dtype=bool),
    )


@pytest.mark.parametrize(
    ("length", "left"),
    [
        (200.0, [60.0, 50.0, 42.0]),
        (152.0, [60.0, 50.0, 42.0]),
        (145.0, [53.0, 50.0, 42.0]),
        (130.0, [42.0, 46.0, 42.0]),
        (126.0, [42.0, 42.0, 42.0]),
        (125.0, [60.0, 50.0]),
        (100.0, [50.0, 50.0]),
        (84.0, [42.0, 42.0]),
        (42.0, [42.0]),
        (50.0, [50.0]),
        (41.0, []),
    ],
)
def test_the_longest_give_first_and_whole_ones_go_last(length, left):
    found = cut_to_length(lines(60.0, 50.0, 42.0), length, 42.0)
    assert found.lengths.tolist() == pytest.approx(left)


def test_a_ring_is_opened():
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    ring = 20.0 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    ring[-1] = ring[0]
    flat = np.broadcast_to([0.0, 0.0, 1.0], ring.shape)
    none = np.zeros(1, dtype=int)
    paths = Toolpaths(ring, flat, np.array([0, 401]), none, none, np.array([True]))
    found = cut_to_length(paths, 100.0, 42.0)
    assert found.lengths == pytest.approx([100.0])
    assert not found.closed.any()
    end = 100.0 / 20.0
    assert found.points[-1, :2] == pytest.approx([20 * np.cos(end), 20 * np.sin(end)], abs=0.01)
