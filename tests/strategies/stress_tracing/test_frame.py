import numpy as np
import pytest
import shapely
from shapely import affinity

from ccfem.strategies.stress_tracing.frame import FREE, ends_at, frame
from ccfem.strategies.stress_tracing.main_paths import main_paths
from ccfem.strategies.svt import walk

STRIP = shapely.box(0, 0, 60, 9)
CROSS = shapely.union_all(
    [affinity.rotate(shapely.box(-40, -3, 40, 3), angle, origin=(0, 0)) for angle in (30, -30)]
)
PULL = [[1.0, 0.0], [0.0, 0.0]]


def test_strip_is_one_member_between_its_long_sides():
    (member,) = frame(STRIP, 0.5).members
    assert member.ends == (FREE, FREE)
    assert not member.closed
    np.testing.assert_allclose(member.points[:, 1], 4.5, atol=1e-9)
    inner = slice(2, -2)
    np.testing.assert_allclose(member.width[inner], 9.0, atol=1e-9)
    np.testing.assert_array_equal(member.reversed.left, member.right[::-1])


def test_two_bars_that_cross_are_four_members_and_one_joint(monkeypatch):
    """Their axis has two junctions, here as far apart as the radius of their discs."""
    found = frame(CROSS, 0.4)
    assert len(found.members) == 4
    np.testing.assert_allclose(found.joints, [[0.0, 0.0]], atol=0.05)
    assert len(ends_at(found.members, 0)) == 4
    monkeypatch.setattr("ccfem.strategies.stress_tracing.frame._CONTRACTION", 0.0)
    assert len(frame(CROSS, 0.4).members) == 5


@pytest.mark.parametrize("part", [shapely.Point(3, 4).buffer(9), shapely.box(-1, 0, 7, 8)])
def test_disc_and_square_have_no_members(part):
    found = frame(part, 0.3)
    assert found.members == ()
    assert len(found.joints) == 0


def test_ring_is_a_closed_member():
    part = shapely.Point(0, 0).buffer(20, quad_segs=64) - shapely.Point(0, 0).buffer(9)
    (member,) = frame(part, 0.4).members
    assert member.closed
    assert member.ends == (FREE, FREE)


def test_repeated_points_of_the_border_do_not_matter():
    ring = shapely.get_coordinates(STRIP.exterior)
    (one,) = frame(STRIP, 0.5).members
    (other,) = frame(shapely.Polygon(np.repeat(ring, 2, axis=0)), 0.5).members
    np.testing.assert_array_equal(one.points, other.points)


def test_main_paths_go_straight_through_a_crossing(stressed):
    members = frame(CROSS, 0.4)
    paths = main_paths(members, stressed(CROSS, PULL))
    assert [len(path.members) for path in paths] == [2, 2]
    for path in paths:
        a, b = path.members[0].points[0], path.members[-1].points[-1]
        assert abs(abs(np.degrees(np.arctan((b - a)[1] / (b - a)[0]))) - 30.0) < 0.5


def test_no_pair_turns_by_more_than_the_limit(stressed):
    """Bars that cross at 60 degrees: the way straight on is free, that round the corner is not."""
    legs = shapely.box(0, 0, 40, 6) | shapely.box(0, 0, 6, 40) | shapely.box(-40, 0, 0, 6)
    paths = main_paths(frame(legs, 0.4), stressed(legs, PULL))
    assert sorted(len(path.members) for path in paths) == [1, 2]
    (through,) = (path for path in paths if len(path.members) == 2)
    assert np.ptp(np.concatenate([m.points for m in through.members])[:, 0]) > 60.0


def test_width_decides_what_shares_its_tracks(stressed):
    """A wide strip that goes on as a narrow one past a joint is two main paths."""
    part = shapely.box(0, -6, 60, 6) | shapely.box(60, -2, 120, 2) | shapely.box(58, 0, 61, 30)
    members, stress = frame(part, 0.4), stressed(part, PULL)
    assert max(len(path.members) for path in main_paths(members, stress, width_ratio=4.0)) == 2
    assert max(len(path.members) for path in main_paths(members, stress, width_ratio=2.0)) == 1


def test_equal_stress_in_all_directions_stops_nothing(stressed):
    paths = main_paths(frame(CROSS, 0.4), stressed(CROSS, np.eye(2)))
    assert [len(path.members) for path in paths] == [2, 2]


def test_walk_along_a_strip_is_one_straight_path(stressed):
    (path,) = walk(STRIP, stressed(STRIP, PULL), 0.5)
    np.testing.assert_allclose(path[:, 1], 4.5, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.diff(path[:, 0])), 1.0, atol=0.05)
    assert np.ptp(path[:, 0]) == pytest.approx(51.0, abs=0.1)


def test_walk_across_the_stress_finds_nothing(stressed):
    assert walk(STRIP, stressed(STRIP, [[0.0, 0.0], [0.0, 1.0]]), 0.5) == []
