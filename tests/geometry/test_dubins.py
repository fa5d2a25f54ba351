"""Dubins curves beside formulas of other authors, known curves, and their symmetries."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.geometry.dubins import WORDS, curve_points, word_sizes

RADIUS = 1.5


def dubins(starts, ends, radius) -> tuple[np.ndarray, np.ndarray]:
    """Turns and sizes (n, 3) of the shortest word for each pair of poses."""
    turns, found, sizes = [], [], np.empty((6, 3))
    for start, end in zip(starts, ends, strict=True):
        word_sizes(start, end, radius, sizes)
        best = np.abs(sizes).sum(axis=1).argmin()
        turns.append(WORDS[best] * np.where(sizes[best] < 0.0, -1, 1))
        found.append(np.abs(sizes[best]))
    return np.array(turns), np.array(found)


def random_poses(seed: int, count: int, size: float = 6.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    return np.column_stack(
        [random.uniform(-size, size, (count, 2)), random.uniform(-7.0, 7.0, count)]
    )


def length(start, end, radius=RADIUS) -> float:
    return float(dubins(np.array([start], float), np.array([end], float), radius)[1].sum())


def shkel_lumelsky(start, end, radius) -> float:
    """Length by the table of Shkel and Lumelsky, Robotics and Autonomous Systems 34 (2001) 179."""
    dx, dy = (end[0] - start[0]) / radius, (end[1] - start[1]) / radius
    d, way = np.hypot(dx, dy), np.arctan2(dy, dx)
    a, b = (start[2] - way) % (2 * np.pi), (end[2] - way) % (2 * np.pi)
    sa, sb, ca, cb, cab = np.sin(a), np.sin(b), np.cos(a), np.cos(b), np.cos(a - b)

    def turn(x):
        return x % (2 * np.pi)

    found = []
    p = 2 + d * d - 2 * cab + 2 * d * (sa - sb)
    if p >= 0:
        w = np.arctan2(cb - ca, d + sa - sb)
        found.append(turn(w - a) + np.sqrt(p) + turn(b - w))
    p = 2 + d * d - 2 * cab + 2 * d * (sb - sa)
    if p >= 0:
        w = np.arctan2(ca - cb, d - sa + sb)
        found.append(turn(a - w) + np.sqrt(p) + turn(w - b))
    p = -2 + d * d + 2 * cab + 2 * d * (sa + sb)
    if p >= 0:
        w = np.arctan2(-ca - cb, d + sa + sb) - np.arctan2(-2.0, np.sqrt(p))
        found.append(turn(w - a) + np.sqrt(p) + turn(w - b))
    p = -2 + d * d + 2 * cab - 2 * d * (sa + sb)
    if p >= 0:
        w = np.arctan2(ca + cb, d - sa - sb) - np.arctan2(2.0, np.sqrt(p))
        found.append(turn(a - w) + np.sqrt(p) + turn(b - w))
    p = (6 - d * d + 2 * cab + 2 * d * (sa - sb)) / 8
    if abs(p) <= 1:
        p = turn(2 * np.pi - np.arccos(p))
        t = turn(a - np.arctan2(ca - cb, d - sa + sb) + p / 2)
        found.append(t + p + turn(a - b - t + p))
    p = (6 - d * d + 2 * cab + 2 * d * (sb - sa)) / 8
    if abs(p) <= 1:
        p = turn(2 * np.pi - np.arccos(p))
        t = turn(-a + np.arctan2(cb - ca, d + sa - sb) + p / 2)
        found.append(t + p + turn(b - a - t + p))
    return radius * min(found)


def test_lengths_are_those_of_the_published_table() -> None:
    starts, ends = random_poses(1, 2000), random_poses(2, 2000)
    lengths = dubins(starts, ends, RADIUS)[1].sum(axis=1)
    expected = [shkel_lumelsky(*pair, RADIUS) for pair in zip(starts, ends, strict=True)]
    np.testing.assert_allclose(lengths, expected, rtol=1e-9)


def test_all_six_words_occur() -> None:
    turns, _ = dubins(random_poses(3, 500), random_poses(4, 500), RADIUS)
    assert {tuple(word) for word in turns} == {
        (1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (1, -1, 1), (-1, 1, -1)
    }  # fmt: skip


@pytest.mark.parametrize("heading", [0.0, 0.3, -2.0, np.pi])
@pytest.mark.parametrize("start", [(0.0, 0.0), (183.7, 41.3)])
def test_known_curves(heading: float, start: tuple[float, float]) -> None:
    along = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-along[1], along[0]])

    def to(ahead: float, aside: float, turned: float) -> float:
        return length(
            (*start, heading), (*(start + ahead * along + aside * left), heading + turned)
        )

    half = np.pi * RADIUS
    assert to(10.0, 0.0, 0.0) == pytest.approx(10.0, abs=1e-9)
    assert to(0.0, 0.0, 0.0) == pytest.approx(0.0, abs=1e-9)
    # Half circles to both sides, and with a straight line between or after.
    assert to(0.0, 2 * RADIUS, np.pi) == pytest.approx(half, abs=1e-8)
    assert to(0.0, -2 * RADIUS, np.pi) == pytest.approx(half, abs=1e-8)
    assert to(0.0, 5.0, np.pi) == pytest.approx(half + 5.0 - 2 * RADIUS, abs=1e-8)
    assert to(-3.0, 2 * RADIUS, -np.pi) == pytest.approx(half + 3.0, abs=1e-8)
    # Quarter circle; two of them as an S; the same place the other way round: 7/3 pi.
    assert to(RADIUS, RADIUS, np.pi / 2) == pytest.approx(half / 2, abs=1e-8)
    assert to(2 * RADIUS, 2 * RADIUS, 0.0) == pytest.approx(half, abs=1e-6)
    assert to(0.0, 0.0, np.pi) == pytest.approx(7.0 / 3.0 * half, abs=1e-8)
    # A neighbour nearer than a turn is reached by a bulb: three arcs by the law of cosines.
    lean = np.arccos((0.9 + 2 * RADIUS) / (4 * RADIUS))
    bulb = RADIUS * (np.pi + 4 * lean)
    assert to(0.0, 0.9, np.pi) == pytest.approx(bulb, abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_length_does_not_depend_on_the_frame(seed: int) -> None:
    starts, ends = random_poses(seed, 20), random_poses(seed + 1, 20)
    lengths = dubins(starts, ends, RADIUS)[1].sum(axis=1)
    back = np.array([0.0, 0.0, np.pi])
    mirror = np.array([1.0, -1.0, -1.0])
    for other in (
        dubins(ends + back, starts + back, RADIUS),
        dubins(mirror * starts, mirror * ends, RADIUS),
        dubins(turned(starts, seed), turned(ends, seed), RADIUS),
    ):
        np.testing.assert_allclose(other[1].sum(axis=1), lengths, rtol=1e-9)


def turned(poses: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    moved = poses[:, :2] @ np.array([[c, s], [-s, c]]) + [30.0, -20.0]
    return np.column_stack([moved, poses[:, 2] + angle])


@pytest.mark.parametrize("size", [0.5, 2.0, 20.0])
def test_points_meet_both_poses_and_turn_no_tighter_than_the_radius(size: float) -> None:
    step = 0.1
    for start, end in zip(random_poses(5, 40, size), random_poses(6, 40, size), strict=True):
        (turns,), (pieces,) = dubins([start], [end], RADIUS)
        line = curve_points(start, end, turns, pieces, RADIUS, step)
        np.testing.assert_array_equal(line[[0, -1]], [start[:2], end[:2]])
        chords = np.diff(line, axis=0)
        sizes = np.linalg.norm(chords, axis=1)
        assert sizes.max() <= step + 1e-12
        assert sizes.sum() == pytest.approx(length(start, end), rel=step**2 / RADIUS**2)
        # Circle through three neighbouring points.
        a, b, c = line[:-2], line[1:-1], line[2:]
        (u, v), (x, y) = (b - a).T, (c - a).T
        double = np.abs(u * y - v * x)
        product = sizes[:-1] * sizes[1:] * np.linalg.norm(c - a, axis=1)
        assert (2.0 * double / product).max() <= (1.0 + 1e-6) / RADIUS


def test_the_pieces_lead_to_the_end_and_its_heading() -> None:
    starts, ends = random_poses(7, 200), random_poses(8, 200)
    turns, sizes = dubins(starts, ends, RADIUS)
    node, weight = np.polynomial.legendre.leggauss(20)
    place, heading = starts[:, :2].copy(), starts[:, 2].copy()
    for turn, size in zip(turns.T, sizes.T, strict=True):
        bend = turn * size / RADIUS
        way = heading[:, None] + bend[:, None] * (node + 1.0) / 2.0
        place += (
            size[:, None] / 2.0 * np.stack([np.cos(way) @ weight, np.sin(way) @ weight], axis=1)
        )
        heading += bend
    np.testing.assert_allclose(place, ends[:, :2], atol=1e-9)
    np.testing.assert_allclose(np.sin(0.5 * (heading - ends[:, 2])), 0.0, atol=1e-9)
