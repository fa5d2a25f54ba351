"""Paths of a layer, and what is left of them without links."""

import numpy as np
import pytest

from ccfem.judging.evaluation.layer_paths import plane_paths


def pieces(paths):
    return [
        paths.points[a:b].round(3).tolist()
        for a, b in zip(paths.offsets[:-1], paths.offsets[1:], strict=True)
    ]


# Over the window, along the part, and round outside the right edge.
LINE = [[5, 20], [15, 20], [45, 20], [55, 20], [55, 30], [65, 30], [65, 35], [55, 35], [5, 35]]


def test_without_links_nothing_is_copied(framed):
    paths = framed.plane(LINE)
    assert paths.in_part is paths
    assert paths.strands is paths


def test_strands_are_what_the_links_join(framed):
    paths = framed.plane(LINE, [[2, 2], [50, 2]], links=[[1, 4, 5, 6], []])
    strands = paths.strands
    assert pieces(strands) == [
        [[5, 20], [15, 20]],
        [[45, 20], [55, 20], [55, 30]],
        [[55, 35], [5, 35]],
        [[2, 2], [50, 2]],
    ]
    assert not strands.link.any()
    assert not strands.closed.any()


def test_links_end_where_they_leave_the_part(framed):
    paths = framed.plane(LINE, links=[[1, 4, 5, 6]])
    inside = paths.in_part
    assert np.concatenate(pieces(inside)) == pytest.approx(
        np.array(
            [
                *([5, 20], [15, 20], [20, 20], [40, 20], [45, 20], [55, 20], [55, 30], [60, 30]),
                *([60, 35], [55, 35], [5, 35]),
            ]
        ),
        abs=2e-4,
    )
    assert np.diff(inside.offsets).tolist() == [3, 5, 3]
    assert inside.link.tolist() == [
        *(False, True, False),
        *(True, False, False, True, False),
        *(True, False, False),
    ]
    # Fibre outside that is no link stays.
    stays = framed.plane(LINE, links=[[1]]).in_part
    assert stays.lengths.sum() == pytest.approx(paths.lengths.sum() - 20.0, abs=1e-3)


def test_a_closed_path_stays_closed_only_where_it_is_whole(framed):
    ring = [[5, 5], [55, 5], [55, 35], [5, 35], [5, 5]]
    assert framed.plane(ring, links=[[1]]).in_part.closed.tolist() == [True]
    one = framed.plane(ring, links=[[1]]).strands
    assert one.closed.tolist() == [False]
    # The strand goes on where the path began.
    assert pieces(one) == [[[55, 35], [5, 35], [5, 5], [55, 5]]]
    two = framed.plane(LINE, ring, LINE, links=[[], [0, 2, 3], []]).strands
    assert pieces(two) == [LINE, [[55, 5], [55, 35]], LINE]


def test_a_path_of_links_alone_has_no_strands(framed):
    paths = framed.plane([[70, 5], [80, 5]], [[1, 1], [9, 1]], links=[[0], []])
    assert pieces(paths.in_part) == pieces(paths.strands) == [[[1, 1], [9, 1]]]


def test_marks_follow_the_points_that_stay_when_repeated_ones_are_merged(framed):
    line = [[5, 5], [5, 5], [10, 5], [10, 5], [15, 5], [15, 5]]
    found = plane_paths(framed.paths(line, links=[[1, 3]]), framed.layers[0])
    assert found.points.tolist() == [[5, 5], [10, 5], [15, 5]]
    assert found.link.tolist() == [True, True, False]
    # The step of no length was the link: nothing is.
    found = plane_paths(framed.paths(line, links=[[0, 2]]), framed.layers[0])
    assert found.link.tolist() == [False, False, False]
