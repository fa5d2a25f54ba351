"""The rules for strands, on shapes whose turns, crossings and shares are known."""

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.strand_checks import STRAND_RULES, measured
from benchmarks.print_checks.strand_rules import Rules, broken, folds, largest_turn, measure

RULES = Rules()


def strand(*corners):
    return np.array([(x, y, 0.5) for x, y in corners], dtype=float)


def arc(radius, angle=180.0, count=200):
    turn = np.radians(np.linspace(0.0, angle, count))
    return radius * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)


def rules_broken(*lines, section=None):
    strands = measure(lines, RULES, None if section is None else lambda _: section)
    return [set(broken(line, RULES)) for line in strands]


def test_a_circle_turns_by_the_window_over_its_radius():
    assert np.degrees(RULES.window / RULES.radius) == pytest.approx(59.5, abs=0.1)
    for radius in (3.85, 5.0, 10.0):
        turn = np.degrees(RULES.window / radius)
        # Of a polyline it is up to a corner's turn more.
        assert turn - 0.1 < largest_turn(arc(radius), RULES.window) < turn + 4.0
    limit = 2.0 * RULES.window / np.pi
    assert not len(folds(arc(1.05 * limit), RULES.window))
    ((begin, end),) = folds(arc(0.95 * limit), RULES.window)
    assert (begin, end) == pytest.approx((0.0, 0.95 * limit * np.pi), abs=0.15)


def test_a_hairpin_is_a_fold_of_its_own_length_and_parts_the_runs():
    hairpin = strand((0, 0), (50, 0), (50, 1), (20, 1))
    (bent,) = measure([hairpin], RULES)
    np.testing.assert_allclose(bent.folds, [[50.0, 51.0]])
    assert (bent.free, bent.turn) == (50.0, 180.0)
    back = strand((0, 0), (45, 0), (5, 0))
    np.testing.assert_allclose(folds(back, RULES.window), [[45.0, 45.0]])


@pytest.mark.parametrize(("apart", "number"), [(3.9, 1), (4.1, 0)])
def test_two_right_angles_are_a_fold_within_the_window_alone(apart, number):
    line = strand((0, 0), (50, 0), (50, apart), (0, apart))
    assert len(folds(line, RULES.window)) == number


def test_rounded_numbers_make_no_fold():
    x = np.linspace(0.0, 60.0, 6001)
    line = np.stack([x, 0.3 * np.sin(x / 7.0), 0.0 * x], axis=1).round(3)
    assert not len(folds(line, RULES.window))
    corner = strand((0.0, 0.0), (30.001, 0.0), (30.0, 30.0))
    assert not len(folds(corner, RULES.window))


def test_the_share_outside_is_that_of_the_width():
    section = shapely.box(0.0, 0.0, 100.0, 14.0)
    rows = [strand((0, y), (100, y)) for y in (0.0, 0.3, 0.5, 7.0)]
    shares = [line.outside for line in measure(rows, RULES, lambda _: section)]
    assert shares == pytest.approx([0.5, 0.2, 0.0, 0.0], abs=1e-6)
    # A tenth of the strand lies beyond the end.
    (over,) = measure([strand((10, 7), (110, 7))], RULES, lambda _: section)
    assert over.outside == pytest.approx(0.1, abs=0.01)
    assert rules_broken(rows[0], section=section) == [{"outside"}]


def test_a_lattice_has_as_many_crossings_as_pairs():
    along = [strand((0, y), (50, y)) for y in (10, 20, 30)]
    # With a corner in each crossing, which still is line.
    across = [strand((x, 0), (x, 10), (x, 20), (x, 30), (x, 50)) for x in (5, 15, 25, 35)]
    strands = measure([*along, *across], RULES)
    assert [len(line.crossings) for line in strands] == [4, 4, 4, 3, 3, 3, 3]
    assert sum(line.over for line in strands) == pytest.approx(24.0, rel=0.2)
    # On other layers there are none; an end on the side of a strand does not cross it.
    other = [line + np.array([0.0, 0.0, 1.0]) for line in across]
    assert not any(len(line.crossings) for line in measure([*along, *other], RULES))
    assert not len(
        measure([strand((0, 0), (50, 0)), strand((9, 0.3), (9, 60))], RULES)[0].crossings
    )


def test_strands_over_each_other_are_told_from_neighbours():
    def row(y):
        return strand((0, y), (70, y))

    assert rules_broken(row(0.0), row(1.0)) == [set(), set()]
    assert rules_broken(row(0.0), row(0.3)) == [{"over"}, {"over"}]
    assert rules_broken(row(0.0), row(0.7)) == [{"over"}, {"over"}]
    loop = strand((0, 0), (70, 0), (70, 9), (0, 9), (0, 0.2), (60, 0.2))
    assert rules_broken(loop) == [{"over"}]


def test_what_is_held_before_the_cut_is_all_but_the_tail():
    short, long = (measure([strand((0, 0), (x, 0))], RULES)[0] for x in (61.0, 63.0))
    assert (short.before_cut, long.before_cut) == pytest.approx((19.0, 21.0))
    assert [set(broken(line, RULES)) for line in (short, long)] == [{"cut"}, set()]


def test_strands_of_a_file_are_those_that_were_planned(small_part):
    bent = np.array([[5.0, 5.0], [75.0, 5.0], [75.0, 6.0], [10.0, 6.0]])
    plain = np.array([[5.0, 15.0], [80.0, 15.0]])
    job = small_part("marlin_two_tools", lines=(bent, plain))
    strands = measured(job, job.done)
    assert sorted(line.length for line in strands) == pytest.approx(
        [75.0, 75.0, 136.0, 136.0], abs=0.01
    )
    for line in strands:
        assert line.before_cut == pytest.approx(line.length - 42.0, abs=0.05)
        assert line.after_start == line.length
    wrong = {check.__name__: len(check(job, job.done)) for check in STRAND_RULES}
    assert wrong == dict.fromkeys(wrong, 0) | {"folds": 2}
