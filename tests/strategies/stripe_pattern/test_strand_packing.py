import numpy as np
import pytest
import shapely

from ccfem.geometry.polylines import line_length, pack
from ccfem.paths.folds import folds
from ccfem.paths.linking.joining import join
from ccfem.strategies.stripe_pattern.strand_packing import (
    corners,
    even_points,
    evened,
    joined_ends,
    stepped_over,
    strands_in_rest,
    with_detours,
)

WIDE = shapely.box(-50.0, -50.0, 150.0, 50.0)


def straight(start, stop, y):
    return np.array([[start, y], [stop, y]], dtype=float)


def test_ends_that_face_each_other_are_joined():
    lines = even_points([straight(0.0, 20.0, 0.0), straight(22.0, 40.0, 0.3)], 1.0)
    (line,) = joined_ends(lines, 1.0)
    assert line_length(line) == pytest.approx(40.0, abs=0.1)
    # Not side by side, nor across another strand, nor over more than three widths.
    for others in (
        [straight(0.0, 20.0, 0.0), straight(20.0, 40.0, 1.5)],
        [straight(0.0, 20.0, 0.0), straight(23.5, 40.0, 0.0)],
        [straight(0.0, 20.0, 0.0), straight(22.0, 40.0, 0.0), [[21.0, -5.0], [21.0, 5.0]]],
    ):
        lines = even_points([np.asarray(line, dtype=float) for line in others], 1.0)
        assert len(joined_ends(lines, 1.0)) == len(others)


def test_lines_move_apart_to_a_width_and_off_the_border():
    lines = even_points([straight(0.0, 40.0, y) for y in (0.0, 0.85, 1.6)], 1.0)
    moved = evened(lines, WIDE, 1.0)
    level = np.array([line[20:-20, 1].mean() for line in moved])
    np.testing.assert_allclose(np.diff(level), 1.0, atol=0.03)
    assert level.mean() == pytest.approx(0.8167, abs=0.05)
    (line,) = evened(even_points([straight(0.0, 40.0, 49.8)], 1.0), WIDE, 1.0)
    np.testing.assert_allclose(line[10:-10, 1], 49.5, atol=0.01)


def test_a_line_too_short_takes_over_the_track_of_its_neighbour():
    lines = even_points([straight(0.0, 30.0, 0.0), straight(0.0, 100.0, 1.0)], 1.0)
    size = sorted(line_length(line) for line in stepped_over(lines, WIDE, 1.0, 20.0))
    assert size == pytest.approx([30.0, 100.0])
    lines = even_points([straight(30.0, 60.0, 0.0), straight(0.0, 120.0, 1.0)], 1.0)
    size = sorted(line_length(line) for line in stepped_over(lines, WIDE, 1.0, 42.0))
    assert size[-2] >= 42.0
    assert sum(length for length in size if length >= 42.0) > 130.0


def test_corners_join_what_is_too_short_side_by_side():
    lines = even_points([straight(0.0, 30.0, y) for y in (0.0, 1.0, 2.0, 3.0)], 1.0)
    joints = corners(lines, 1.0, 42.0)
    assert {end // 2 for joint in joints for end in (joint.first, joint.second)} == {0, 1, 2, 3}
    assert all(joint.marked for joint in joints)
    assert not corners(lines, 1.0, 25.0)


def test_corners_are_chosen_so_that_most_is_long_enough():
    """Of three ends side by side the nearest pair would leave the third line too short."""
    rows = ((0.0, 15.0), (1.0, 30.0), (1.9, 60.0))
    lines = even_points([straight(0.0, stop, y) for y, stop in rows], 1.0)
    (joint,) = corners(lines, 1.0, 42.0)
    assert {joint.first, joint.second} == {0, 2}


@pytest.mark.parametrize("radius", [3.85, 0.0])
def test_what_is_left_is_filled_by_strands_that_fold_only_where_they_may(radius):
    """Rectangles of 60 x 14.5 mm: rings of known length, as long as their corners fit."""
    lines = even_points([straight(0.0, 60.0, 15.0)], 1.0)
    fill, small = strands_in_rest(lines, shapely.box(0.0, 0.0, 60.0, 30.0), 1.0, 42.0, radius)
    assert not small
    corner, least = 0.8 * radius, 0.72 * 3.85
    inset = np.arange(0.5, 7.25 - corner)
    rings = 149.0 - 8.0 * inset - (8.0 - 2.0 * np.pi) * corner
    size = [line_length(line) for line in fill]
    assert size == pytest.approx([rings.sum()] * 2, rel=0.02)
    bends = folds(*pack(fill), np.zeros(2, dtype=bool), least, strict=True)
    assert (bends.counts.sum() == 0) == (radius > 0.0)
    apart = shapely.distance(shapely.linestrings(lines[0]), [*map(shapely.linestrings, fill)])
    np.testing.assert_allclose(apart, 1.0, atol=0.03)


def test_a_strand_makes_a_detour_round_a_ring_beside_it():
    lines = even_points([straight(0.0, 60.0, 0.0), straight(0.0, 60.0, 8.0)], 1.0)
    (ring,) = even_points([np.array([[30, 1], [36, 1], [36, 5], [30, 5], [30, 1]], float)], 1.0)
    far = ring + np.array([0.0, 30.0])
    led, other = with_detours(join(lines, []), [ring, far], 1.0).lines
    np.testing.assert_array_equal(other, lines[1])
    # Two gaps of two steps each in the strand and the ring, and two links across.
    step = 0.4
    assert line_length(led) == pytest.approx(60.0 + 20.0 - 4.0 * step + 2.0, abs=2.0 * step)
    assert shapely.LineString(led).is_simple
    (marks, _) = with_detours(join(lines, []), [ring], 1.0).link
    assert np.count_nonzero(marks) == 2
    assert (np.linalg.norm(np.diff(led, axis=0)[marks[:-1]], axis=1) < 1.5).all()
