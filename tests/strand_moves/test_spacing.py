import itertools

import numpy as np
import shapely

from ccfem.strand_moves.spacing import Room, apart, pairs_of, walls_of

X = np.linspace(0.0, 40.0, 67)
RADIUS = 4.0


def room_of(count, held=None, closed=False, layer=None):
    offsets = len(X) * np.arange(count + 1)
    held = np.zeros(offsets[-1], dtype=bool) if held is None else held
    layer = np.zeros(count, dtype=np.int64) if layer is None else layer
    return Room(offsets, layer, np.full(count, closed), held, 1.0, RADIUS)


def settled(lines, room, regions=None, rounds=4, sweeps=40):
    points = np.concatenate(lines)
    layer = np.repeat(room.layer, np.diff(room.offsets))
    for _ in range(rounds):
        walls = walls_of(points, layer, regions or {}, 2.0)
        points = apart(points, room, pairs_of(points, room), walls, sweeps)
    return np.split(points, room.offsets[1:-1])


def wave(height, size=0.1, phase=0.0):
    return np.column_stack([X, height + size * np.sin(X / 3.0 + phase)])


def gap(one, other):
    return shapely.distance(shapely.LineString(one), shapely.LineString(other))


def test_strands_that_are_too_near_go_apart_by_half_each():
    lines = settled([wave(0.0, 0.0), wave(0.7, 0.0)], room_of(2))
    assert 0.999 < gap(*lines) < 1.01
    np.testing.assert_allclose(lines[0][:, 1] + lines[1][:, 1], 0.7, atol=1e-3)
    np.testing.assert_allclose(lines[0][:, 0], X, atol=1e-3)  # nothing along the strand


def test_waves_packed_too_tightly_find_room():
    lines = [wave(0.85 * k, 0.15, phase=float(k)) for k in range(8)]
    assert min(gap(a, b) for a, b in itertools.pairwise(lines)) < 0.71
    moved = settled(lines, room_of(8))
    assert min(gap(a, b) for a, b in itertools.pairwise(moved)) > 0.99


def test_held_strands_stay_and_other_layers_do_not_matter():
    held = np.repeat([True, False, False], len(X))
    layer = np.array([0, 0, 1])
    first = [wave(0.0), wave(0.6), wave(0.3)]
    moved = settled(first, room_of(3, held, layer=layer))
    np.testing.assert_array_equal(moved[0], first[0])
    assert gap(moved[0], moved[1]) > 0.99
    np.testing.assert_allclose(moved[2], first[2], atol=1e-6)


def test_strands_stay_in_the_section():
    section = shapely.box(-1.0, 0.0, 41.0, 4.0)
    moved = settled([wave(-0.2 + k) for k in range(5)], room_of(5), {0: section})
    reach = np.concatenate(moved)[:, 1]
    assert reach.min() > -1e-6
    assert reach.max() < 4.0 + 1e-6
    assert min(gap(a, b) for a, b in itertools.pairwise(moved)) > 0.98


def test_turns_get_as_wide_as_the_radius():
    # A ripple of amplitude a and wave number k is bent by a k^2 at most: 0.55 / mm here.
    tight = np.column_stack([X, 0.3 * np.cos(1.35 * X)])
    (moved,) = settled([tight], room_of(1), sweeps=300)
    before, after = np.diff(moved[:-1], axis=0), np.diff(moved[1:], axis=0)
    turn = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    step = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    bend = turn / step / np.linalg.norm(before, axis=1)
    assert bend.max() < 1.02 / RADIUS
