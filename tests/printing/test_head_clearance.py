"""Heads beside walls, and islands that stand in their way: what clears them is known."""

import numpy as np
import pytest

from ccfem.machine import Kinematics, Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.curved_stack import Islands, clashes, island_order, rests_on, steps_of
from ccfem.printing.poses import Matter, cleared, touched_length, under_bed

UP = np.array([0.0, 0.0, 1.0])
FIVE = Machine(head_angle=35.0, head_length=30.0, kinematics=Kinematics("head_head"))
BED = 50.0
"""Height of all this above the bed, mm."""


def wall(height):
    """An upright wall at x = 0, 80 mm long, of points half a millimetre apart."""
    y, z = np.meshgrid(np.arange(-40.0, 40.1, 0.5), np.arange(0.0, height + 0.1, 0.5))
    return np.column_stack([np.zeros(y.size), y.ravel(), BED + z.ravel()])


def strand(distance):
    """A line of 40 mm along the wall."""
    y = np.linspace(-20.0, 20.0, 81)
    points = np.column_stack([np.full(81, distance), y, np.full(81, BED)])
    one = [np.array([value]) for value in (1, FIBRE, False)]
    return Toolpaths(points, np.tile(UP, (81, 1)), np.array([0, 81]), *one)


@pytest.mark.parametrize(("distance", "height"), [(5.0, 10.0), (5.0, 20.0), (3.0, 8.0)])
def test_head_leans_off_a_wall_by_what_clears_its_top(distance, height):
    """The cone's near side is 35 degrees less its lean off upright; the wall's top is at atan."""
    paths, matter = strand(distance), Matter.of(wall(height), np.zeros(len(wall(height)), int))
    needed = 35.0 - np.degrees(np.arctan(distance / height))
    assert 0.0 < needed < 30.0
    found = cleared(paths, paths.normals, matter, FIVE)
    assert found.before == pytest.approx(40.0)
    assert found.after == 0.0
    assert found.place is None
    lean = np.degrees(np.arccos(found.axes[:, 2]))
    np.testing.assert_allclose(lean, 5.0 * np.ceil(needed / 5.0), atol=1e-6)
    assert (found.axes[:, 0] > 0.0).all()
    # An upright head, or one that may not tilt so far, touches it still, and says where.
    upright = Machine(head_angle=35.0, head_length=30.0)
    same = cleared(paths, paths.normals, matter, upright)
    assert same.after == same.before == pytest.approx(40.0)
    np.testing.assert_allclose(same.place, [distance, -20.0, BED])
    stiff = Machine(
        head_angle=35.0, head_length=30.0, kinematics=Kinematics("head_head", tilt_limit=4.0)
    )
    assert cleared(paths, paths.normals, matter, stiff).after == pytest.approx(40.0)
    # A wall that is printed later is in nobody's way.
    later = Matter.of(wall(height), np.ones(len(wall(height)), int))
    assert touched_length(paths, paths.normals, later, FIVE) == 0.0


def test_a_wall_too_near_is_reported_and_a_low_one_is_nothing():
    paths, matter = strand(0.3), Matter.of(wall(10.0), np.zeros(len(wall(10.0)), int))
    assert cleared(paths, paths.normals, matter, FIVE).after == pytest.approx(40.0)
    low = Matter.of(wall(5.0), np.zeros(len(wall(5.0)), int))
    assert touched_length(strand(3.6), strand(3.6).normals, low, FIVE) == 0.0


def test_side_of_a_head_dips_under_the_bed_when_tilted_beyond_its_half_angle():
    for tilt, height, under in ((50.0, 0.1, False), (60.0, 0.1, True), (60.0, 4.0, False)):
        angle = np.radians(tilt)
        axis = np.array([[np.sin(angle), 0.0, np.cos(angle)]])
        # 30 mm / cos 35 long, 5 degrees below level: 3.19 mm.
        assert under_bed(np.array([[0.0, 0.0, height]]), axis, FIVE)[0] == under


def islands_of(*blocks):
    """One island a block of points, on layers one after the other."""
    sizes = [len(block) for block in blocks]
    points = np.concatenate(blocks)
    count = len(blocks)
    return Islands(
        layer=np.arange(count),
        piece=np.zeros(count),
        points=points,
        normals=np.tile(UP, (len(points), 1)),
        tops=points,
        area=np.full(len(points), 4.0),
        offsets=np.append(0, np.cumsum(sizes)),
        reach=np.full(count, 2.5),
    )


def plate(x, z):
    """Points 2 mm apart, 10 mm square."""
    a, b = np.meshgrid(np.arange(0.0, 10.1, 2.0), np.arange(0.0, 10.1, 2.0))
    return np.column_stack([x + a.ravel(), b.ravel(), np.full(a.size, z)])


def test_an_island_waits_for_those_that_it_would_hide():
    """A low stack of two, and between them in the numbers a tower 12 mm beside it, 20 mm high."""
    tower = np.column_stack([np.full(11, 22.0), np.full(11, 5.0), np.linspace(0.0, 20.0, 11)])
    islands = islands_of(plate(0.0, 0.0), tower, plate(0.0, 1.0))
    rest, clash = rests_on(islands), clashes(islands, UP, FIVE)
    assert np.argwhere(rest).tolist() == [[2, 0]]
    # From the plates the tower is in the way up to (20 - z) tan 35; from the tower nothing is.
    reach = 20.0 * np.tan(np.radians(35.0))
    near = plate(0.0, 0.0)
    off = np.hypot(22.0 - near[:, 0], 5.0 - near[:, 1])
    assert clash[0, 1] == 4.0 * (off < reach).sum() > 0.0
    assert clash[1, [0, 2]].tolist() == [0.0, 0.0]
    order = island_order(rest, clash)
    assert order.tolist() == [0, 2, 1]
    # Out of reach there is no reason to leave the order of the layers; nor where it rests on it.
    far = islands_of(plate(0.0, 0.0), np.add(tower, [20.0, 0.0, 0.0]), plate(0.0, 1.0))
    assert island_order(rests_on(far), clashes(far, UP, FIVE)).tolist() == [0, 1, 2]
    bound = rest.copy()
    bound[2, 1] = True
    assert island_order(bound, clash).tolist() == [0, 1, 2]
    assert [step.tolist() for step in steps_of(islands, order, clash)] == [[0], [2], [1]]


def test_islands_of_a_layer_are_printed_at_one_go_unless_they_clash():
    tower = np.column_stack([np.full(11, 22.0), np.full(11, 5.0), np.linspace(0.0, 20.0, 11)])
    for gap, steps in ((0.0, [[0], [1]]), (20.0, [[0, 1]])):
        islands = islands_of(plate(0.0, 0.0), np.add(tower, [gap, 0.0, 0.0]))
        islands = Islands(**{**vars(islands), "layer": np.zeros(2)})
        clash = clashes(islands, UP, FIVE)
        order = island_order(rests_on(islands), clash)
        # The plate comes first: above the tower nothing is in the way of it.
        assert order.tolist() == [0, 1]
        found = [step.tolist() for step in steps_of(islands, order, clash + clash.T)]
        assert found == steps
