"""``ccfem plan --stiffness``, run as a user runs it."""

import pytest

from ccfem.cases.reading import read
from ccfem.cli.run import options_of
from ccfem.cli.wanted_stiffness import least_fibre_options
from ccfem.comparison.compare import solve_and_slice
from ccfem.planning.equal_fibre import plan_to_length
from ccfem.strategies import create
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.virtual_test import virtual_test

QUICK = ["--set-case", "element_size=4.0", "--layers", "2", "--strategy", "zigzag"]


def test_the_options_ask_for_the_fibre_that_reaches_a_stiffness_in_newtons_per_mm():
    case, strategy = read("bar", element_size=4.0), create("zigzag", {})
    stress, _, layers, _ = solve_and_slice(case, 2)
    specimen = Specimen.of(stress)
    bare = specimen.stiffness(stress.displacement, stress.strain_energy)
    asked = {**options_of(2, None, True, None, "auto"), "stiffness": f"{1.15 * bare}N/mm"}
    found = least_fibre_options(case, strategy, asked)
    assert "stiffness" not in found
    assert not found["natural"]
    paths = plan_to_length(strategy, layers, stress, case.machine, found["fibre_per_layer"])
    tested = virtual_test(paths.toolpaths, specimen, span=(), machine=case.machine)
    assert 1.15 * bare <= tested.stiffness <= 1.16 * bare


def test_the_number_of_layers_is_chosen_and_said(capsys):
    case, strategy = read("bar", element_size=4.0), create("zigzag", {})
    asked = {**options_of(None, None, True, None, "auto"), "stiffness": "3"}
    found = least_fibre_options(case, strategy, asked)
    said = capsys.readouterr().out
    count = found["layers"] or 10
    assert f"on {count} layers" in said
    assert said.startswith("3 times the stiffness without fibre takes")
    stress, _, layers, _ = solve_and_slice(case, count)
    paths = plan_to_length(strategy, layers, stress, case.machine, found["fibre_per_layer"])
    assert virtual_test(paths.toolpaths, Specimen.of(stress), span=()).ratio >= 3.0


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["--stiffness", "stiff"], "expects a ratio as 2.5, or N/mm"),
        (["--stiffness", "1N/mm"], "no more than"),
        (["--stiffness", "nan"], "must be a finite number"),
        (["--stiffness", "1e9N/mm"], "no paths on 2 layers exceed"),
        (["--stiffness", "9"], "9 times the stiffness without fibre was asked for"),
        (["--stiffness", "1.2", "--fibre-per-layer", "500"], "drop --fibre-per-layer"),
        (["--stiffness", "1.2", "--no-virtual-test"], "drop --no-virtual-test"),
    ],
)
def test_a_stiffness_that_makes_no_sense_is_answered_in_one_line(ccfem, words, answer):
    code, _, said = ccfem("plan", "bar", *QUICK, *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1
