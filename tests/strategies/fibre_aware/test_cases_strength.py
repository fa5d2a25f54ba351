"""Planning for the load at first failure under several load cases, one at a time."""

from dataclasses import replace

import numpy as np
import pytest
from slopes import slopes

from ccfem.base.errors import InputError
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing.equilibrium import equilibrium
from ccfem.judging.virtual_testing.several_cases import cases_failure, specimens, virtual_tests
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware.judges import Goal, strength_judge
from ccfem.strategies.fibre_aware.plan_cases import plan_cases
from ccfem.strategies.fibre_aware.stream_start import start_fields
from ccfem.strategies.fibre_aware.strength_design import StrengthProblem, design_for_strength
from ccfem.strategies.fibre_aware.strength_value import Worth
from ccfem.strategies.fibre_aware.upper_bound import WORST, measures
from ccfem.strategies.pruned import Pruned
from ccfem.strategies.stream_function import StreamFunction

from .test_stream_design import problem_of
from .test_strength import near_of, work_of

SHORT = Machine(minimum_length=6.0)
WIDE = Machine(fibre_width=2.0, minimum_length=6.0)
"""Where fibre is wide there are fewer strands to plan."""


def of_strong_material(cases):
    """Cases whose material has known strengths, solved to the last digits."""
    fields = {}
    for problem in {id(field.problem): field.problem for field in cases.fields}.values():
        material = replace(problem.material, tensile_strength=50.0, interlayer_tensile=18.0)
        fields |= solve(replace(problem, material=material), tolerance=1e-10)
    return WeightedCases.of(fields, dict(zip(fields, cases.weights, strict=True)))


@pytest.fixture(scope="module")
def strong_bends(two_bends):
    return of_strong_material(two_bends[0]), two_bends[1]


@pytest.fixture(scope="module")
def strong_plate(pulled_and_moved):
    """Pulled by a force along x, by a support that moves along y."""
    return of_strong_material(pulled_and_moved[0]), pulled_and_moved[1]


def crossed(layers):
    """Strands along x and along y, 3 mm apart, in every other layer."""
    found = []
    for k, layer in enumerate(layers):
        x, y = layer.plane.points.min(axis=0) + 1.0, layer.plane.points.max(axis=0) - 1.0
        if k % 2:
            each = [np.array([[x[0], at], [y[0], at]]) for at in np.arange(x[1], y[1], 3.0)]
        else:
            each = [np.array([[at, x[1]], [at, y[1]]]) for at in np.arange(x[0], y[0], 3.0)]
        found.append(Toolpaths.from_plane(each, layer))
    return Toolpaths.concatenate(found)


@pytest.mark.parametrize("part", ["strong_bends", "strong_plate"])
@pytest.mark.parametrize("limits", [(86.0, 50.0), (1.0, 1e4), (1e4, 1.0)])
def test_value_agrees_with_finite_differences(request, part, limits):
    """More fibre in some pieces, every case solved anew: logarithms change as the values say."""
    cases, layers = request.getfixturevalue(part)
    parts = specimens(cases)
    strands = cut_strands(crossed(layers), parts[0].unreinforced.mesh)
    worth = replace(Worth.of(parts, Strand(), 1.0), limits=Limits(*limits, (18.0, 18.0)))
    axial, normal = Strand().stiffness(parts[0].modulus), np.array([0.0, 0.0, 1.0])
    found = [equilibrium(one, strands, axial, tolerance=1e-12) for one in parts]
    factors, counts = near_of(worth, strands, found)[1], np.array([0.3, 0.7])
    chosen = np.random.default_rng(3).random(len(strands))
    chosen *= np.max([one.strain for one in found], axis=0) > 1e-6

    def changed(step):
        other = replace(strands, share=1.0 + step * chosen)
        after = [
            equilibrium(one, other, axial, known=(near.displacement,), tolerance=1e-12)
            for one, near in zip(parts, found, strict=True)
        ]
        # Stiffness falls with the work of forces, and grows with that of supports that move.
        signs = [-1.0 if one.forces.any() else 1.0 for one in parts]
        stiff = [sign * np.log(work_of(one)) for sign, one in zip(signs, after, strict=True)]
        return -near_of(worth, other, after, factors)[0], counts @ stiff

    up, down = changed(1e-4), changed(-1e-4)
    strong, stiff = ((a - b) / 2e-4 for a, b in zip(up, down, strict=True))
    for share in (0.0, 0.4, 1.0):
        value = replace(worth, strength=share)(strands, found, normal, counts)
        expected = (1.0 - share) * stiff + share * strong
        assert (chosen * strands.length) @ value == pytest.approx(expected, rel=1e-3)


def started(cases, layers, shares):
    problem = problem_of(cases, layers, shares, np.array([2.0, 3.0]), 4.0, size=3.0)
    return problem, 0.6 * start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)


@pytest.mark.parametrize("part", ["strong_bends", "strong_plate"])
@pytest.mark.parametrize("limits", [(86.0, 50.0), (1.0, 1e4), (1e4, 1.0)])
def test_gradient_agrees_with_finite_differences(request, rng, part, limits, monkeypatch):
    problem, field = started(*request.getfixturevalue(part), [0.25, 0.75])
    monkeypatch.setattr("ccfem.strategies.fibre_aware.strength_design._TOLERANCE", 1e-10)
    solutions = problem.evaluate(field, tolerance=1e-12).solution
    whole = StrengthProblem.at(problem, Limits(*limits, (18.0, 18.0)), 0.7, field, solutions)
    slope, difference = slopes(whole, field, solutions, rng)
    assert slope == pytest.approx(difference, rel=1e-3)


def test_two_fields_in_half_of_the_layers_each_are_as_near_to_failure_as_one(strong_bends):
    # Alike, they are that one in all layers: the same indices, whatever the shares.
    problem, field = started(*strong_bends, [0.25, 0.75])
    alike = np.tile(field[: len(field) // 2], 2)
    limits, near = Limits(86.0, 50.0, (18.0, 18.0)), []
    for shares in ([0.25, 0.75], [0.6, 0.4], [1.0, 0.0]):
        posed = replace(problem, shares=np.array(shares))
        solutions = posed.evaluate(alike, tolerance=1e-9).solution
        whole = StrengthProblem.at(posed, limits, 1.0, alike, solutions)
        near.append(whole.evaluate(alike, solutions, 1e-9))
    assert near[0].value == pytest.approx(near[1].value, rel=1e-6)
    assert near[0].value == pytest.approx(near[2].value, rel=1e-6)
    assert np.isfinite(near[2].gradient).all()


def test_a_design_for_strength_takes_all_cases_farther_from_failure(strong_bends):
    problem, field = started(*strong_bends, [0.5, 0.5])
    solutions = problem.evaluate(field).solution
    second = design_for_strength(problem, field, solutions, 0.8, 10)
    limits = Limits.of(problem.parts[0].specimen.system.problem.material)
    judged = StrengthProblem.at(problem, limits, 1.0, field, solutions)
    before, after = (judged.evaluate(each).value for each in (field, second.fields.ravel()))
    assert after < before - 0.01


def test_the_judge_weighs_what_each_test_alone_says(strong_plate):
    cases, layers = strong_plate
    goal = Goal(specimens(cases), cases.weights, np.array([2.0, 3.0]))
    paths, strand = crossed(layers), Strand()
    alone = [virtual_test(paths, field, strand, span=(), machine=SHORT) for field in cases.fields]
    ratios = np.array([one.ratio for one in alone])
    loads = np.array([first_failure(one, strand, layers=layers).load for one in alone])
    # Force without fibre: that of the load along x, and along y of the reactions.
    bare = [goal.parts[k].force(field.reactions) for k, field in enumerate(cases.fields)]
    for strength in (0.0, 0.3, 1.0):
        judge = strength_judge(goal, layers, SHORT, strand, strength, tolerance=1e-8)
        expected = goal.merit(ratios) ** (1.0 - strength) * (loads / bare).min() ** strength
        assert judge(paths).value == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(
    ("strategy", "weight"),
    [
        (StreamFunction(evaluations=2, phases=1, overfill=1.3, inset=0.6), 0.6),
        (Pruned(of="zigzag"), 0.25),
    ],
)
def test_planning_for_strength_is_worth_no_less_than_for_stiffness(strong_bends, strategy, weight):
    cases, layers = strong_bends[0], strong_bends[1][1:2]  # one layer shows it as well
    parts, worth = specimens(cases), []
    bounds = measures(WORST, cases, layers, 250.0 * len(layers), WIDE)
    goal = Goal(parts, cases.weights, bounds)
    for strength, moves in ((0.0, 0), (weight, 0), (weight, 1)):
        planned = replace(strategy, strength=strength, moves=moves)
        ((told, planner),) = planned.for_cases(cases, layers, WIDE, (250.0,))
        assert told.strength == strength
        tested = virtual_tests(planner.toolpaths, parts, machine=WIDE)
        merit, factor = goal.merit(tested.ratios), cases_failure(tested, layers=layers).factor
        worth.append((1.0 - weight) * np.log(merit) + weight * np.log(factor))
    assert worth[1] >= worth[0] - 1e-5
    assert worth[2] >= worth[1] - 1e-5


def test_the_strength_of_the_matrix_has_to_be_known(two_bends):
    cases, layers = two_bends
    with pytest.raises(InputError, match="needs the strength of the matrix, MPa"):
        plan_cases(StreamFunction(strength=0.5, evaluations=1), layers, cases, SHORT, 200.0)
