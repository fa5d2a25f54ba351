"""From curves to paths: distance from the border, links, least length."""

import numpy as np
import pytest
import shapely

from ccfem.paths.linking import finishing
from ccfem.paths.linking.finishing import keep_off_border, linked_paths
from ccfem.paths.linking.joining import Joined

PLATE = shapely.box(0.0, 0.0, 60.0, 40.0).difference(shapely.Point(30.0, 20.0).buffer(5.0, 64))


def test_nothing_is_cut_without_an_inset():
    lines = [np.array([[-5.0, 1.0], [65.0, 1.0]])]
    assert keep_off_border(lines, PLATE, 0.0)[0] is lines[0]


def test_lines_are_cut_where_they_come_near_the_border():
    through = np.array([[0.0, 20.0], [60.0, 20.0]])
    ring = np.array([[10.0, 5.0], [20.0, 5.0], [20.0, 1.0], [10.0, 1.0], [10.0, 5.0]])
    near, whole = np.array([[0.0, 1.0], [60.0, 1.0]]), np.array([[5.0, 8.0], [55.0, 8.0]])
    kept = keep_off_border([through, ring, near, whole], PLATE, 2.0)
    assert len(kept) == 4
    ends = sorted(kept[0][:, 0].tolist() + kept[1][:, 0].tolist())
    assert ends == pytest.approx([2.0, 23.0, 37.0, 58.0], abs=0.01)
    # The ring, cut twice on its lower side, is one open line through the point where it began.
    assert kept[2][[0, -1], 1] == pytest.approx([2.0, 2.0])
    assert [10.0, 5.0] in kept[2].tolist()
    assert kept[3] is whole


def test_paths_are_linked_and_short_ones_dropped():
    lines = [np.array([[5.0, y], [25.0, y]]) for y in (5.0, 6.0)]
    lines += [np.array([[40.0, 30.0], [55.0, 30.0]])]
    linked = linked_paths(lines, PLATE, 1.0, 2.0, 41.0).lines
    assert len(linked) == 1
    length = np.linalg.norm(np.diff(linked[0], axis=0), axis=1).sum()
    assert length == pytest.approx(41.0, abs=0.6)
    assert len(linked_paths(lines, PLATE, 1.0, 0.0, 10.0).lines) == 3
    assert linked_paths(lines, PLATE, 1.0, 0.0, 30.0).lines == []


def test_marks_of_a_ring_that_runs_on_stay_on_their_steps(monkeypatch):
    # A square 41 mm round with two links, one at its start, runs on by 1.5 mm: over the first link
    # again, and into the strand behind it.
    x, y = np.array([[0.0, 0.0], [1.0, 0.0], [10.25, 0.0], [10.25, 10.25], [0.0, 10.25]]).T
    ring = np.column_stack([np.append(x, 0.0), np.append(y, 0.0)])
    marks = np.array([True, False, False, True, False, False])
    monkeypatch.setattr(finishing, "link_ends", lambda *_: Joined([ring], [marks]))
    found = linked_paths([ring], PLATE, 1.0, 2.0, 42.5)
    path, link = found.lines[0], found.link[0]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert steps.sum() == pytest.approx(42.5)
    # The first link lies at y 0 before x 1, the second at y 10.25: found by place, not by number.
    middle = 0.5 * (path[1:] + path[:-1])
    first = (middle[:, 1] == 0.0) & (middle[:, 0] < 1.0)
    second = middle[:, 1] == 10.25
    assert steps[first].sum() == pytest.approx(2.0)
    np.testing.assert_array_equal(link, [*(first | second), False])
