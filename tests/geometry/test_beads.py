"""Room among strands: against areas of unions of rectangles and rings."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.geometry.beads import beads


def strand(y, z=0.0, length=20.0, angle=0.0):
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.array([[-0.5 * length, y], [0.5 * length, y]])
    return np.c_[along @ np.array([[cosine, sine], [-sine, cosine]]), [z, z]]


def found(lines, layers=None, width=1.0, height=0.1, normal=(0.0, 0.0, 1.0)):
    points = np.concatenate(lines)
    offsets = np.concatenate([[0], np.cumsum([len(line) for line in lines])])
    closed = np.array([np.array_equal(line[0], line[-1]) for line in lines])
    layer = np.zeros(len(lines), dtype=int) if layers is None else np.array(layers)
    normals = np.tile(np.asarray(normal, dtype=float), (len(points), 1))
    return beads(points, normals, offsets, closed, layer, width, height)


def room(lines, **options):
    """Length of strand that finds room."""
    beads_of = found(lines, **options)
    return float((beads_of.length * beads_of.alone).sum())


def test_strands_a_width_apart_keep_all_their_room():
    every = found([strand(1.0 * k) for k in range(5)])
    np.testing.assert_allclose(every.alone, 1.0, rtol=1e-12)
    np.testing.assert_allclose(every.fill, 1.0, rtol=1e-12)


@pytest.mark.parametrize("copies", [2, 3, 7, 40])
def test_copies_of_a_line_have_the_room_of_one(copies):
    assert room([strand(0.0)] * copies) == pytest.approx(20.0, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(places=st.lists(st.floats(0.0, 8.0), min_size=1, max_size=12))
def test_room_is_the_area_of_the_union_of_bands(places):
    """Parallel strands: what finds room, times the width, is an area that shapely finds too."""
    bands = [shapely.box(-10.0, y - 0.5, 10.0, y + 0.5) for y in places]
    area = shapely.union_all(bands).area
    assert room([strand(y) for y in places]) == pytest.approx(area, rel=1e-6)


def test_rings_a_width_apart_keep_their_room():
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    rings = [r * np.c_[np.cos(turn), np.sin(turn), 0.0 * turn] for r in range(2, 12)]
    rings = [np.concatenate([ring[:-1], ring[:1]]) for ring in rings]
    length = sum(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum() for ring in rings)
    assert room(rings) == pytest.approx(length, rel=2e-3)
    assert room([*rings, *rings]) == pytest.approx(length, rel=2e-3)


def test_the_turns_of_a_zigzag_keep_their_room():
    corners = [[-10.0, 10.0], [10.0, -10.0]] * 5
    line = np.array([[x, k, 0.0] for k, pair in enumerate(corners) for x in pair], dtype=float)
    assert room([line]) == pytest.approx(10 * 20.0 + 9.0, rel=1e-3)


def test_back_and_forth_along_its_own_line_takes_room_once():
    steps = np.cumsum(np.tile([0.5, -0.3], 100))
    line = np.c_[np.append(0.0, steps), np.zeros(201), np.zeros(201)]
    assert float(found([line]).length.sum()) == pytest.approx(80.0)
    # it goes 20 mm ahead
    assert room([line]) == pytest.approx(20.0, rel=0.05)


def test_waves_lay_more_than_their_band_holds():
    x = np.linspace(0.0, 20.0, 4001)
    line = np.c_[x, 0.3 * np.sin(2.0 * np.pi * x / 0.6), 0.0 * x]
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    every = found([line])
    fill = float((every.length * every.fill).sum() / every.length.sum())
    assert fill == pytest.approx(length / 20.0, rel=0.05)


@pytest.mark.parametrize(("degrees", "shared"), [(20.0, True), (40.0, False), (90.0, False)])
def test_strands_that_cross_take_no_room(degrees, shared):
    lines = [strand(0.0), strand(0.0, angle=np.radians(degrees))]
    every = found(lines)
    assert (room(lines) < 39.0) == shared
    # Over the crossing lie both, whatever their angle: each loses half of a parallelogram.
    lost = 0.5 / np.sin(np.radians(degrees)) * 2.0
    assert float((every.length * (1.0 - every.every)).sum()) == pytest.approx(lost, rel=0.06)
    assert every.stack.max() == 2.0


def test_layers_nearer_than_a_strand_is_high_share_room():
    assert room([strand(0.0), strand(0.0, z=0.2)], layers=[0, 1]) == pytest.approx(40.0)
    assert room([strand(0.0), strand(0.0, z=0.05)], layers=[0, 1]) == pytest.approx(20.0)


def test_room_turns_with_the_layer():
    lines = [strand(y) for y in (0.0, 0.4, 1.5, 2.2)]
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(0.7) * cross + (1.0 - np.cos(0.7)) * cross @ cross
    turned = room([line @ turn.T for line in lines], normal=turn[:, 2])
    assert turned == pytest.approx(room(lines), rel=1e-9)


def test_order_and_direction_of_the_strands_do_not_matter():
    lines = [strand(y) for y in (0.0, 0.4, 1.5, 2.2)]
    assert room([line[::-1] for line in lines[::-1]]) == pytest.approx(room(lines), rel=1e-9)


def test_no_strand():
    nothing = found([np.zeros((1, 3))])
    assert float(nothing.length.sum()) == 0.0
