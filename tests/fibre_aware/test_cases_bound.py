from dataclasses import replace

import numpy as np
import pytest

from ccfem.elasticity.problem import Force, Support
from ccfem.elasticity.solve import solve
from ccfem.elasticity.weighted_cases import WeightedCases
from ccfem.errors import InputError
from ccfem.fibre_aware.cases_bound import (
    LEAST,
    SUM,
    WORST,
    cases_bound,
    cases_certificate,
    largest_gathered,
)
from ccfem.fibre_aware.cases_judges import CasesGoal
from ccfem.fibre_aware.heights import fibre_capacity
from ccfem.fibre_aware.prune_cases import prune_cases
from ccfem.fibre_aware.smeared import SmearedPart, SmearedSolution, smeared_cases
from ccfem.fibre_aware.upper_bound import certificate
from ccfem.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.several_cases import specimens, virtual_tests

MACHINE = Machine()
RHO = 4.0


@pytest.mark.parametrize("objective", [WORST, SUM])
def test_plate_pulled_along_x_or_y_is_best_with_half_the_fibre_each_way(two_pulls, objective):
    # Uniform stress and no Poisson effect: a density m along x makes 1 + rho m of one case and
    # nothing of the other. Alone 1 + rho m, together at most 1 + rho m / 2 each.
    cases, layers = two_pulls
    length = 600.0
    m = length / (24.0 * 24.0 * 4.0)
    found = cases_bound(cases, layers, length, MACHINE, objective=objective)
    np.testing.assert_allclose(found.singles, 1.0 + RHO * m, rtol=1e-3)
    exact = (1.0 + RHO * m) / (1.0 + RHO * m / 2.0)
    assert found.least == pytest.approx(exact, rel=2e-3)
    assert found.least <= found.reached * (1.0 + 1e-9)
    np.testing.assert_allclose(found.factors, 0.5, atol=0.01)
    ratios = np.full(2, 1.0 + RHO * m / 2.0)
    assert found.gap(ratios) == pytest.approx(0.0, abs=2e-3)
    np.testing.assert_allclose(found.shares(ratios), 1.0 / exact, rtol=1e-3)


def test_the_least_ratio_of_a_plate_is_bounded_by_half_the_fibre_each_way(two_pulls):
    cases, layers = two_pulls
    m = 600.0 / (24.0 * 24.0 * 4.0)
    found = cases_bound(cases, layers, 600.0, MACHINE, objective=LEAST)
    np.testing.assert_array_equal(found.singles, 1.0)
    assert 1.0 / found.least == pytest.approx(1.0 + RHO * m / 2.0, rel=2e-3)
    assert 1.0 / found.least >= (1.0 + RHO * m / 2.0) * (1.0 - 1e-9)
    assert found.value([1.5, 2.0]) == 1.0 / 1.5


def test_one_case_has_the_bound_of_upper_bound(bent_beam):
    stress, layers = bent_beam
    part = SmearedPart.of(stress, layers[0].plane.frame)
    most, axial = fibre_capacity(part, layers, MACHINE), RHO * part.modulus
    bound = certificate(part, part.unreinforced, axial, most, 2000.0)
    least = cases_certificate([part], [part.unreinforced], np.ones(1), axial, most, 2000.0)
    # Ratio <= bound is compliance >= compliance without fibre / bound; less the angles' margin.
    assert part.unreinforced.work / bound * (1.0 - 2e-4) < least
    assert least <= part.unreinforced.work / bound * (1.0 + 1e-12)
    found = cases_bound(WeightedCases.of({"tip": stress}), layers, 2000.0, MACHINE, iterations=10)
    assert 1.0 - 3e-3 < found.least <= 1.0 + 1e-9


def test_no_feasible_density_goes_below_the_bound(two_bends, rng):
    # Any density and direction in each cell, at most one strand a width, of the given length.
    cases, layers = two_bends
    length = 2500.0
    bounds = {
        each: cases_bound(cases, layers, length, MACHINE, objective=each, iterations=12)
        for each in (WORST, SUM, LEAST)
    }
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    most, axial = fibre_capacity(parts[0], layers, MACHINE), RHO * parts[0].modulus
    volume = parts[0].mesh.volumes
    tops = [largest_gathered(part.unreinforced.strain[None], np.ones(1)) for part in parts]
    for kind in range(6):
        angle = rng.uniform(0.0, np.pi, len(volume)) if kind % 2 else np.zeros(len(volume))
        wanted = rng.random(len(volume)) + 3.0 * (kind > 2) * (tops[0] / tops[0].max())
        low, high = 0.0, 1e3
        for _ in range(60):
            middle = 0.5 * (low + high)
            laid = volume @ np.minimum(most, middle * wanted)
            low, high = (low, middle) if laid > length else (middle, high)
        density = np.minimum(most, low * wanted)
        a = np.stack([np.cos(angle) ** 2, np.sin(angle) ** 2, np.cos(angle) * np.sin(angle)], 1)
        outer = axial * density[:, None, None] * a[:, :, None] * a[:, None, :]

        def fibre(strain, a=a, outer=outer):
            return outer * ((a * strain).sum(axis=1) > 0.0)[:, None, None]

        ratios = [part.ratio(part.solve(fibre, tolerance=1e-7).work) for part in parts]
        for bound in bounds.values():
            assert bound.gap(ratios) > -1e-9
            assert (bound.shares(ratios) <= 1.0).all() or bound.objective == LEAST
    for bound in bounds.values():
        assert bound.least <= bound.reached <= 1.05 * bound.least
        assert bound.least > 1.02 or bound.objective == LEAST  # the cases want different fibre


def test_any_displacements_prove_a_bound(two_bends, rng):
    cases, layers = two_bends
    found = cases_bound(cases, layers, 2500.0, MACHINE, objective=SUM)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    most, axial = fibre_capacity(parts[0], layers, MACHINE), RHO * parts[0].modulus
    factors = cases.weights * found.singles / [part.unreinforced.work for part in parts]
    for size in (0.0, 1e-2):
        moved = []
        for part in parts:
            u, free = part.unreinforced.displacement, part.specimen.held.free
            u = u + size * np.abs(u).max() * np.where(free, rng.standard_normal(u.shape), 0.0)
            moved.append(SmearedSolution(u, part.strain(u), 0.0, 0.0, 0))
        least = cases_certificate(parts, moved, factors, axial, most, 2500.0)
        assert 0.0 < least <= found.reached


def test_margin_covers_what_lies_between_the_angles(rng):
    strains = rng.standard_normal((3, 200, 3))
    factors = np.array([0.2, 1.0, 0.5])
    found = largest_gathered(strains, factors)
    angles = np.linspace(0.0, np.pi, 20001)
    a = np.stack([np.cos(angles) ** 2, np.sin(angles) ** 2, np.cos(angles) * np.sin(angles)])
    exact = np.einsum("i,ica->ca", factors, np.maximum(strains @ a, 0.0) ** 2).max(axis=1)
    assert (found >= exact).all()
    np.testing.assert_allclose(found, exact, rtol=5e-4, atol=1e-3)


def test_cases_may_have_supports_of_their_own(two_bends):
    cases, layers = two_bends
    first, second = cases.fields
    held = replace(
        first.problem,
        supports=(Support("x_max"),),
        loads={"other": (Force("x_min", (-300.0, 40.0, 0.0)),)},
    )
    mixed = WeightedCases((first, solve(held)["other"]), np.array([2.0, 1.0]))
    parts = smeared_cases(mixed.fields, layers[0].plane.frame)
    assert (parts[0].specimen.held.free != parts[1].specimen.held.free).any()
    shared = smeared_cases(cases.fields, layers[0].plane.frame)
    assert shared[0].specimen.solver is shared[1].specimen.solver
    np.testing.assert_allclose(
        shared[1].unreinforced.displacement, second.displacement, rtol=1e-6, atol=1e-9
    )
    found = cases_bound(mixed, layers, 2500.0, MACHINE, iterations=8)
    assert 1.0 < found.least <= found.reached


def test_what_makes_no_sense_is_refused(two_bends):
    cases, layers = two_bends
    fields = {field.case: field for field in cases.fields}
    for weight in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="weight of load case 'tip' must be"):
            WeightedCases.of(fields, {"tip": weight, "slant": 1.0})
    with pytest.raises(InputError, match="no load case named 'tap'"):
        WeightedCases.of(fields, {"tap": 1.0})
    with pytest.raises(InputError, match="2 cases and 1 weights"):
        WeightedCases(cases.fields, np.ones(1))
    with pytest.raises(InputError, match="two load cases are named 'tip'"):
        WeightedCases((cases.fields[0],) * 2, np.ones(2))
    with pytest.raises(InputError, match="worst, sum"):
        cases_bound(cases, layers, 100.0, MACHINE, objective="best")


@pytest.mark.parametrize("objective", [WORST, SUM])
def test_a_support_that_moves_counts_as_a_force_does(pulled_and_moved, objective):
    # As for two forces: the stiffness of the plate does not depend on what pulls it.
    cases, layers = pulled_and_moved
    m = 600.0 / (24.0 * 24.0 * 4.0)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    assert [part.forced for part in parts] == [True, False]
    assert parts[1].unreinforced.work == pytest.approx(3500.0 * 96.0 / 24.0 * 0.01, rel=1e-9)
    found = cases_bound(cases, layers, 600.0, MACHINE, objective=objective)
    np.testing.assert_allclose(found.singles, 1.0 + RHO * m, rtol=1e-3)
    exact = (1.0 + RHO * m) / (1.0 + RHO * m / 2.0)
    assert found.least == pytest.approx(exact, rel=2e-3)
    assert found.least <= found.reached * (1.0 + 1e-9)
    # Whatever the scale of the displacement and the work that is told: it stays a bound.
    scale = found.singles / [part.unreinforced.work for part in parts]
    most = fibre_capacity(parts[0], layers, MACHINE)
    axial = RHO * parts[0].modulus
    for factor in (0.5, 1.0, 3.0):
        told = [parts[0].unreinforced, replace(parts[1].unreinforced, work=factor * 14.0)]
        least = cases_certificate(parts, told, cases.weights * scale, axial, most, 600.0)
        assert least <= exact * (1.0 + 1e-9)


def test_strands_are_cut_alike_for_forces_and_moving_supports(pulled_and_moved, two_pulls):
    # Equal strands along x and along y. Which of them go is a matter of rounding; what is left
    # serves both cases about alike, whatever loads them.
    (moved, layers), (forced, _) = pulled_and_moved, two_pulls
    at = np.arange(1.5, 24.0, 3.0)
    rows = [np.array([[0.5, y], [23.5, y]]) for y in at]
    columns = [np.array([[x, 0.5], [x, 23.5]]) for x in at]
    lines = (rows, columns, rows, columns)
    paths = Toolpaths.concatenate(
        Toolpaths.from_plane(those, layer) for those, layer in zip(lines, layers, strict=True)
    )
    machine, half, bounds = Machine(minimum_length=5.0), np.full(2, 0.5), np.full(2, 2.0)
    worst = []
    for cases in (moved, forced):
        goal = CasesGoal(specimens(cases), half, bounds)
        kept = prune_cases(paths, goal, 480.0, machine)
        assert 470.0 < kept.lengths.sum() <= 480.0 + 1e-6
        worst.append(virtual_tests(kept, cases).ratios.min())
    # All of 736 mm would give each 1.63.
    assert worst[0] == pytest.approx(worst[1], rel=0.05)
    assert min(worst) > 1.0 + 0.8 * 480.0 / 736.0 * 0.63
