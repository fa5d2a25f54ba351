"""Planning for the load at first failure: what fibre is worth for it, and its design."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from slopes import slopes

from ccfem.base.errors import InputError
from ccfem.fem.elasticity.statics import solve
from ccfem.judging.virtual_testing import failure_laws
from ccfem.judging.virtual_testing.equilibrium import bars, equilibrium
from ccfem.judging.virtual_testing.near_failure import nearness
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import Windows, cut_strands
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.machine import Machine
from ccfem.paths.planning.layer_plans import plan_layers
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies.fibre_aware import cut_and_move, judges, strength_value
from ccfem.strategies.fibre_aware.cut_and_move import Cutting, best_cut, prune_and_move
from ccfem.strategies.fibre_aware.judges import Goal
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.stream_design import design
from ccfem.strategies.fibre_aware.stream_start import start_fields
from ccfem.strategies.fibre_aware.strength_design import StrengthProblem, design_for_strength
from ccfem.strategies.fibre_aware.strength_value import Worth, raised
from ccfem.strategies.pruned import Pruned
from ccfem.strategies.stream_function import StreamFunction

from .test_stream_design import problem_of

SHORT = Machine(minimum_length=10.0)
WIDE = Machine(fibre_width=2.0, minimum_length=10.0)
"""Where fibre is wide there are fewer strands to plan."""


@pytest.fixture(scope="module")
def strong_beam(bent_beam):
    """The bent beam of a material whose strengths are known."""
    stress, layers = bent_beam
    material = replace(stress.problem.material, tensile_strength=50.0, interlayer_tensile=18.0)
    return solve(replace(stress.problem, material=material), tolerance=1e-10)["tip"], layers


@pytest.fixture(scope="module")
def lines(bent_beam):
    """Strands along the beam, nearer to each other where it is pulled."""
    layers = bent_beam[1]
    heights = (2.0, 3.5, 5.0, 8.0, 12.0, 16.0, 20.5)
    each = [np.array([[2.0, y], [58.0, y]]) for y in heights]
    return Toolpaths.concatenate(Toolpaths.from_plane(each, layer) for layer in layers)


def near_of(worth, strands, found, factors=None):
    """Nearness to failure in solutions, with the factors of the first, and these."""
    pieces = bars(strands, worth.parts[0].system.problem.mesh)
    limit = worth.limits.fibre / worth.strand.stiffness(worth.parts[0].modulus)
    normal, peaks = np.array([0.0, 0.0, 1.0]), {}
    for k, (part, judge, one) in enumerate(zip(worth.parts, worth.judges, found, strict=True)):
        strain = pieces.strain(one.displacement)
        fibre = strength_value._fibre(pieces, Windows(strands), strain, one.displacement, limit)
        of_case = judge.peaks(one.displacement, fibre, worth.limits, normal)
        moved = not part.forces.any()
        load = work_of(one) / (2.0 * part.unreinforced.strain_energy) if moved else 1.0
        peaks |= {(k, name): peak.over(load) for name, peak in of_case.items()}
    factors = factors or {key: one.index / one.norm for key, one in peaks.items()}
    return nearness(peaks, factors)[0], factors


def work_of(found):
    """Twice the strain energy, N mm."""
    u = found.displacement
    return float(np.vdot(u, (found.matrix @ u.reshape(-1)).reshape(u.shape)))


@pytest.mark.parametrize("limits", [(86.0, 50.0), (1.0, 1e4), (1e4, 1.0), "brittle"])
def test_value_agrees_with_finite_differences(strong_beam, lines, limits, monkeypatch):
    """More fibre in some pieces, solved anew: both logarithms change as the values say.

    Also with a law of a file, Rankine's of a brittle matrix, which alone decides.
    """
    if limits == "brittle":
        law = SimpleNamespace(index=lambda stress, *_: np.linalg.eigvalsh(stress)[:, -1])
        monkeypatch.setattr(failure_laws, "named", lambda: {"brittle": law})
        limits = (1e4, 1e4)
    specimen = Specimen.of(strong_beam[0])
    strands = cut_strands(lines, specimen.unreinforced.mesh)
    worth = Worth.of((specimen,), Strand(), 1.0)
    worth = replace(worth, limits=Limits(*limits, (18.0, 18.0)))
    axial = Strand().stiffness(specimen.modulus)
    found = equilibrium(specimen, strands, axial, tolerance=1e-12)
    factors = near_of(worth, strands, (found,))[1]
    chosen = np.random.default_rng(2).random(len(strands)) * (found.strain > 1e-6)

    def changed(step):
        other = replace(strands, share=1.0 + step * chosen)
        after = equilibrium(specimen, other, axial, known=(found.displacement,), tolerance=1e-12)
        work = float(np.vdot(specimen.forces, after.displacement))
        return -near_of(worth, other, (after,), factors)[0], -np.log(work)

    up, down = changed(1e-4), changed(-1e-4)
    strong, stiff = ((a - b) / 2e-4 for a, b in zip(up, down, strict=True))
    weight, normal = chosen * strands.length, np.array([0.0, 0.0, 1.0])
    assert weight @ worth(strands, (found,), normal) == pytest.approx(strong, rel=1e-3)
    for share in (0.0, 0.3):
        mixed = replace(worth, strength=share)(strands, (found,), normal)
        assert weight @ mixed == pytest.approx((1.0 - share) * stiff + share * strong, rel=1e-3)


def test_cut_for_strength_leaves_a_stronger_and_softer_part(strong_beam, lines):
    given, layers = strong_beam
    tough = replace(given.problem.material, tensile_strength=150.0, interlayer_tensile=None)
    stress = solve(replace(given.problem, material=tough), tolerance=1e-10)["tip"]
    pulled = lines.select(lines.points[lines.offsets[:-1], 1] < 10.0)
    length = 0.5 * float(pulled.lengths.sum())
    found = []
    for strength in (0.0, 0.5):
        kept = prune(pulled, stress, length, SHORT, strength=strength)
        # As long as asked for, whatever fibre would be better away.
        assert 0.95 * length < kept.lengths.sum() <= length
        test = virtual_test(kept, stress, span=())
        failure = first_failure(test, layers=layers)
        assert failure.what == "fibre"
        found.append((failure.load, test.ratio))
    assert found[1][0] > 1.02 * found[0][0]
    assert found[1][1] < found[0][1]


def test_tests_for_strength_have_the_tolerance_of_those_for_stiffness(
    strong_beam, lines, monkeypatch
):
    """Rough while paths are cut; the last ones of moved paths, which gain little, are exact."""
    stress, layers = strong_beam
    residuals, virtual_tests = [], judges.virtual_tests

    def recorded(*about, tolerance=1e-8, **more):
        residuals.append(tolerance)
        return virtual_tests(*about, tolerance=tolerance, **more)

    monkeypatch.setattr(judges, "virtual_tests", recorded)
    monkeypatch.setattr(cut_and_move, "moved", lambda *_, **__: lines)
    length, how = 0.93 * float(lines.lengths.sum()), Cutting(1, strength=0.5, moves=1)
    prune_and_move([lines], layers, Goal.of(stress), length, SHORT, Strand(), how)
    assert sorted(set(residuals)) == [1e-6, 1e-4]


def test_values_below_zero_are_raised_and_keep_their_order():
    value = np.array([-2.0, 3.0, 0.0, 1.0, -1.0])
    above = raised(value)
    assert above.min() == 0.0
    np.testing.assert_array_equal(np.argsort(above), np.argsort(value))
    np.testing.assert_allclose(above[[1, 3]], [3.0, 1.0], rtol=0.01)
    np.testing.assert_array_equal(raised(value[1:4]), value[1:4])


def test_without_strength_values_are_those_of_the_strain_energy(strong_beam, lines):
    stress, _ = strong_beam
    length = 0.6 * float(lines.lengths.sum())
    one, other = (prune(lines, stress, length, SHORT, **k) for k in ({}, {"strength": 0.0}))
    np.testing.assert_array_equal(one.points, other.points)


@pytest.mark.parametrize("strength", [-0.1, 1.1, float("nan")])
def test_shares_outside_zero_to_one_are_refused(strong_beam, strength):
    with pytest.raises(InputError, match="strength must be"):
        Worth.of((Specimen.of(strong_beam[0]),), None, strength)


@pytest.fixture(scope="module")
def problem(strong_beam):
    stress, layers = strong_beam
    found = problem_of(stress, layers)
    return found, start_fields(found, (stress,), layers[:1], cap=90.0)


@pytest.mark.parametrize("limits", [(86.0, 50.0), (1.0, 1e4), (1e4, 1.0)])
def test_gradient_agrees_with_finite_differences(problem, rng, limits, monkeypatch):
    one, field = problem
    monkeypatch.setattr("ccfem.strategies.fibre_aware.strength_design._TOLERANCE", 1e-10)
    solution = one.evaluate(field, tolerance=1e-12).solution
    whole = StrengthProblem.at(one, Limits(*limits, (18.0, 18.0)), 0.7, field, solution)
    slope, difference = slopes(whole, field, solution, rng)
    assert slope == pytest.approx(difference, rel=1e-3)


def test_a_design_for_strength_takes_the_part_farther_from_failure(problem):
    one, start = problem
    first = design(one, start, 6)
    field, solutions = first.fields[0], first.objective.solution
    second = design_for_strength(one, field, solutions, 0.8, 8)
    limits = Limits.of(one.parts[0].specimen.system.problem.material)
    judged = StrengthProblem.at(one, limits, 1.0, field, solutions)
    before, after = (judged.evaluate(each).value for each in (field, second.fields[0]))
    assert after < before - 0.01
    assert second.objective.ratio > 1.0


@pytest.mark.parametrize("strategy", [StreamFunction, Pruned])
def test_shares_of_strength_outside_zero_to_one_are_refused(strategy):
    with pytest.raises(InputError, match="strength must be at least 0 and at most 1"):
        strategy(strength=2.0)


def test_a_plan_for_strength_keeps_its_length_and_says_what_it_overfilled(strong_beam):
    stress, layers = strong_beam
    strategy = StreamFunction(strength=0.5, evaluations=2, phases=1, inset=0.6)
    told, planner = strategy.to_lengths(stress, layers, WIDE, (200.0,))[0]
    assert told.strength == 0.5
    assert told.overfill >= 1.1
    laid = plan_layers(planner, layers, layers, stress, WIDE).lengths.sum()
    assert 0.9 * 800.0 < laid <= 800.0


@pytest.mark.parametrize(
    ("strategy", "weight"),
    [(StreamFunction(evaluations=2, phases=1, overfill=1.3), 0.2), (Pruned(of="zigzag"), 0.6)],
)
def test_planning_for_strength_is_worth_no_less_than_for_stiffness(strong_beam, strategy, weight):
    stress, layers = strong_beam[0], strong_beam[1][1:2]  # one layer shows it as well
    worth = []
    for strength, moves in ((0.0, 0), (weight, 0), (weight, 1)):
        planned = replace(strategy, strength=strength, moves=moves)
        ((_, planner),) = planned.to_lengths(stress, layers, WIDE, (150.0,))
        tested = virtual_test(planner.toolpaths, stress, span=(), machine=WIDE)
        load = first_failure(tested, layers=layers).load
        worth.append((1.0 - weight) * np.log(tested.ratio) + weight * np.log(load))
    assert worth[1] >= worth[0] - 1e-6
    assert worth[2] >= worth[1] - 1e-6


def test_of_no_fibre_nothing_is_cut():
    def never(*_):
        raise AssertionError("there is nothing to cut or to test")

    for strength in (0.0, 0.5):
        assert not len(best_cut((Toolpaths.empty(),), never, never, strength, 2))


def test_the_strength_of_the_matrix_has_to_be_known(bent_beam):
    stress, layers = bent_beam
    with pytest.raises(InputError, match="needs the strength of the matrix, MPa"):
        StreamFunction(strength=0.5, evaluations=1).to_lengths(stress, layers, SHORT, (200.0,))
