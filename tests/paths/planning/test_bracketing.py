import pytest

from ccfem.paths.planning.bracketing import around, close_in, interpolated


def test_a_power_is_hit_at_once_and_a_line_too():
    """Of 3 x^0.5 in logarithms: 6 is reached at 4. Of 2 x + 1, evenly: 6 is reached at 2.5."""
    logarithms = (0.0, 4.0)  # of x, to the base 2: 1 and 16
    assert interpolated(logarithms, (3.0, 12.0), 6.0) == pytest.approx(2.0)
    assert interpolated((0.0, 5.0), (1.0, 11.0), 6.0, even=True) == pytest.approx(2.5)


def test_the_next_argument_keeps_away_from_both_ends():
    assert interpolated((0.0, 1.0), (0.0, 1.0), 0.001, even=True) == 0.05
    assert interpolated((0.0, 1.0), (0.0, 1.0), 0.999, even=True, kept_away=0.1) == 0.9


def test_the_values_on_either_side():
    known = {1.0: 3.0, 2.0: 5.0, 3.0: 9.0}
    assert around(known, 5.0) == (2.0, 3.0)
    assert around(known, 2.0) == (None, 1.0)
    assert around(known, 10.0) == (3.0, None)


def searched(measured, wanted=(8.0, 8.1), steps=20):
    known = {0.0: 0.0, 4.0: 64.0}

    def following(_):
        low, high = around(known, wanted[0])
        return interpolated((low, high), (known[low], known[high]), wanted[0] + 0.05, even=True)

    close_in(known, measured, 1.0, following, wanted, steps)
    return known


def test_a_cube_root_is_found():
    known = searched(lambda at: (at, at**3))
    assert [at for at, value in known.items() if 8.0 <= value <= 8.1] == [
        pytest.approx(2, abs=0.01)
    ]


def test_what_jumps_over_the_target_ends_the_search():
    """Whole numbers alone are used, and none has a cube from 9 to 10: 1 comes twice."""
    used = []

    def measured(at):
        used.append(round(at))
        return float(round(at)), float(round(at)) ** 3

    known = searched(measured, (9.0, 10.0))
    assert used == [1, 1]
    assert known == {0.0: 0.0, 4.0: 64.0, 1.0: 1.0}


def test_no_more_values_are_taken_than_allowed():
    assert len(searched(lambda at: (at, at**3), (8.0, 8.0), steps=3)) == 2 + 3
