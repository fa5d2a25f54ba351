"""One path of many tracks: beside known links, and what every path has to keep."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.geometry.dubins import WORDS, curve_points, word_sizes
from ccfem.geometry.polylines import runs
from ccfem.geometry.section_grid import contains, place, place_and_room, section_grid
from ccfem.geometry.shapes import INSIDE, OUTSIDE, VOID
from ccfem.paths.linking import single_path
from ccfem.paths.linking.single_path import LinkedPath, curve_cost, link_tracks

RADIUS, WIDTH = 1.5, 0.9
WINDOWED = shapely.box(0, 0, 40, 30).difference(shapely.Point(14, 15).buffer(8.0))


def bundle(a, b, count, width=WIDTH):
    """Parallel tracks about the line from a to b."""
    a, b = np.array(a, float), np.array(b, float)
    along = (b - a) / np.linalg.norm(b - a)
    aside = width * np.array([-along[1], along[0]])
    shifts = (np.arange(count) - 0.5 * (count - 1))[:, None, None] * aside
    return list(np.linspace(a, b, 30) + shifts)


def triangle():
    """Three members of eight tracks that cross where they meet, and their section."""
    corners = np.array([[0.0, 0.0], [100.0, 0.0], [37.0, 60.0]])
    pairs = [(corners[k], corners[k - 1]) for k in range(3)]
    section = shapely.union_all([shapely.LineString(pair).buffer(3.6) for pair in pairs])
    groups = []
    for a, b in pairs:
        more = 20.0 * (b - a) / np.linalg.norm(b - a)
        lines = shapely.linestrings(bundle(a - more, b + more, 8))
        cut = shapely.segmentize(shapely.intersection(lines, section), 0.5)
        groups.append([shapely.get_coordinates(line) for line in cut])
    return groups, section


@pytest.fixture(scope="module")
def truss():
    groups, section = triangle()
    return groups, section, link_tracks(groups, section, RADIUS, WIDTH)


def links(path):
    """The links of a path, in their order."""
    return [path.points[a : b + 1] for a, b in runs(path.link)]


def length(line) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def strands(path):
    """Stretches of a path between its links."""
    inner = ~path.link[:-1]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inner, [False]]).astype(int)))
    return [path.points[a : b + 1] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def in_section(path, section) -> float:
    return sum(shapely.LineString(link).intersection(section).length for link in links(path))


def sharpest(points) -> float:
    """Largest curvature, 1/mm, of circles through three neighbouring points."""
    a, b, c = points[:-2], points[1:-1], points[2:]
    (u, v), (x, y) = (b - a).T, (c - a).T
    sides = [np.linalg.norm(side, axis=1) for side in (b - a, c - b, c - a)]
    return float((2.0 * np.abs(u * y - v * x) / np.prod(sides, axis=0)).max())


@pytest.mark.parametrize("count", [4, 20])
def test_tracks_two_radii_apart_are_joined_by_half_circles(count, monkeypatch) -> None:
    monkeypatch.setattr(single_path, "_STEP", 0.02)
    tracks = bundle((0.0, 0.0), (50.0, 0.0), count, 2 * RADIUS)
    section = shapely.box(0.0, -2.0 * count, 50.0, 2.0 * count)
    path = link_tracks([tracks], section, RADIUS, WIDTH)
    assert len(links(path)) == count - 1
    for link in links(path):
        assert length(link) == pytest.approx(2 * 1.0 + np.pi * RADIUS, abs=1e-3)
    assert length(path.points) == pytest.approx(
        sum(length(link) for link in links(path)) + 50 * count
    )


def test_every_track_is_laid_once_as_it_is(truss) -> None:
    groups, _, path = truss
    tracks = [track for group in groups for track in group]
    laid = strands(path)
    assert len(laid) == len(tracks) == len(links(path)) + 1 == 24
    for track in tracks:
        same = [
            strand.shape == track.shape
            and (np.array_equal(strand, track) or np.array_equal(strand, track[::-1]))
            for strand in laid
        ]
        assert sum(same) == 1


def test_links_lie_outside_and_turn_no_tighter_than_the_radius(truss) -> None:
    _, section, path = truss
    assert in_section(path, section) < 1e-6
    for link in links(path):
        assert sharpest(link) <= (1.0 + 1e-6) / RADIUS
        assert np.linalg.norm(np.diff(link, axis=0), axis=1).max() <= 0.5 + 1e-9
    # No kink where a link begins or ends: no sharper turn than on half a step of the circle.
    way = np.diff(path.points, axis=0)
    turn = np.abs(np.angle(np.exp(1j * np.diff(np.arctan2(way[:, 1], way[:, 0])))))
    assert turn.max() <= 0.5 / RADIUS + 1e-6


def test_links_are_fewer_mm_than_a_laid_out_zigzag(truss) -> None:
    """Next track to next track, members one after the other: bulbs of known length."""
    _, _, path = truss
    bulb = RADIUS * (np.pi + 4 * np.arccos((WIDTH + 2 * RADIUS) / (4 * RADIUS)))
    assert sum(length(link) for link in links(path)) < 21 * (2.0 + bulb)


def test_cost_does_not_depend_on_the_frame(truss) -> None:
    groups, section, path = truss
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, s], [-s, c]])
    turned = [[track @ turn + 40.0 for track in group] for group in groups]
    moved = shapely.transform(section, lambda points: points @ turn + 40.0)
    other = link_tracks(turned, moved, RADIUS, WIDTH)
    assert length(other.points) == pytest.approx(length(path.points), abs=1e-6)
    again = link_tracks(groups, section, RADIUS, WIDTH)
    np.testing.assert_array_equal(again.points, path.points)


def test_a_link_leads_round_the_part_rather_than_through_it() -> None:
    block = shapely.box(0.0, 0.0, 60.0, 60.0)
    corner = np.array([[0.0, 50.0], [5.0, 55.0], [10.0, 60.0]])
    path = link_tracks([[corner], [60.0 - corner]], block, RADIUS, WIDTH)
    (link,) = links(path)
    assert in_section(path, block) < 1e-6
    assert 100.0 < length(link) < 150.0
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    assert steps.min() > 1e-6
    assert np.linalg.norm(np.diff(link, axis=0), axis=1).max() < 0.51
    assert sharpest(link) < 1.05 / RADIUS


def test_tracks_that_end_in_a_window_are_joined_there() -> None:
    tracks = [np.array([[0.0, y], [3.0, y], [14.0 - np.sqrt(64.0 - (y - 15) ** 2), y]])
              for y in (11.0, 14.0, 17.0)]  # fmt: skip
    path = link_tracks([tracks], WINDOWED, RADIUS, WIDTH)
    assert in_section(path, WINDOWED) < 0.05
    middle = [shapely.Point(link[len(link) // 2]) for link in links(path)]
    assert sorted(p.within(shapely.Point(14, 15).buffer(8.0)) for p in middle) == [False, True]


def test_closed_tracks_become_a_spiral() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    circle[-1] = circle[0]
    section = shapely.Point(0, 0).buffer(15.0).difference(shapely.Point(0, 0).buffer(10.0))
    rings = [r * circle for r in (10.45, 11.35, 12.25, 13.15, 14.05)]
    path = link_tracks([rings], section, RADIUS, WIDTH)
    assert len(links(path)) == 4
    assert shapely.LineString(path.points).is_simple
    assert max(length(link) for link in links(path)) < 4.0
    assert max(sharpest(link) for link in links(path)) < 1.001 / RADIUS
    laid = sum(length(strand) for strand in strands(path))
    assert laid > 0.95 * sum(length(ring) for ring in rings)


def test_parts_that_lie_apart_are_joined_too() -> None:
    bars = [shapely.box(x, 0.0, x + 30.0, 4.5) for x in (0.0, 50.0)]
    groups = [bundle((x, 2.25), (x + 30.0, 2.25), 5) for x in (0.0, 50.0)]
    section = shapely.union_all(bars)
    path = link_tracks(groups, section, RADIUS, WIDTH)
    assert len(links(path)) == 9
    assert in_section(path, section) < 1e-6
    # An odd number of strands: the way from bar to bar is straight, but for the bulbs.
    assert sorted(length(link) for link in links(path))[-1] < 25.0


def test_rings_and_strands_together() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    circle[-1] = circle[0]
    ring = shapely.Point(0, 0).buffer(14.5).difference(shapely.Point(0, 0).buffer(11.5))
    section = shapely.union_all([ring, shapely.box(10.0, -2.0, 40.0, 2.0)])
    rings = [r * circle for r in (12.0, 13.0, 14.0)]
    path = link_tracks([rings, bundle((13.0, 0.0), (40.0, 0.0), 4)], section, RADIUS, WIDTH)
    laid = sorted(length(strand) for strand in strands(path))
    assert len(laid) == 7
    np.testing.assert_allclose(laid[:4], 27.0)
    np.testing.assert_allclose(laid[4:], 2 * np.pi * np.array([12.0, 13.0, 14.0]), rtol=0.05)
    assert max(sharpest(link) for link in links(path)) < 1.05 / RADIUS


def test_nothing_one_and_one_closed() -> None:
    empty = link_tracks([[], [np.zeros((1, 2))]], WINDOWED, RADIUS, WIDTH)
    assert empty.points.shape == (0, 2)
    assert links(empty) == []
    for line in ([[0, 0], [1, 0], [5, 1]], [[0, 0], [9, 0], [9, 9], [0, 0]]):
        path = link_tracks([[], [np.array(line, float)]], WINDOWED, RADIUS, WIDTH)
        np.testing.assert_array_equal(path.points, line)
        assert not path.link.any()


def test_bad_input_is_refused() -> None:
    track = [np.array([[0.0, 0.0], [1.0, 0.0]])]
    with pytest.raises(InputError, match="finite"):
        link_tracks([[np.array([[0.0, np.nan], [1.0, 0.0]])]], WINDOWED, RADIUS, WIDTH)
    with pytest.raises(InputError, match="empty"):
        link_tracks([track * 2], shapely.Polygon(), RADIUS, WIDTH)
    with pytest.raises(InputError, match="width"):
        link_tracks([track * 2], WINDOWED, RADIUS, 0.0)


@pytest.mark.parametrize(("weight", "over"), [(0.0, True), (4.0, False)])
def test_a_link_leads_round_the_part_rather_than_over_a_window(weight, over, monkeypatch) -> None:
    """Strands through both walls: 40 mm over the window, or about 115 mm round the part."""
    frame = shapely.box(0, 0, 60, 60).difference(shapely.box(10, 10, 50, 50))
    walls = [np.array([[x, 30.0], [x + 10.0, 30.0]]) for x in (0.0, 50.0)]
    monkeypatch.setattr(single_path, "_WEIGHTS", (8.0, weight, 0.0))
    path = link_tracks([walls], frame, RADIUS, WIDTH)
    (link,) = links(path)
    line = shapely.LineString(link)
    if over:
        assert line.length == pytest.approx(40.0)
    else:
        assert line.intersection(shapely.box(0, 0, 60, 60)).length < 1e-6
        assert line.length < 150.0


def test_long_links_are_left_out() -> None:
    """Links of 10 mm outside, of 2 mm inside, of 5 mm inside, and of 3 mm over the window."""
    section = shapely.box(0, 0, 30, 20) - shapely.box(20, 5, 23, 15)
    points = [[0, 0], [0, -5], [5, -5], [5, 0], [5, 5], [7, 5], [7, 10], [12, 10], [20, 10]]
    points = np.array([*points, [23, 10], [30, 10]], float)
    link = np.isin(np.arange(11), [0, 1, 2, 4, 6, 8])
    link[0] = False
    path = LinkedPath(points, link)
    assert [len(part.points) for part in path.without_long_links(section, 5.0, 3.0)] == [11]
    first, last = path.without_long_links(section, 4.9)
    np.testing.assert_array_equal(first.points, points[:7])
    np.testing.assert_array_equal(last.points, points[7:])
    np.testing.assert_array_equal(
        np.concatenate([first.link, last.link]), np.where(np.arange(11) == 6, False, link)
    )
    over = path.without_long_links(section, 5.0, 2.9)
    assert [len(part.points) for part in over] == [9, 2]


def test_grid_knows_places_and_room() -> None:
    """An island in the window counts as a part of its own."""
    section = shapely.MultiPolygon([WINDOWED, shapely.Point(14, 15).buffer(3.0)])
    filled = shapely.box(0, 0, 40, 30)
    grid = section_grid(section, 10.0)
    random = np.random.default_rng(0)
    points = random.uniform((-15.0, -15.0), (55.0, 45.0), (4000, 2))
    border = shapely.distance(shapely.boundary(section), shapely.points(points))
    inside = shapely.contains_xy(section, points)
    where = np.where(shapely.contains_xy(filled, points), VOID, OUTSIDE)
    where[inside] = INSIDE
    assert set(where) == {INSIDE, VOID, OUTSIDE}
    assert [place(grid, *point) for point in points] == where.tolist()
    assert [contains(grid, *point) for point in points] == inside.tolist()
    cell, room = np.array([place_and_room(grid, *point) for point in points]).T
    assert (room <= border).all()
    assert (cell == where)[room > 0.0].all()
    assert (room[border > 3.0] > 0.0).all()


def test_cost_of_a_curve_is_its_length_and_what_lies_inside_and_over_voids() -> None:
    hole = shapely.Polygon(WINDOWED.interiors[0])
    weights = np.array([8.0, 3.0, 0.0])
    grid = section_grid(WINDOWED, 10.0)
    random = np.random.default_rng(1)
    low, high = (-5.0, -5.0, -3.0), (45.0, 35.0, 3.0)
    starts, ends = random.uniform(low, high, (2, 60, 3))
    words = np.empty((6, 3))
    for k in range(60):
        word_sizes(starts[k], ends[k], 4.0, words)
        possible = np.flatnonzero(np.isfinite(words).all(axis=1))
        word = possible[k % len(possible)]
        turns, sizes = WORDS[word] * np.where(words[word] < 0.0, -1, 1), np.abs(words[word])
        line = shapely.LineString(curve_points(starts[k], ends[k], turns, sizes, 4.0, 0.05))
        inside = line.intersection(WINDOWED)
        crossings = len(shapely.get_parts(inside)) * 2
        found = curve_cost(starts[k], turns, sizes, 4.0, grid, weights, np.inf)
        expected = sizes.sum() + 8.0 * inside.length + 3.0 * line.intersection(hole).length
        assert abs(found - expected) <= 8.0 * (0.125 * crossings + 1e-3) + 1e-6
        assert curve_cost(starts[k], turns, sizes, 4.0, grid, weights, 0.9 * found) == np.inf
