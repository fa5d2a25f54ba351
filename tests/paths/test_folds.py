"""Folds of strands against curves whose turns are known."""

import numpy as np
import pytest

from ccfem.geometry.even_steps import even_steps
from ccfem.geometry.polylines import pack, resample, subdivide
from ccfem.paths.folds import WINDOW, Folds, folds

RADIUS = 3.85


def of(*lines, closed=None, radius=RADIUS, strict=False) -> Folds:
    lines = [np.array(line, dtype=float) for line in lines]
    closed = [bool((line[0] == line[-1]).all()) for line in lines] if closed is None else closed
    return folds(*pack(lines), np.array(closed), radius, strict)


def arc(radius, degrees, count=721):
    angle = np.radians(np.linspace(0.0, degrees, count))
    points = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    if degrees == 360:
        points[-1] = points[0]
    return points


def hairpin(leg, radius, count=200):
    """Two legs beside each other, joined by a half circle."""
    half = arc(radius, 180, count) @ [[0.0, 1.0], [-1.0, 0.0]]
    return np.concatenate([[[-leg, -radius]], half[::-1] * [-1.0, 1.0], [[-leg, radius]]])


def corner_into_arc(degrees, leg=50.0):
    """A leg that meets a circle of the least radius at an angle: they turn by 59.5 degrees more."""
    along, turn = arc(RADIUS, 100, 16) @ [[0.0, -1.0], [1.0, 0.0]], np.radians(degrees)
    start = along[0] - leg * np.array([np.cos(turn), -np.sin(turn)])
    return np.concatenate([[start], along])


def stepped(line, step):
    points, _ = resample(np.asarray(line, float), np.array([0, len(line)]), step)
    return points


def test_window_is_four_millimetres_by_default():
    assert pytest.approx(4.0) == WINDOW * RADIUS


@pytest.mark.parametrize("radius", [0.3, 0.5, 1.0, 2.0])
def test_hairpin_folds_in_its_half_circle(radius):
    """Of a half circle every quarter turn folds, so all of it; its legs do not."""
    folded = of(hairpin(50.0, radius))
    assert folded.counts.tolist() == [1]
    middle = 50.0 + 0.5 * np.pi * radius
    assert folded.places[0] == pytest.approx(middle, abs=0.11)
    assert folded.folded[0] == pytest.approx(np.pi * radius, abs=0.25)
    line, start, stop = folded.free()
    assert line.tolist() == [0, 0]
    np.testing.assert_allclose(stop - start, 50.0, atol=0.15)
    assert folded.longest_free[0] == pytest.approx(50.0, abs=0.15)


@pytest.mark.parametrize("step", [0.05, 0.3, 1.0, 2.0, None])
@pytest.mark.parametrize("radius", [2.2, 2.4, 2.7, 3.0, 3.85, 10.0])
def test_arc_folds_if_it_turns_a_quarter_within_the_window(radius, step):
    """4 mm of a circle turn by 4 / R: a quarter at R = 2.546, wherever points are taken."""
    line = arc(radius, 300)
    folded = of(line if step is None else stepped(line, step))
    assert (folded.counts[0] > 0) == (radius < 8.0 / np.pi)


@pytest.mark.parametrize("radius", [1.0, 2.4, 2.7, 3.85])
def test_ring_folds_everywhere_or_nowhere(radius):
    folded = of(arc(radius, 360))
    around = 2.0 * np.pi * radius
    assert folded.folded[0] == pytest.approx(around if radius < 8.0 / np.pi else 0.0, rel=1e-3)
    assert folded.longest_free[0] == pytest.approx(around - folded.folded[0], abs=0.01)


def test_polygon_of_many_points_is_its_circle():
    assert of(arc(5.0, 360, 10_001)).counts.tolist() == [0]
    assert of(arc(0.2, 360, 10_001)).longest_free.tolist() == [0.0]


@pytest.mark.parametrize(("degrees", "fold"), [(60, 0), (90, 0), (95, 1), (150, 1), (180, 1)])
def test_corner_folds_beyond_a_right_angle(degrees, fold):
    turn = np.radians(degrees)
    line = [(-30.0, 0.0), (0.0, 0.0), (30.0 * np.cos(turn), 30.0 * np.sin(turn))]
    assert of(line).counts.tolist() == [fold]
    assert of(stepped(line, 0.5)).counts.tolist() == [fold]
    if fold:
        assert of(line).places[0] == pytest.approx(30.0, abs=0.1)


def test_two_square_corners_fold_within_the_window_only():
    """A turn back by two corners: a fold if they are less than a window apart."""
    for apart, fold in [(1.0, 1), (2.5, 1), (6.1, 0)]:
        line = [(0.0, 0.0), (30.0, 0.0), (30.0, apart), (0.0, apart)]
        assert of(line).counts.tolist() == [fold], apart


def test_wavers_of_a_tenth_of_a_millimetre_are_no_folds():
    """Points of a planned strand, which turns by more than a right angle over 0.15 mm, and back."""
    line = [
        (9.266, 45.939), (9.641, 45.481), (10.016, 45.023), (10.402, 44.575), (10.755, 44.1),
        (10.726, 43.952), (10.845, 43.973), (10.892, 43.805), (10.906, 43.793), (10.935, 43.693),
        (11.066, 43.692), (11.083, 43.586), (11.145, 43.576), (11.536, 43.12), (11.928, 42.665),
    ]  # fmt: skip
    assert of(line).counts.tolist() == [0]
    assert of(line[::-1]).counts.tolist() == [0]


@pytest.mark.parametrize(("degrees", "fold"), [(20, 0), (27, 0), (35, 1), (42, 1), (60, 1)])
def test_strict_folds_are_those_of_the_polyline_as_it_is(degrees, fold):
    """A corner and 4 mm of the circle behind it turn by 59.5 degrees more than the corner."""
    line = corner_into_arc(degrees)
    for points in (line, line[::-1]):
        assert of(points, strict=True).counts.tolist() == [fold]
    assert of(line).counts.tolist() == [int(degrees > 45)]


@pytest.mark.parametrize(("degrees", "fold"), [(60, 0), (90, 0), (92, 1), (150, 1)])
def test_strict_corners_fold_beyond_a_right_angle(degrees, fold):
    turn = np.radians(degrees)
    line = [(-30.0, 0.0), (0.0, 0.0), (30.0 * np.cos(turn), 30.0 * np.sin(turn))]
    folded = of(line, strict=True)
    assert folded.counts.tolist() == [fold]
    # The pieces of a strand that is cut there are to end apart.
    assert folded.folded[0] == pytest.approx(fold * 0.5 * WINDOW * RADIUS)


def test_strict_folds_near_the_ends_of_a_strand_and_the_start_of_a_ring_stay_on_it():
    hook = [(0.0, 0.0), (30.0, 0.0), (29.7, 0.3)]
    folded = of(hook, hook[::-1], strict=True)
    np.testing.assert_allclose(folded.start, [29.05, 0.0], atol=0.06)
    np.testing.assert_allclose(folded.stop, [folded.lengths[0], 1.37], atol=0.06)
    ring = of([(0.0, 0.0), (60.0, 0.0), (30.0, 8.0), (0.0, 0.0)], strict=True)
    _, start, stop = ring.free()
    assert ring.counts.tolist() == [2]
    assert (stop - start).sum() + ring.folded[0] == pytest.approx(ring.lengths[0])
    assert ring.folded[0] == pytest.approx(2 * 0.5 * WINDOW * RADIUS)


def test_whatever_folds_also_folds_strictly():
    """Strands of wavering curvature, with corners, in the steps of planned ones."""
    random = np.random.default_rng(3)
    lines = []
    for _ in range(150):
        bend = np.convolve(random.normal(0.0, 1.0, 200), np.hanning(random.integers(5, 30)), "same")
        heading = np.cumsum(0.25 * 0.2 * bend / bend.std())
        heading += np.cumsum((random.random(200) < 0.01) * random.uniform(-1.8, 1.8, 200))
        line = 0.25 * np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
        lines.append(even_steps(line, np.array([0, 200]), np.zeros(200, bool), 1.0, 0.005)[0])
    mild, strict = of(*lines).counts > 0, of(*lines, strict=True).counts > 0
    assert 50 < mild.sum() < 120
    assert not (mild & ~strict).any()


def test_turns_to_and_fro_cancel():
    """Right by 80 degrees and left again within the window is a step aside, no fold."""
    turn = np.radians(80.0)
    line = np.cumsum([(0, 0), (30, 0), (2.0 * np.cos(turn), 2.0 * np.sin(turn)), (30, 0)], axis=0)
    assert of(line).counts.tolist() == [0]


@pytest.mark.parametrize("step", [0.05, 2.0])
def test_verdict_does_not_hang_on_the_points(step):
    for line, fold in [(hairpin(40.0, 0.5), 1), (hairpin(40.0, 5.0), 0), (arc(30.0, 350), 0)]:
        assert of(stepped(line, step)).counts.tolist() == [fold]


def test_points_on_straight_pieces_change_nothing():
    bent = [(0.0, 0.0), (20.0, 0.0), (21.0, 1.6), (19.0, 1.6), (0.0, 1.0)]
    more = [*bent[:2], (20.1, 0.16), *bent[2:3], (20.4, 1.6), *bent[3:]]
    one, other = of(bent), of(more)
    np.testing.assert_allclose([other.start, other.stop], [one.start, one.stop], atol=1e-9)


@pytest.mark.parametrize("step", [0.1, 0.6])
def test_rounded_points_on_straight_pieces_change_nothing(step):
    """Rows 1 mm apart, with many points, as files hold them: in coordinates rounded to 1e-4 mm."""
    ends = [(x, float(y)) for y in range(20) for x in ((0.0, 40.0) if y % 2 else (40.0, 0.0))]
    slant = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    rows = np.array(ends) @ slant
    rounded = np.round(subdivide(rows, np.array([0, len(rows)]), step)[0], 4)
    one, other = of(rows), of(rounded)
    assert one.counts == other.counts == 19
    assert other.folded[0] == pytest.approx(one.folded[0], abs=1e-3)
    np.testing.assert_allclose(other.places, one.places, atol=1e-3)


@pytest.mark.parametrize("begin", [1, 57, 58, 131])
def test_a_ring_folds_alike_wherever_it_begins(begin):
    angle = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
    out = 6.0 + 4.5 * np.cos(3.0 * angle) + 0.4 * np.cos(2.0 * angle + 0.3)
    ring = out[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    one = of(np.concatenate([ring, ring[:1]]))
    turned = np.roll(ring, -begin, axis=0)
    other = of(np.concatenate([turned, turned[:1]]))
    assert one.counts.tolist() == other.counts.tolist()
    assert one.counts[0] >= 2
    before = np.linalg.norm(np.diff(ring[: begin + 1], axis=0), axis=1).sum()
    start = (other.start + before) % one.lengths[0]
    order = np.argsort(start)
    np.testing.assert_allclose(start[order], one.start, atol=1e-9)
    sizes = (other.stop - other.start)[order]
    np.testing.assert_allclose(sizes, one.stop - one.start, atol=1e-9)


def test_short_strands_and_points():
    """Shorter than the window: it is the turn that counts. No length: nothing does."""
    assert of([(0.0, 0.0), (1.0, 0.0)]).longest_free.tolist() == [1.0]
    assert of([(0.0, 0.0), (1.0, 0.0), (0.0, 0.1)]).counts.tolist() == [1]
    nothing = of([(1.0, 1.0), (1.0, 1.0)])
    assert nothing.counts.tolist() == [0]
    assert nothing.longest_free.tolist() == [0.0]
    assert len(folds(np.zeros((0, 3)), np.zeros(1, int), np.zeros(0, bool), RADIUS).lengths) == 0


def test_closed_strand_is_measured_across_its_start():
    """A drop whose tip is the start: one fold there, and one free part round the rest."""
    tip = np.radians(150.0)
    body = arc(20.0, 360 - 150, 400) @ [[np.cos(tip), np.sin(tip)], [-np.sin(tip), np.cos(tip)]]
    drop = np.concatenate([[[40.0, 0.0]], body, [[40.0, 0.0]]])
    folded = of(drop, closed=[True])
    assert of(drop, closed=[False]).counts.tolist() == [0]
    assert folded.counts.tolist() == [1]
    tip_at = folded.places[0]
    assert min(tip_at, folded.lengths[0] - tip_at) < 0.11
    line, start, stop = folded.free()
    assert line.tolist() == [0]
    assert (stop - start + folded.folded)[0] == pytest.approx(folded.lengths[0])


def test_free_parts_and_folds_make_up_each_strand():
    """Many strands at once, open and closed, with several folds and with none."""
    square = np.array([(0, 0), (20, 0), (20, 20), (0, 20), (0, 0)], dtype=float)
    star = np.array([(0, 0), (30, 5), (0, 10), (15, -20), (15, 25), (0, 0)], dtype=float)
    zigzag = np.array([(0, 0), (30, 0), (30, 1), (0, 1), (0, 2), (30, 2)], dtype=float)
    folded = of(square, star, zigzag, [(0, 0), (9, 0)])
    assert folded.counts.tolist() == [0, 5, 2, 0]
    line, start, stop = folded.free()
    assert np.bincount(line).tolist() == [1, 5, 3, 1]
    total = np.bincount(line, stop - start) + folded.folded
    np.testing.assert_allclose(total, folded.lengths)
    one_by_one = [of(each).folded[0] for each in (square, star, zigzag, [(0, 0), (9, 0)])]
    np.testing.assert_allclose(folded.folded, one_by_one)


def test_folds_are_measured_in_space_and_by_the_radius():
    """Turned out of its plane a hairpin folds as before; for a finer machine it is a bend."""
    flat = hairpin(40.0, 1.0)
    turn = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(of(flat @ turn).start, of(flat).start)
    assert of(flat, radius=1.0).counts.tolist() == [0]  # radius / 1.512 < 1
    assert of(flat, radius=1.6).counts.tolist() == [1]


def test_folds_of_one_line_are_its_own_beside_a_longer_one():
    long = np.array([[0.0, 50.0], [300.0, 50.0], [300.0, 51.0], [0.0, 51.0]])
    rows = [[[0.0, y], [15.0, y]][:: -1 if y % 2 else 1] for y in range(6)]
    short = np.array([point for row in rows for point in row], dtype=float)
    offsets = np.array([0, len(long), len(long) + len(short)])
    found = folds(np.concatenate([long, short]), offsets, np.zeros(2, dtype=bool), 3.85)
    assert found.counts.tolist() == [1, 5]


def test_a_machine_that_turns_on_the_spot_folds_nothing():
    hairpin = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 0.1], [0.0, 0.1]])
    assert of(hairpin, radius=0.0).counts.tolist() == [0]


@pytest.mark.parametrize("radius", [1e-6, 1e-3, 0.05])
def test_least_radii_take_no_more_samples_than_places_that_differ(radius):
    """A hairpin 1 mm wide, with eight metres of strand."""
    line = np.array([[0.0, 0.0], [4e3, 0.0], [4e3, 1.0], [0.0, 1.0]])
    assert of(line, radius=radius).counts.tolist() == [0]


def test_folds_of_many_lines_are_those_of_each(monkeypatch):
    random = np.random.default_rng(1)
    lines = [np.cumsum(random.normal(0.0, 3.0, (40, 2)), axis=0) for _ in range(30)]
    whole = of(*lines)
    assert whole.counts.sum() > 100
    monkeypatch.setattr("ccfem.paths.folds._BATCH", 1000)  # a few lines at a time
    few = of(*lines)
    for name in ("line", "start", "stop"):
        np.testing.assert_allclose(getattr(few, name), getattr(whole, name), rtol=1e-9)


@pytest.mark.parametrize("strict", [False, True])
def test_a_polyline_folds_alike_alone_and_beside_others(strict):
    # A tiny ring, strands that turn too little in a window, and one that turns too much.
    lines = [arc(0.1, 360, 13), arc(300.0, 10), arc(3.0, 80), arc(1.5, 170), arc(60.0, 300)]
    together, alone = of(*lines, strict=strict), [of(line, strict=strict) for line in lines]
    assert together.counts.tolist() == [int(bends.counts[0]) for bends in alone]
    assert together.counts[1:].tolist() == [0, 0, 1, 0]
    assert together.stop == pytest.approx(np.concatenate([bends.stop for bends in alone]))
