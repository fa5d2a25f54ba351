"""Strands cut at tight turns, against lengths that are known by hand."""

from itertools import pairwise

import numpy as np
import pytest
import shapely

from ccfem.geometry.even_steps import OFF, even_steps
from ccfem.geometry.polylines import along_line, is_closed, line_length
from ccfem.geometry.tight_bends import tight_bends, tight_samples
from ccfem.paths.linking.joining import Joined
from ccfem.paths.planning.infill import cut_turns

RADIUS, WIDTH, LEAST = 3.85, 1.0, 42.0


def unmarked(*lines):
    lines = [np.array(line, dtype=float) for line in lines]
    return Joined(lines, [np.zeros(len(line), dtype=bool) for line in lines])


def zigzag(length, count):
    """Lines `length` mm long, a millimetre apart, joined at their ends."""
    points = []
    for k in range(count):
        ends = [(0.0, float(k)), (length, float(k))]
        points += ends if k % 2 == 0 else ends[::-1]
    return points


def circle(radius, count=400):
    angle = 2.0 * np.pi * np.arange(count + 1) / count
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    ring[-1] = ring[0]
    return ring


def cut(*lines, least=LEAST, every=False):
    return cut_turns(unmarked(*lines), RADIUS, WIDTH, least, every=every).lines


def wandering(seed):
    """A line of 200 mm in steps of a millimetre, that turns now and then."""
    random = np.random.default_rng(seed)
    turns = np.where(random.random(200) < 0.08, random.normal(0.0, 0.8, 200), 0.0)
    heading = np.cumsum(turns + random.normal(0.0, 0.02, 200))
    steps = np.column_stack([np.cos(heading), np.sin(heading)])
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


@pytest.mark.parametrize("radius", [3.0, 3.8, 3.9, 8.0])
def test_circles_are_bent_where_their_radius_is_less(radius):
    line = circle(radius)[:-1]  # open: a closed one that is bent all the way round has no ends
    bent = tight_bends(line, along_line(line), False, RADIUS, WIDTH)
    assert len(bent) == (radius < RADIUS)


def test_bends_are_the_same_wherever_a_line_is_sampled():
    """A corner of 90 degrees lies in the middle of its bend; further points change nothing."""
    for before in (20.0, 20.07, 20.31):
        line = np.array([(-before, 0.0), (0.0, 0.0), (0.0, 30.0)])
        ((a, b),) = tight_bends(line, along_line(line), False, RADIUS, WIDTH)
        assert 0.5 * (a + b) - before == pytest.approx(0.0, abs=0.01)
        assert b - a < 2.0 * WIDTH


def test_long_lines_become_strands_of_their_own():
    """Five lines of 50 mm: the four links between them, a millimetre each, are left out."""
    pieces = cut(zigzag(50.0, 5))
    assert [line_length(piece) for piece in pieces] == pytest.approx([50.0] * 5, abs=1e-6)
    strings = [shapely.linestrings(piece) for piece in pieces]
    for one, other in pairwise(strings):
        assert shapely.distance(one, other) == pytest.approx(1.0, abs=1e-6)


def test_short_lines_stay_joined_until_they_are_long_enough():
    """Seven lines of 20 mm: two are too short for the cutter, so that one link is cut, not two."""
    pieces = cut(zigzag(20.0, 7))
    assert len(pieces) == 2
    assert min(map(line_length, pieces)) >= LEAST
    assert sum(map(line_length, pieces)) == pytest.approx(146.0 - 1.0, abs=1e-6)
    (whole,) = cut(zigzag(20.0, 3))
    assert line_length(whole) == pytest.approx(62.0)


def test_a_rectangle_is_cut_at_its_corners():
    """Sides of 60 and 50 mm; each strand keeps a width off the one that begins beside its end."""
    ring = [(0.0, 0.0), (60.0, 0.0), (60.0, 50.0), (0.0, 50.0), (0.0, 0.0)]
    pieces = cut(ring)
    assert sorted(map(line_length, pieces)) == pytest.approx([49.0, 49.0, 59.0, 59.0], abs=0.1)
    strings = [shapely.linestrings(piece) for piece in pieces]
    gaps = [shapely.distance(a, b) for k, a in enumerate(strings) for b in strings[:k]]
    assert min(gaps) == pytest.approx(1.0, abs=0.01)


def test_what_is_bent_all_along_is_not_cut():
    for line in (circle(2.0), circle(20.0), circle(3.0)[:200]):
        (same,) = cut(line, least=5.0)
        np.testing.assert_array_equal(same, line)


def test_marks_of_links_stay_with_their_steps():
    line = np.array([(0.0, 0.0), (50.0, 0.0), (50.0, 1.0), (0.0, 1.0), (0.0, 60.0)])
    marks = np.array([False, False, False, True, False])
    found = cut_turns(Joined([line], [marks]), RADIUS, WIDTH, LEAST)
    for piece, mark in zip(*found, strict=True):
        up = np.append(np.abs(np.diff(piece[:, 0])) < 1e-9, False)
        np.testing.assert_array_equal(mark, up)
    assert [mark.any() for mark in found.link] == [False, False, True]


def test_where_every_bend_is_cut_short_pieces_go():
    """Lines of 50, 20 and 50 mm, a millimetre apart: the one between is too short alone."""
    line = [(0, 0), (50, 0), (50, 1), (30, 1), (30, 2), (80, 2)]
    first, last = cut(line, every=True)
    np.testing.assert_allclose(first[[0, -1]], [(0, 0), (50, 0)], atol=1e-6)
    np.testing.assert_allclose(last[[0, -1]], [(30, 2), (80, 2)], atol=1e-6)
    assert cut(zigzag(20.0, 7), every=True) == []
    assert sum(map(line_length, cut(zigzag(50.0, 5), every=True))) == pytest.approx(250.0)


def test_rings_that_are_bent_all_the_way_round_go():
    assert cut(circle(3.0), least=5.0, every=True) == []
    (same,) = cut(circle(20.0), every=True)
    np.testing.assert_array_equal(same, circle(20.0))


@pytest.mark.parametrize("way", [1, -1])
def test_bends_longer_than_a_turn_are_cut_out(way):
    """A stadium of straights of 60 mm and bends of 2 mm radius: only the straights stay."""
    angle = np.linspace(-0.5, 0.5, 60) * np.pi
    bend = 2.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    ring = np.concatenate([bend + np.array([60.0, 0.0]), -bend])[::way]
    pieces = cut(np.concatenate([ring, ring[:1]]), every=True)
    assert len(pieces) == 2
    for piece in pieces:
        assert 60.0 <= line_length(piece) <= 62.2  # up to a width into the bends
        np.testing.assert_allclose(np.abs(piece[:, 1]), 2.0, atol=0.3)


def test_no_piece_begins_or_ends_with_a_link():
    """Strands of 60 mm, and a link of 10 mm between them that turns at its end."""
    line = np.array([(0.0, 0.0), (60.0, 0.0), (70.0, 0.0), (70.0, 60.0)])
    marks = np.array([False, True, False, False])
    found = cut_turns(Joined([line], [marks]), RADIUS, WIDTH, LEAST, every=True)
    assert [line_length(piece) for piece in found.lines] == pytest.approx([60.0, 60.0])
    assert not np.concatenate(found.link).any()


@pytest.mark.parametrize("seed", range(12))
def test_what_is_kept_is_long_and_bent_nowhere(seed):
    """On the line, no shorter than allowed, and as the evaluator looks at it; mirrored alike."""
    line = wandering(seed)
    pieces = cut(line, least=12.0, every=True)
    assert 0.0 < sum(map(line_length, pieces)) < line_length(line)
    whole = shapely.LineString(line)
    for piece in pieces:
        assert line_length(piece) >= 12.0 - 1e-9
        assert shapely.distance(whole, shapely.points(piece)).max() < 1e-9
        ends, free = np.array([0, len(piece)]), np.zeros(len(piece), dtype=bool)
        laid, _, _, _ = even_steps(piece, ends, free, WIDTH, OFF * WIDTH)
        assert not len(tight_samples(laid, is_closed(piece), RADIUS, WIDTH))
    c, s = np.cos(np.radians(37.0)), np.sin(np.radians(37.0))
    for move in (np.array([[c, s], [-s, c]]), np.diag([1.0, -1.0])):
        moved = cut(line @ move, least=12.0, every=True)
        assert len(moved) == len(pieces)
        for one, other in zip(moved, pieces, strict=True):
            np.testing.assert_allclose(one, other @ move, atol=0.01)
