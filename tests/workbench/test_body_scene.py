"""What is drawn of a body covers it, and its symbols stand where the forces act."""

import numpy as np
import pytest

from ccfem.cases.inspection.face_choice import across
from ccfem.cases.part_draft import PartDraft
from ccfem.comparison.plot.symbols import (
    bed_under,
    box_edges,
    heat_waves,
    pressing,
    swung,
    turning,
)
from ccfem.workbench.drawing import (
    boxes,
    snapped,
    stretched,
    upward,
)


def square(height, normal):
    corners = np.array(
        [[[0, 0, 0], [2, 0, 0], [2, 2, 0]], [[0, 0, 0], [2, 2, 0], [0, 2, 0]]], float
    )
    return (corners if normal > 0 else corners[:, ::-1]) + [0, 0, height]


def test_marks_touch_the_surface_with_their_tips():
    marks = pressing(square(5.0, 1.0), 2, 1.5)
    np.testing.assert_allclose(marks[:, 1] - marks[:, 0], [[0, 0, -1.5]] * 2)
    assert {tuple(tip) for tip in marks[:, 1].round(3)} == {(1.333, 0.667, 5), (0.667, 1.333, 5)}


def test_marks_stand_below_a_point():
    (mark,) = pressing(np.full((1, 3, 3), 4.0), 5, 1.5)
    np.testing.assert_array_equal(mark, [[4.0, 4.0, 2.5], [4.0, 4.0, 4.0]])


@pytest.mark.parametrize("along", [[0, 0, 2.0], [-1.0, 0, 0], [1.0, -2.0, 0.5]])
def test_a_moment_turns_by_the_right_hand(along):
    """Its pieces lie on a circle about the middle of the axis, and hang together up to the head."""
    place, along = np.array([3.0, 1.0, 2.0]), np.array(along)
    pieces = turning(np.stack([place, place + along]), 0.7)
    arms = pieces[:-1] - (place + 0.5 * along)
    np.testing.assert_allclose(np.linalg.norm(arms, axis=2), 0.7)
    np.testing.assert_allclose(arms @ along, 0.0, atol=1e-12)
    np.testing.assert_array_equal(pieces[1:, 0], pieces[:-1, 1])
    steps = pieces[:, 1] - pieces[:, 0]
    assert (np.cross(pieces[:, 0] - (place + 0.5 * along), steps) @ along > 0.0).all()


def test_heat_rises():
    waves = heat_waves(np.array([1.0, 2.0, 3.0]), 4.0)
    assert (waves[:, 1, 2] > waves[:, 0, 2]).all()
    assert waves[..., 2].min() == 3.0
    assert waves[..., 2].max() == 7.0


@pytest.mark.parametrize("angle", [0.0, 5.9, 6.1, 45.0])
def test_a_direction_near_an_axis_takes_it(angle):
    given = 3.0 * np.array([-np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    wanted = [-1.0, 0.0, 0.0] if angle < 6.0 else given / 3.0
    np.testing.assert_allclose(snapped(given), wanted, atol=1e-12)


def test_the_bed_lies_under_the_part_as_it_is_built():
    corners = np.array([[x, y, z] for x in (0.0, 10.0) for y in (0.0, 20.0) for z in (5.0, 6.0)])
    for build, height in (("z", 5.0), ("-z", -6.0), ("x", 0.0), ("-y", -20.0)):
        up = upward(PartDraft({"build": build}))
        rim = bed_under(corners, up)
        assert rim @ up == pytest.approx(height)
        assert ((corners - rim.min(axis=0)) @ (1.0 - abs(up)) > 0.0).all()
    # A turn by 90 degrees about x lays y, which pointed back, upwards.
    np.testing.assert_allclose(upward(PartDraft({"bed": {"turn": "x=90"}})), [0, 1, 0], atol=1e-12)
    assert upward(PartDraft({"build": "w"})) is None


def test_the_bed_swings_as_it_is_dragged():
    up, below = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -30.0])
    # From below the part to its side: what was up looks away from there.
    np.testing.assert_allclose(swung(up, below, np.array([50.0, 0, 0])), [-1, 0, 0], atol=1e-12)
    # About the build direction itself nothing turns; a general turn keeps length and angle.
    here, there = np.array([10.0, 0, 0]), np.array([0.0, 5, 0])
    np.testing.assert_allclose(swung(up, here, there), up, atol=1e-12)
    here, there = np.array([3.0, -4, 2]), np.array([1.0, 7, 5])
    turned = swung(up, here, there)
    assert np.linalg.norm(turned) == pytest.approx(1.0)
    cosine = turned @ there / np.linalg.norm(there)
    assert cosine == pytest.approx(up @ here / np.linalg.norm(here))


def test_a_pin_is_pulled_across_its_axis_and_away_from_the_part():
    np.testing.assert_array_equal(across(np.array([0, 0, 1.0]), np.array([2, -3, 9.0])), [0, -1, 0])
    np.testing.assert_array_equal(across(np.array([1.0, 0, 0]), np.zeros(3)), [0, 1, 0])
    oblique = np.array([2.0, 1.0, 2.0]) / 3.0
    along = across(oblique, np.array([0, 5.0, 0]))
    assert along @ oblique == pytest.approx(0.0, abs=1e-12)
    assert along[1] > 0.5


def test_a_box_is_stretched_by_a_corner_and_takes_the_bounds_of_the_part():
    body, box = np.array([[0, 0, 0], [100.0, 50, 20]]), np.array([[10, 10, 10], [90.0, 40, 18]])
    ends = box_edges(box)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert sorted(lengths) == [8.0] * 4 + [30.0] * 4 + [80.0] * 4
    moved = stretched(box, 0, np.array([20.004, 1.0, -0.5]), body)
    np.testing.assert_allclose(moved, [[20.0, 0, 0], box[1]])
    moved = stretched(box, 1, np.array([5.0, 30.0, 500.0]), body)
    np.testing.assert_allclose(moved, [box[0], [15.0, 30.0, 500.0]])  # not past the other
    regions = [{"rule": "patch"}, {"rule": "box", "lower": [0, 0, 0], "upper": [1, 2, 3]}]
    regions += [{"rule": "box", "lower": [0, 0, 0], "upper": ["inf", 2, 3]}, {"rule": "box"}]
    assert boxes(PartDraft({"fibre": {"regions": regions}})).keys() == {1}
    assert boxes(PartDraft({"fibre": 3})) == {}
