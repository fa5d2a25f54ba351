"""``ccfem plan --stiffness``, run as a user runs it."""

import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.comparison.engine import compare
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

QUICK = ["--set-case", "element_size=4.0", "--layers", "2", "--strategy", "zigzag"]


def test_the_plan_is_the_least_fibre_that_reaches_a_stiffness_in_newtons_per_mm():
    case = read("bar", element_size=4.0)
    specimen = Specimen.of(solve(case.problem)["pull"])
    field = specimen.unreinforced
    bare = specimen.stiffness(field.displacement, field.strain_energy)
    planned = compare(case, ["zigzag"], layers=2, stiffness=f"{1.13 * bare}N/mm")
    (run,) = planned.runs
    assert run.seconds["plan"] > 0.0  # as of every other run, for the report
    about = (planned.layers, case.problem.mesh, case.machine)
    strands = carrying_strands(run.toolpaths, run.strategy, *about)
    tested = virtual_test(strands, specimen, span=())
    # Turns fold and carry nothing, so the stiffness rises in steps, by rows.
    assert 1.13 * bare <= tested.stiffness <= 1.15 * bare
    # Asked for that length, the strategy lays the same: the plan can be repeated.
    strategy, stress = create("zigzag", {}), planned.stress
    again = plan_to_length(strategy, planned.layers, stress, case.machine, planned.wanted)
    assert again.toolpaths.lengths.sum() == pytest.approx(run.toolpaths.lengths.sum(), rel=1e-12)


def test_the_number_of_layers_is_chosen_and_said():
    mesh, pull = box_mesh((60.0, 8.0, 2.0), (10, 3, 2)), (Force("x_max", (100.0, 0.0, 0.0)),)
    problem = Problem(mesh, isotropic(3500.0, 0.0), (Support("x_min"),), {"pull": pull}, order=1)
    case = Case("bar", "", problem, slicing=Planar(count=1), machine=Machine())
    strategy = create("zigzag", {"angle": 0.0, "turn": 0.0})
    planned = compare(case, {"zigzag": strategy}, stiffness="2.5")
    count = len(planned.layers)
    assert count in (1, 2)
    (said,) = (line for line in planned.remarks if "takes" in line)
    assert said.startswith("zigzag: 2.5 times the stiffness without fibre takes")
    assert f" on {count} layers, " in said
    specimen = Specimen.of(planned.stress)
    assert virtual_test(planned.runs[0].toolpaths, specimen, span=()).ratio >= 2.5


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["--stiffness", "stiff"], "expects a ratio as 2.5, or N/mm"),
        (["--stiffness", "1N/mm"], "no more than"),
        (["--stiffness", "nan"], "must be a finite number"),
        (["--stiffness", "1e9N/mm"], "no paths on 2 layers exceed"),
        (["--stiffness", "9"], "9 times the stiffness without fibre was asked for"),
        (
            ["--stiffness", "1.2", "--fibre-per-layer", "500"],
            "(--fibre-per-layer) and stiffness (--stiffness): drop",
        ),
        (["--stiffness", "1.2", "--no-virtual-test"], "drop --no-virtual-test"),
    ],
)
def test_a_stiffness_that_makes_no_sense_is_answered_in_one_line(ccfem, words, answer):
    code, _, said = ccfem("plan", "bar", *QUICK, *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1


def test_with_all_load_cases_every_one_is_as_stiff():
    mesh = box_mesh((40.0, 16.0, 4.0), (10, 4, 2))
    loads = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),), "side": (Force("x_max", (0, 40.0, 0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), loads, order=1)
    machine = Machine(minimum_length=10.0)
    case = Case("beam", "", problem, slicing=Planar(count=2), machine=machine)
    strategy = create("stream_function", {"evaluations": 2, "phases": 1, "inset": 0.6})
    planned = compare(case, {"stream": strategy}, layers=2, load_case="all", stiffness="1.3")
    (run,) = planned.runs
    assert run.strategy.objective == "least"
    said = " ".join(planned.remarks)
    assert "stream: 1.3 times the stiffness without fibre in every load case takes" in said
    ratios = run.tested.cases.tension.ratios
    # Strands come and go one by one, and the least ratio leaps with each.
    assert 1.3 - 1e-5 < ratios.min() < 1.32
    for name, ratio in zip(("pull", "side"), ratios, strict=True):
        assert f"{ratio:.4g} times in '{name}'" in said


PLATE = ["--set-case", "element_size=8", "--layers", "2", "--strategy", "zigzag"]


@pytest.mark.parametrize(
    ("stiffness", "answer"),
    [
        ("1000N/mm", "is that of one load case, and these differ without fibre (N/mm: "),
        ("9", "asked for in every load case; no paths on 2 layers exceed 2.953 in 'tension'"),
        ("1.75", "asked for in every load case; no paths on 2 layers bring all of them above 1.6"),
        ("1.5", "asked for in every load case; 1."),
        ("1.0", "must be above 1"),
    ],
)
def test_all_load_cases_and_a_stiffness_that_makes_no_sense(ccfem, stiffness, answer):
    words = [*PLATE, "--load-case", "all", "--stiffness", stiffness]
    code, _, said = ccfem("plan", "two_load_plate", *words)
    assert code == 2
    assert answer in said
    assert said.count("ccfem: error: ") == 1
