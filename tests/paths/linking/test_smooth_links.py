"""Links that keep a radius, and those with corners where a path would be too short without."""

import numpy as np
import pytest
import shapely

from ccfem.geometry.polylines import line_length
from ccfem.paths.linking.joining import link_ends
from ccfem.paths.linking.possible_links import possible_links, smooth_links

RADIUS, WIDTH = 3.85, 1.0
PLATE = shapely.box(-10.0, -30.0, 110.0, 30.0)


def strand(start, end):
    count = int(np.hypot(*np.subtract(end, start)) / 0.5) + 1
    return np.linspace(start, end, count)


def sharpest(line):
    """Largest curvature, 1/mm, of circles through three points about a width apart [Menger]."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    even = np.arange(0.0, along[-1], 0.25)
    x, y = (np.interp(even, along, line[:, d]) for d in range(2))
    points = np.column_stack([x, y])
    a, b, c = points[:-8], points[4:-4], points[8:]
    (ux, uy), (vx, vy) = (b - a).T, (c - b).T
    sides = np.hypot(ux, uy) * np.hypot(vx, vy) * np.hypot(*(c - a).T)
    return float(np.max(2.0 * np.abs(ux * vy - uy * vx) / sides))


def test_two_strands_that_go_on_beside_each_other_become_one_of_the_radius():
    lines = [strand((0.0, 0.0), (50.0, 0.0)), strand((53.0, 1.5), (100.0, 1.5))]
    found = link_ends(lines, PLATE, 7.0, WIDTH, radius=RADIUS, enough=20.0)
    (path,), (link,) = found
    assert path[0].tolist() == [0.0, 0.0]
    assert path[-1].tolist() == [100.0, 1.5]
    assert not link.any()
    assert sharpest(path) <= 1.02 / RADIUS
    corners = link_ends(lines, PLATE, 7.0, WIDTH).lines[0]
    assert sharpest(corners) > 1.02 / RADIUS


def test_the_shortest_link_of_a_shift_is_two_arcs():
    """To go on 1 mm aside takes two arcs, whose length is that of the Dubins word LSR or RSL."""
    lines = [strand((0.0, 0.0), (50.0, 0.0)), strand((55.0, 1.0), (100.0, 1.0))]
    links = smooth_links(lines, np.array([1, 2]), 7.0, WIDTH, RADIUS)
    (link,) = links
    # d along, s aside: by symmetry each arc turns by a with 2 R (1 - cos a) = s where no straight
    # part is left; a straight part makes it shorter, so this is the most that it can be.
    angle = np.arccos(1.0 - 1.0 / (2.0 * RADIUS))
    straight = 5.0 - 2.0 * RADIUS * np.sin(angle)
    assert np.hypot(5.0, 1.0) < line_length(link.path) <= straight + 2.0 * RADIUS * angle + 0.01


def test_neighbours_are_not_led_back_beside_each_other():
    """A turn back within a width is a fold, however short the strands are that it would join."""
    lines = [strand((0.0, float(k)), (20.0, float(k))) for k in range(9)]
    for enough in (10.0, 44.0):
        apart = link_ends(lines, PLATE, 1.5, WIDTH, radius=RADIUS, enough=enough)
        assert len(apart.lines) == 9
        assert not any(link.any() for link in apart.link)
    assert link_ends(lines, PLATE, 1.5, WIDTH).lines[0].shape[0] == sum(map(len, lines))


def test_links_with_corners_join_strands_that_are_too_short_and_are_marked():
    """Strands of 2 mm cannot be cut back for a smooth link a millimetre aside; turns cancel."""
    lines = [strand((18.0, 0.0), (20.0, 0.0)), strand((21.0, 1.0), (23.0, 1.0))]
    (path,), (link,) = link_ends(lines, PLATE, 1.5, WIDTH, radius=RADIUS, enough=25.0)
    steps = np.hypot(*np.diff(path, axis=0).T)
    assert steps[link[:-1]].sum() == pytest.approx(np.sqrt(2.0))
    apart = link_ends(lines, PLATE, 1.5, WIDTH, radius=RADIUS, enough=1.5)
    assert not any(link.any() for link in apart.link)


def test_no_link_leads_round_a_corner_into_a_bend():
    """The link leaves by 25 degrees, enters by as much, and 56 of the bend follow: 106 in 4 mm."""
    way = np.linspace(0.0, 1.4, 15)
    start, turn = np.array([0.5 * np.cos(0.44), 0.5 * np.sin(0.44)]), np.radians(50.0)
    bend = RADIUS * np.column_stack([np.sin(way), 1.0 - np.cos(way)])
    bend = start + bend @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    lines = [np.array([(-50.0, 0.0), (0.0, 0.0)]), bend]
    ends = possible_links(lines, PLATE, 0.6, WIDTH, along_boundary=False, radius=RADIUS)
    assert not any({link.first, link.second} == {1, 2} for link in ends)
    free = possible_links(lines, PLATE, 0.6, WIDTH, along_boundary=False)
    assert any({link.first, link.second} == {1, 2} for link in free)
