"""Paths in even steps: links, normals and paths without length."""

import numpy as np
import pytest

from ccfem.paths.planning.layer_plans import in_even_steps
from ccfem.paths.toolpaths import Toolpaths


def paths(points, normals=None, link=None, offsets=None):
    points = np.asarray(points, dtype=np.float64)
    offsets = np.array([0, len(points)]) if offsets is None else np.asarray(offsets)
    count = len(offsets) - 1
    flat = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    return Toolpaths(
        points,
        flat if normals is None else np.asarray(normals),
        offsets,
        np.arange(count),
        np.zeros(count, dtype=int),
        np.zeros(count, dtype=bool),
        link,
    )


def test_links_stay_links():
    """Three millimetres of link within ten of fibre, on a straight line."""
    line = [[0, 0, 0], [4, 0, 0], [4, 0, 0], [7, 0, 0], [10, 0, 0]]
    link = np.array([False, False, True, False, False])
    found = in_even_steps(paths(line, link=link), 1.0)
    np.testing.assert_allclose(found.points[:, 0], np.arange(11.0))
    np.testing.assert_array_equal(np.flatnonzero(found.link), [4, 5, 6])


def test_normals_turn_from_point_to_point():
    normals = [[0.0, 0.0, 1.0], [0.0, np.sin(0.4), np.cos(0.4)]]
    found = in_even_steps(paths([[0, 0, 0], [2, 0, 0]], normals), 1.0)
    np.testing.assert_allclose(found.normals[1], [0.0, np.sin(0.2), np.cos(0.2)], atol=1e-12)


def test_paths_without_length_go_and_none_is_none():
    points = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [3, 0, 0]]
    found = in_even_steps(paths(points, offsets=[0, 2, 4]), 1.0)
    assert found.layer.tolist() == [1]
    assert found.lengths == pytest.approx([3.0])
    assert len(in_even_steps(Toolpaths.empty(), 1.0)) == 0
