"""Joining, linking, conformal curves and clearance, on pieces made by hand."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.geometry.polylines import line_length
from ccfem.paths.linking.finishing import (
    close_short_ring,
    keep_off_border,
    lead_into,
    parallel_curve,
    trim_to_clearance,
)
from ccfem.paths.linking.joining import Joint, join, link_ends
from ccfem.paths.linking.possible_links import possible_links

SQUARE = shapely.box(0.0, 0.0, 20.0, 20.0)


def vertical(x: float, low: float = 0.0, high: float = 20.0) -> np.ndarray:
    y = np.linspace(low, high, 41)
    return np.column_stack([np.full(41, x), y])


def length(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def test_join_follows_the_joints_whatever_the_direction() -> None:
    a, b, c = vertical(0.0), vertical(1.0), vertical(2.0)
    joined = join([a, b, c], [Joint(1, 3, np.zeros((0, 2))), Joint(2, 4, np.zeros((0, 2)))]).lines
    assert len(joined) == 1
    assert length(joined[0]) == pytest.approx(3 * 20.0 + 2.0)


def test_join_closes_a_ring() -> None:
    a, b = vertical(0.0), vertical(1.0)
    (ring,) = join([a, b], [Joint(0, 2, np.zeros((0, 2))), Joint(1, 3, np.zeros((0, 2)))]).lines
    np.testing.assert_array_equal(ring[0], ring[-1])
    assert length(ring) == pytest.approx(42.0)


@pytest.mark.parametrize("angle", [0.0, 33.0, 90.0, 217.0])
def test_links_along_a_straight_border_do_not_hang_on_how_it_lies(angle: float) -> None:
    """Rounding makes corners of points on the sides of a turned section; links have none there."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, s], [-s, c]])
    border = shapely.get_coordinates(shapely.segmentize(SQUARE, 1.1))
    lines = [np.array([[0.5, y], [7.0, y]]) @ turn for y in (1.5, 3.0, 4.5, 6.0)]
    links = possible_links(lines, shapely.Polygon(border @ turn), 2.0, 1.0)
    assert {len(link.path) for link in links} == {2}


@pytest.mark.parametrize("along_boundary", [True, False])
def test_parallel_strands_become_one_meander(along_boundary: bool) -> None:
    lines = [vertical(x) for x in (2.0, 4.0, 6.0, 8.0)]
    (path,) = link_ends(lines, SQUARE, 3.0, 1.0, along_boundary=along_boundary).lines
    assert length(path) == pytest.approx(4 * 20.0 + 3 * 2.0, abs=3.1)
    assert shapely.LineString(path).is_simple
    assert shapely.covers(SQUARE, shapely.LineString(path))


@pytest.mark.parametrize("angle", np.linspace(0.0, 90.0, 13))
def test_strands_that_end_half_a_width_off_a_hole_are_linked_round_it(angle: float) -> None:
    """Rounding puts their ends just inside or outside the line that the links follow."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    rotation = np.array([[c, s], [-s, c]])
    hole = shapely.Point(0.0, 0.0).buffer(6.0, quad_segs=64)
    plate = shapely.box(-20.0, -20.0, 20.0, 20.0).difference(hole)
    plate = shapely.transform(plate, lambda points: points @ rotation)
    rays = [np.array([[-3.0, 5.0], [-9.0, 15.0]]), np.array([[3.0, 5.0], [9.0, 15.0]])]
    kept = keep_off_border([ray @ rotation for ray in rays], plate, 0.5)
    (path,) = link_ends(kept, plate, 7.5, 1.0).lines
    # Straight from end to end the link would lead over the hole, so it follows a circle of 6.5 mm.
    expected = 2.0 * (np.hypot(9.0, 15.0) - 6.5) + 2.0 * 6.5 * np.arctan(0.6)
    assert length(path) == pytest.approx(expected, abs=0.01)
    assert shapely.distance(shapely.LineString(path), plate.boundary) >= 0.5 - 1e-3


def test_of_equal_links_the_straight_one_is_taken_whatever_rounding_says() -> None:
    """A straight edge with a point in its middle, which a link along it would keep."""
    plate = shapely.Polygon([(0, 0), (4, 0), (10, 0), (10, 12), (0, 12)])
    for angle in np.linspace(0.0, 2.0 * np.pi, 60):
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, s], [-s, c]])
        turned = shapely.transform(plate, lambda points, by=rotation: points @ by)
        lines = [np.array([[x, 0.2], [x, 2.0 * x]]) @ rotation for x in (3.0, 5.5)]
        (path,) = link_ends(keep_off_border(lines, turned, 0.5), turned, 2.7, 1.0).lines
        assert len(path) == 4


def test_links_do_not_cross_strands_holes_or_the_limit() -> None:
    lines = [vertical(2.0), vertical(4.0)]
    assert len(link_ends(lines, SQUARE, 1.5, 1.0).lines) == 2
    between = np.array([[3.0, -10.0], [3.0, 30.0]])
    assert len(link_ends([*lines, between], shapely.box(0, -12, 20, 32), 2.5, 1.0).lines) == 3
    holed = SQUARE.difference(shapely.box(2.5, -1.0, 3.5, 21.0))
    assert len(link_ends(lines, holed, 2.5, 1.0).lines) == 2


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_links_stay_inside_and_cross_nothing(seed: int) -> None:
    random = np.random.default_rng(seed)
    disc = shapely.Point(0, 0).buffer(10.0).difference(shapely.Point(2, 0).buffer(3.0))
    lines = []
    for x in np.arange(-9.0, 9.0, 1.1 + random.random()):
        piece = shapely.intersection(shapely.LineString([(x, -20), (x, 20)]), disc)
        lines += [shapely.get_coordinates(p) for p in shapely.get_parts(piece)]
    paths = link_ends(lines, disc, random.uniform(1.0, 6.0), 1.0).lines
    assert len(paths) <= len(lines)
    strings = [shapely.LineString(path) for path in paths]
    assert all(shapely.covers(disc.buffer(1e-9), string) for string in strings)
    assert all(string.is_simple for string in strings)
    assert not any(a.crosses(b) for i, a in enumerate(strings) for b in strings[:i])


def test_parallel_curve_of_a_round_hole_is_a_circle() -> None:
    hole = shapely.Point(10, 10).buffer(3.0, quad_segs=64)
    (ring,) = parallel_curve(hole, 1.5, SQUARE.difference(hole))
    np.testing.assert_allclose(np.hypot(*(ring - 10.0).T), 4.5, atol=0.01)
    np.testing.assert_array_equal(ring[0], ring[-1])


def test_lines_are_led_round_the_hole() -> None:
    hole = shapely.Point(10, 10).buffer(3.0, quad_segs=64)
    section = SQUARE.difference(hole)
    pieces = []
    for x in (9.0, 11.0):
        parts = shapely.get_parts(section.intersection(shapely.LineString([(x, 0), (x, 20)])))
        pieces += [shapely.get_coordinates(part) for part in parts]
    led = lead_into(pieces, hole, 2.5, section)
    assert len(led) == 2
    for line in led:
        assert shapely.distance(shapely.LineString(line), hole) == pytest.approx(2.5, abs=0.01)


def test_the_shorter_of_two_close_strands_is_cut() -> None:
    long, short = vertical(5.0, 0.0, 20.0), vertical(5.5, 5.0, 15.0)
    kept = trim_to_clearance([short, long], 1.0, 2.0)
    assert len(kept) == 1
    np.testing.assert_array_equal(kept[0], long)
    slanted = np.column_stack([np.linspace(5.2, 9.0, 60), np.linspace(1.0, 14.0, 60)])
    kept = trim_to_clearance([slanted, long], 1.0, 2.0)
    assert len(kept) == 2
    assert shapely.distance(*[shapely.LineString(line) for line in kept]) >= 1.0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_trimmed_strands_keep_the_clearance(seed: int) -> None:
    random = np.random.default_rng(seed)
    lines = []
    for _ in range(8):
        angle = random.uniform(0, np.pi) + np.linspace(0, random.uniform(-1, 1), 80)
        step = 0.3 * np.column_stack([np.cos(angle), np.sin(angle)])
        lines.append(random.uniform(0, 20, 2) + np.cumsum(step, axis=0))
    kept = trim_to_clearance(lines, 1.0, 3.0)
    strings = [shapely.LineString(line) for line in kept]
    of = [
        next(k for k, line in enumerate(lines) if (line == piece[1]).all(1).any()) for piece in kept
    ]
    # pieces of one strand follow each other, with a gap where a part of it was cut out
    nearest = [
        a.distance(b)
        for i, a in enumerate(strings)
        for j, b in enumerate(strings[:i])
        if of[i] != of[j]
    ]
    # Vertices keep the clearance exactly. Where the middles of two steps of 0.3 mm pass each other
    # at a right angle, four vertices 1 mm apart leave them sqrt(1 - 2 * 0.15^2) mm.
    assert min([*nearest, 1.0]) >= np.sqrt(1.0 - 2.0 * 0.15**2) - 1e-9
    assert all(string.length >= 3.0 * (1.0 - 1e-12) for string in strings)


def test_a_short_ring_runs_on_over_its_start() -> None:
    angle = np.linspace(0.0, 2 * np.pi, 65)
    ring = 6.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    ring[-1] = ring[0]
    assert length(ring) == pytest.approx(40.8, abs=0.1)
    longer = close_short_ring(ring, 42.0)
    assert length(longer) == pytest.approx(42.0)
    assert length(longer) >= 42.0
    assert close_short_ring(ring, 50.0) is ring
    assert close_short_ring(ring, 40.0) is ring


def test_strands_side_by_side_become_zigzags_where_any_turn_is_allowed():
    """Seven strands of 15 mm: one zigzag without a radius, none with it, for its turns fold."""
    lines = [np.array([[2.0, 2.0 + k], [17.0, 2.0 + k]]) for k in range(7)]
    section = shapely.box(0.0, 0.0, 19.0, 10.0)
    (zigzag,), _ = link_ends(lines, section, 2.6, 1.0, one_by_one=True)
    assert line_length(zigzag) == pytest.approx(7 * 15.0 + 6.0)
    apart = link_ends(lines, section, 2.6, 1.0, radius=3.85, enough=42.0, one_by_one=True)
    assert [line_length(line) for line in apart.lines] == 7 * [15.0]
