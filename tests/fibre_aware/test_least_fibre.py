import pytest

from ccfem.errors import InputError
from ccfem.fibre_aware.least_fibre import least_fibre
from ccfem.machine import Machine
from ccfem.strategies import create

MACHINE = Machine(minimum_length=20.0)


def test_a_bar_takes_the_fibre_that_parallel_bars_say(pulled_bar):
    """Straight fibre of length L in all adds 4 L / V to a stiffness of 1."""
    stress, layers = pulled_bar
    found = least_fibre(create("eqs", {}), layers, stress, MACHINE, 1.5)
    assert 1.5 <= found.ratio <= 1.51
    exact = (found.ratio - 1.0) * 60.0 * 20.0 * 4.0 / 4.0
    assert found.planned.toolpaths.lengths.sum() == pytest.approx(exact, rel=0.03)
    assert found.ratio in [ratio for _, ratio in found.tried]


def test_too_much_is_refused_with_the_most_that_there_is(pulled_bar):
    stress, layers = pulled_bar
    with pytest.raises(
        InputError, match=r"9 times .* is the most of .* mm per layer: ask for less"
    ):
        least_fibre(create("eqs", {}), layers, stress, MACHINE, 9.0)
    with pytest.raises(InputError, match="stiffness over that without fibre"):
        least_fibre(create("eqs", {}), layers, stress, MACHINE, 0.9)
