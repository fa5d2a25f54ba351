import numpy as np
import pytest
import shapely

from ccfem.geometry.polylines import turning_angles
from ccfem.strategies.stress_tracing import tracks as turning
from ccfem.strategies.stress_tracing.band import Band, band
from ccfem.strategies.stress_tracing.frame import FREE, Frame, Member, frame
from ccfem.strategies.stress_tracing.main_paths import MainPath, main_paths
from ccfem.strategies.stress_tracing.tracks import clipped, eased, tracks

PULL = [[1.0, 0.0], [0.0, 0.0]]


def in_the_middle(lines):
    """Places across a band without width."""
    return np.zeros(lines.shape[:2])


def only_band(section, step=0.4):
    members = frame(section, step)
    (member,) = members.members
    return band(MainPath((member,), member.closed), members)


def laid(section, width, step=0.4):
    strip = only_band(section, step)
    return tracks(strip, width, section)


def test_straight_strip_is_filled_from_end_to_end():
    found = laid(shapely.box(0, 0, 60, 9), 0.9)
    heights = np.sort([line[:, 1].mean() for line in found])
    np.testing.assert_allclose(heights, 0.45 + 0.9 * np.arange(10), atol=1e-6)
    for line in found:
        assert np.ptp(line[:, 1]) < 1e-6
        np.testing.assert_allclose(np.sort(line[[0, -1], 0]), [0.0, 60.0], atol=1e-9)


def test_member_thinner_than_a_fibre_has_one_track():
    (line,) = laid(shapely.box(0, 0, 40, 0.5), 0.9, 0.1)
    np.testing.assert_allclose(line[:, 1], 0.25, atol=1e-6)


def test_member_without_length_has_tracks_across_its_rails():
    """As between holes that almost touch: both joints take all of it but one point."""
    section = shapely.box(-8, -6, 8, 6) - shapely.box(-8, 2, -1, 6) - shapely.box(-8, -6, -1, -2)
    point, left, right = np.array([[[-5.0, 0.0]], [[-5.0, 2.0]], [[-5.0, -2.0]]])
    members = Frame((Member(point, left, right, (FREE, FREE)),), np.zeros((0, 2)), np.zeros(0))
    strip = band(MainPath(members.members), members)
    found = tracks(strip, 1.0, section)
    assert len(found) == 4
    for line, height in zip(found, (1.5, 0.5, -0.5, -1.5), strict=True):
        np.testing.assert_allclose(line[:, 1], height, atol=1e-9)
        np.testing.assert_allclose(line[[0, -1], 0], [-8.0, 8.0], atol=1e-9)


def test_ring_has_closed_tracks_at_even_distances():
    part = shapely.Point(0, 0).buffer(20, quad_segs=64) - shapely.Point(0, 0).buffer(11, 64)
    found = laid(part, 0.9)
    assert len(found) == 10
    radii = [np.hypot(*line.T) for line in found]
    np.testing.assert_allclose(
        np.sort([r.mean() for r in radii]), 11.45 + 0.9 * np.arange(10), atol=0.01
    )
    for line, radius in zip(found, radii, strict=True):
        np.testing.assert_array_equal(line[0], line[-1])
        assert np.ptp(radius) < 0.02


def heights_at(lines, x):
    """Where lines pass a place, sorted."""
    upright = shapely.LineString([(x, -100.0), (x, 100.0)])
    met = [shapely.intersection(shapely.LineString(line), upright) for line in lines]
    return np.sort([point.y for point in met if not point.is_empty])


def test_the_number_of_tracks_follows_the_width():
    """A wedge 4 to 12 mm wide: tracks leave through its sides, and keep their distance."""
    wedge = shapely.Polygon([(0, -2), (120, -6), (120, 6), (0, 2)])
    found = laid(wedge, 1.0)
    for x in np.arange(10.0, 115.0, 5.0):
        width = 4.0 + x / 15.0
        heights = heights_at(found, x)
        assert np.diff(heights).min() > 0.85
        assert np.diff(heights).max() < 1.25
        assert abs(len(heights) - width) <= 1.2
    # Those that are not there from end to end end on the border, where links turn.
    ends = shapely.points(np.concatenate([line[[0, -1]] for line in found]))
    assert shapely.distance(ends, wedge.boundary).max() < 1e-6
    assert len(heights_at(found, 5.0)) <= 5
    assert len(heights_at(found, 115.0)) >= 11


def test_tracks_that_end_in_a_joint_cross_it_or_stop_in_it(stressed):
    tee = shapely.box(-40, 0, 40, 8) | shapely.box(-3, -40, 3, 0)
    members = frame(tee, 0.4)
    (post,) = (p for p in main_paths(members, stressed(tee, PULL)) if len(p.members) == 1)
    across = tracks(band(post, members), 1.0, tee)
    stopped = tracks(band(post, members, crossing=False), 1.0, tee)
    np.testing.assert_allclose([line[:, 1].max() for line in across], 8.0, atol=1e-6)
    joint = members.joints[0, 1]
    np.testing.assert_allclose([line[:, 1].max() for line in stopped], joint, atol=0.6)


def test_short_excursions_do_not_end_a_track():
    section = shapely.box(0, 0, 20, 10) - shapely.box(9.5, 4, 10.5, 6) - shapely.box(14, 4, 17, 6)
    line = np.stack([np.arange(-5.0, 25.5, 0.5), np.full(61, 5.0)], axis=1)
    kept = clipped(line, section, slice(10, 20), slice(0, 61))
    np.testing.assert_allclose(kept[[0, -1], 0], [0.0, 14.0])


def test_tracks_that_do_not_leave_stop_where_they_may():
    """At the one end the line leaves the section, at the other it ends in it."""
    line = np.stack([np.arange(-5.0, 25.5, 0.5), np.full(61, 5.0)], axis=1)
    kept = clipped(line, shapely.box(0, 0, 40, 10), slice(20, 30), slice(25, 45))
    np.testing.assert_allclose(kept[[0, -1], 0], [0.0, 17.0])


def test_tracks_stay_in_a_section_with_a_notch():
    """The rails jump at the notch: the track beside it would cut its corners."""
    notched = shapely.box(0, 0, 60, 9) - shapely.box(28, 7.5, 32, 9)
    for line in laid(notched, 0.9):
        assert shapely.LineString(line).buffer(1e-9).within(notched.buffer(1e-6))


def test_sharp_turns_are_eased_to_the_radius():
    corner = np.concatenate(
        [
            np.stack([np.arange(-20, 0, 0.5), np.zeros(40)], 1),
            np.stack([np.zeros(41), np.arange(0, 20.5, 0.5)], 1),
        ]
    )
    line = eased(corner, 3.0)
    turn = turning_angles(line, np.array([0, len(line)]), np.zeros(1, dtype=bool))[1:-1]
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    curvature = 2.0 * np.sin(0.5 * turn) / (0.5 * (steps[1:] + steps[:-1]))
    assert curvature.max() <= 1.0 / 3.0 + 1e-9
    np.testing.assert_array_equal(line[[0, -1]], corner[[0, -1]])
    assert eased(corner, 0.0) is corner
    assert curvature.max() == pytest.approx(1.0 / 3.0, rel=0.2)


def test_move_of_a_track_solves_its_equation(monkeypatch):
    """Without bending u'' = u / l^2: a sinh inside, which decays outside, the flux continuous."""
    monkeypatch.setattr(turning, "_BENDING", 0.0)
    x = np.arange(-60.0, 60.25, 0.5)
    middles = 0.5 * (x[1:] + x[:-1])
    free, slope = np.abs(x) < 10.0, np.where(np.abs(middles) < 10.0, 0.2, 0.0)
    hold = np.where(free, 1.0 / 12.0**2, 1.0 / 4.0**2)
    hold[np.abs(x) == 10.0] = 0.5 * (1.0 / 12.0**2 + 1.0 / 4.0**2)
    moved = turning._least_move(np.ones(len(middles)), slope, hold, closed=False)
    size = 0.2 / (np.cosh(10.0 / 12.0) / 12.0 + np.sinh(10.0 / 12.0) / 4.0)
    expected = size * np.where(
        free,
        np.sinh(x / 12.0),
        np.sign(x) * np.sinh(10.0 / 12.0) * np.exp(-(np.abs(x) - 10.0) / 4.0),
    )
    np.testing.assert_allclose(moved, expected, atol=0.01 * expected.max())


def test_tracks_turn_to_the_stress_where_nothing_guides_them(stressed):
    """Stress at 20 degrees to a strip in its middle, along it elsewhere."""
    angle = np.radians(20.0)
    leaning = np.outer(*[[np.cos(angle), np.sin(angle)]] * 2)
    section = shapely.box(0, 0, 60, 20)

    def tensor(points):
        inner = np.abs(points[:, 0] - 30.0) < 10.0
        return np.where(inner[:, None, None], leaning, np.array(PULL))

    x = np.arange(0.0, 60.5, 0.5)
    lines = np.stack([np.stack([x, np.full(len(x), y)], axis=1) for y in (8.0, 12.0)])
    zero = np.zeros((len(x), 2))
    free = (np.abs(x - 30.0) < 10.0).astype(float)
    strip = Band(lines[0], zero, *2 * (slice(0, len(x)),), np.zeros(len(x)), free)
    moved = turning.relaxed(lines, strip, stressed(section, tensor), section, in_the_middle(lines))
    slope = np.degrees(np.arctan(np.diff(moved[0, :, 1]) / 0.5))
    assert 2.0 < slope[60] < 20.0
    np.testing.assert_allclose(moved[:, [0, -1]], lines[:, [0, -1]], atol=0.01)


def test_tracks_along_the_stress_or_across_it_stay(stressed):
    x = np.arange(0.0, 60.5, 0.5)
    lines = np.stack([x, np.full(len(x), 10.0)], axis=1)[None]
    section = shapely.box(0, 0, 60, 20)
    zero = np.zeros((len(x), 2))
    strip = Band(lines[0], zero, *2 * (slice(0, len(x)),), np.zeros(len(x)), np.ones(len(x)))
    for tensor in (PULL, [[0.0, 0.0], [0.0, -1.0]]):
        moved = turning.relaxed(
            lines, strip, stressed(section, tensor), section, in_the_middle(lines)
        )
        np.testing.assert_allclose(moved, lines, atol=1e-9)


def test_tracks_that_turn_keep_apart(stressed):
    """Stress that leans to the middle of a strip from both sides would draw all tracks there."""
    section = shapely.box(0, 0, 60, 20)

    def tensor(points):
        lean = np.arctan(np.where(points[:, 0] < 30.0, -0.05, 0.05) * (points[:, 1] - 10.0))
        along = np.stack([np.cos(lean), np.sin(lean)], axis=1)
        return along[:, :, None] * along[:, None, :]

    x = np.arange(0.0, 60.5, 0.5)
    middle = np.stack([x, np.full(len(x), 10.0)], axis=1)
    half = np.broadcast_to([0.0, 8.0], middle.shape)
    strip = Band(middle, half, *2 * (slice(0, len(x)),), np.zeros(len(x)), np.ones(len(x)))
    lines = middle + np.array([0.75, 0.25, -0.25, -0.75])[:, None, None] * half
    share = np.broadcast_to(np.array([0.75, 0.25, -0.25, -0.75])[:, None], lines.shape[:2])
    turned = turning.relaxed(lines, strip, stressed(section, tensor), section, share)
    apart = -np.diff(turned, axis=0)
    assert apart[..., 1].min() < 3.7
    assert apart[..., 1].min() >= 0.9 * 4.0 - 1e-9


def test_wide_strip_is_filled_to_its_ends():
    """Its axis ends 25 mm before them."""
    for line in laid(shapely.box(0, 0, 185, 50), 5.0, 1.0):
        np.testing.assert_allclose(np.sort(line[[0, -1], 0]), [0.0, 185.0], atol=1e-9)


def test_tracks_do_not_press_together_in_a_long_narrow_member():
    """A fifth of the strip is a third as wide as the rest: there are a third of its tracks."""
    wide, narrow = shapely.box(0, 0, 80, 9), shapely.box(80, 3, 110, 6)
    found = laid(shapely.union(wide, narrow), 0.9)
    assert len(heights_at(found, 40.0)) == 10
    few = heights_at(found, 100.0)
    assert len(few) == 3
    assert np.diff(few).min() > 0.9
