from dataclasses import replace

import numpy as np
import pytest
from slopes import slopes

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.fields.tensile import Tension
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.heights import (
    alike_share,
    fibre_capacity,
    group_layers,
    layer_counts,
    layers_by_case,
    nearest_layer,
)
from ccfem.strategies.fibre_aware.smeared import SmearedPart, smeared_cases
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.stream_design import StreamModel, StreamProblem, design
from ccfem.strategies.fibre_aware.stream_start import mixed_tension, plane_axes, start_fields

MACHINE = Machine()


def problem_of(
    stress, layers, shares=(1.0,), bounds=None, power=1.0, coverage=0.4, groups=1, size=2.5
):
    cases = WeightedCases.of(stress)
    parts = smeared_cases(cases.fields, layers[0].plane.frame)
    centres = parts[0].centroids @ parts[0].frame[:2].T
    capacity = fibre_capacity(parts[0], layers, MACHINE)
    model = StreamModel(
        part=parts[0],
        grid=SplineGrid.over(centres, centres.mean(axis=0), np.eye(2), size),
        group=group_layers(layers, groups)[nearest_layer(parts[0], layers)],
        centres=centres,
        capacity=capacity,
        width=MACHINE.fibre_width,
        axial_stiffness=4.0 * parts[0].modulus,
        budget=coverage * float(parts[0].mesh.volumes @ capacity),
    )
    bounds = np.ones(len(cases)) if bounds is None else bounds
    return StreamProblem(model, parts, cases.weights, bounds, np.array(shares), power)


def of_two(cases, layers, shares, power=1.0):
    """Problem of two cases that are measured by 2 and by 3."""
    return problem_of(cases, layers, shares, np.array([2.0, 3.0]), power, size=3.0)


def started(stress, layers, **options):
    problem = problem_of(stress, layers, **options)
    groups = problem.model.groups
    return problem, start_fields(problem, (stress,), layers[:groups], cap=90.0)


@pytest.mark.parametrize("groups", [1, 2])
@pytest.mark.parametrize("scale", [0.6, 1.6])
@pytest.mark.parametrize("radius", [0.0, 20.0])
def test_gradient_agrees_with_finite_differences(bent_beam, rng, groups, scale, radius):
    # Scale 1.6: over budget and steeper than allowed, so that every penalty takes part.
    problem, field = started(*bent_beam, groups=groups)
    problem = replace(problem, model=replace(problem.model, radius=radius))
    field = scale * field
    found = problem.evaluate(field, tolerance=1e-12)
    slope, difference = slopes(problem, field, found.solution, rng, 1e-4)
    assert slope == pytest.approx(difference, rel=1e-5)


def test_gradient_with_a_moving_support(bent_beam, rng):
    stress, layers = bent_beam
    supports = (*stress.problem.supports, Support("x_max", "y", (0.0, 0.1, 0.0)))
    moved = solve(replace(stress.problem, supports=supports, loads={"move": ()}))["move"]
    problem, field = started(moved, layers)
    found = problem.evaluate(field, tolerance=1e-12)
    slope, difference = slopes(problem, field, found.solution, rng, 1e-4)
    assert slope == pytest.approx(difference, rel=1e-5)


def test_straight_fibre_stiffens_a_pulled_bar_by_its_density(pulled_bar):
    # s = y / 2 lays strands 2 mm apart along x: m = 1 / (2 mm * layer thickness).
    stress, layers = pulled_bar
    problem = problem_of(stress, layers)
    model = problem.model
    half = np.linalg.lstsq(
        model.grid.values(model.centres).toarray(), 0.5 * model.centres[:, 1], rcond=None
    )[0]
    found = problem.evaluate(half, tolerance=1e-9)
    # Rounding off |g| at 0.02 costs 3 parts in 2500 of the density.
    assert found.ratio == pytest.approx(1.0 + 4.0 * 0.5 / layers[0].thickness, rel=2e-3)
    assert found.length == pytest.approx(0.5 * 60.0 * 20.0 * len(layers), rel=0.04)


def test_start_follows_uniform_tension(pulled_bar):
    problem, field = started(*pulled_bar)
    gx, gy = (slope @ field for slope in problem.model.slopes)
    np.testing.assert_allclose(np.abs(gy), 0.4, rtol=0.02)
    assert np.abs(gx).max() < 0.005


def test_design_stiffens_and_keeps_its_bounds(bent_beam):
    problem, field = started(*bent_beam)
    before = problem.evaluate(field)
    found = design(problem, field, evaluations=25)
    assert len(found.ratios) <= 27
    assert found.objective.ratio > before.ratio + 0.02
    assert found.objective.length < 1.03 * problem.model.budget
    (field,) = found.fields
    steep = np.hypot(*(slope @ field for slope in problem.model.slopes))
    assert np.percentile(steep, 98) < 1.02
    assert found.objective.value == pytest.approx(problem.evaluate(field).value, abs=1e-5)


def test_groups_have_their_own_fields(bent_beam):
    model = problem_of(*bent_beam, groups=2).model
    field = np.zeros(2 * len(model.grid))
    field[: len(model.grid)] = model.grid.used[:, 0]
    gx, gy = (slope @ field for slope in model.slopes)
    lower = model.part.centroids[:, 2] < 2.0
    np.testing.assert_allclose(gx[lower], 1.0 / 2.5, rtol=1e-12)
    assert not gx[~lower].any()
    assert not gy[~lower].any()


def test_heights_of_layers(pulled_bar):
    stress, layers = pulled_bar
    part = SmearedPart.of(stress, layers[0].plane.frame)
    expected = np.floor(part.centroids[:, 2])
    np.testing.assert_array_equal(nearest_layer(part, layers), expected)
    # In another order than by height: positions follow the sequence given.
    turned = layers[::-1]
    np.testing.assert_array_equal(nearest_layer(part, turned), 3 - expected)
    np.testing.assert_array_equal(group_layers(turned, 2), [1, 1, 0, 0])
    np.testing.assert_array_equal(group_layers(layers, 9), [0, 1, 2, 3])


def test_stress_is_alike_at_all_heights_in_the_plane_and_not_in_bending(pulled_bar):
    stress, layers = pulled_bar
    part = SmearedPart.of(stress, layers[0].plane.frame)
    assert alike_share(part.mesh, part.frame, stress.stress, 2.0) == pytest.approx(1.0, abs=1e-9)
    bent = np.zeros((len(part.mesh.cells), 3, 3))
    bent[:, 0, 0] = part.centroids[:, 2] - 2.0
    assert alike_share(part.mesh, part.frame, bent, 5.0) < 0.05


def test_axes_turn_with_the_part(bent_beam):
    stress, layers = bent_beam
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    part = SmearedPart.of(stress, layers[0].plane.frame)
    energy = np.linalg.norm(stress.stress, axis=(1, 2)) ** 2
    centre, axes = plane_axes(part, [energy])
    points = stress.mesh.points.copy()
    points[:, :2] = points[:, :2] @ turn.T
    mesh = replace(stress.mesh, points=points)
    force = (*(turn @ [0.0, 50.0]), 0.0)
    loads = {"t": (Force("x_max", force),)}
    turned = Problem(mesh, stress.problem.material, (Support("x_min"),), loads, order=1)
    field = solve(turned, tolerance=1e-10)["t"]
    other = SmearedPart.of(field, Planar(count=4).cut(mesh)[0].plane.frame)
    centre_2, axes_2 = plane_axes(other, [np.linalg.norm(field.stress, axis=(1, 2)) ** 2])
    np.testing.assert_allclose(centre_2, turn @ centre, atol=1e-6)
    assert abs(axes_2[0] @ (turn @ axes[0])) == pytest.approx(1.0, abs=1e-9)


def test_no_tension_no_fibre():
    mesh = box_mesh((20.0, 10.0, 2.0), (8, 4, 1))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    push = {"push": (Traction("x_max", (-1.0, 0.0, 0.0)),)}
    stress = solve(Problem(mesh, isotropic(3500.0, 0.0), supports, push))["push"]
    layers = Planar(count=1).cut(mesh)
    problem, field = started(stress, layers)
    assert not field.any()
    assert problem.evaluate(field).ratio == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("scale", "power"), [(0.7, 1.0), (1.6, 1.0), (0.7, 4.0)])
def test_gradient_of_two_cases_agrees_with_finite_differences(two_bends, rng, scale, power):
    # Scale 1.6: over budget and steeper than allowed, so that every penalty takes part.
    cases, layers = two_bends
    problem = of_two(cases, layers, [0.25, 0.75], power=power)
    field = scale * start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    found = problem.evaluate(field, tolerance=1e-12)
    slope, difference = slopes(problem, field, found.solution, rng, 1e-4)
    assert slope == pytest.approx(difference, rel=1e-5)


def test_fields_of_their_own_case_stiffen_a_plate_by_their_share(two_pulls):
    # Strands 2 mm apart along x in one half of the layers and along y in the other, no Poisson
    # effect: each case gains rho / (2 * 2 mm * thickness).
    cases, layers = two_pulls
    problem = of_two(cases, layers, [0.5, 0.5])
    values = problem.model.grid.values(problem.model.centres).toarray()
    centres = problem.model.centres
    fields = [np.linalg.lstsq(values, 0.5 * centres[:, k], rcond=None)[0] for k in (1, 0)]
    found = problem.evaluate(np.concatenate(fields), tolerance=1e-9)
    exact = 1.0 + 4.0 * 0.5 * 0.5 / layers[0].thickness
    np.testing.assert_allclose(found.ratio, exact, rtol=2e-3)
    assert found.length == pytest.approx(0.5 * 24.0 * 24.0 * len(layers), rel=0.04)


def test_design_helps_both_cases(two_bends):
    cases, layers = two_bends
    problem = of_two(cases, layers, [0.5, 0.5])
    start = start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    before = problem.evaluate(start)
    found = design(problem, start, evaluations=12)
    assert found.objective.value < before.value - 0.01
    assert (found.objective.ratio > 1.1).all()
    assert found.fields.shape == (2, len(problem.model.grid))


def test_large_power_takes_the_worst_case(two_bends):
    cases, layers = two_bends
    problem = of_two(cases, layers, [0.5, 0.5], power=400.0)
    field = 0.5 * start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    found = problem.evaluate(field)
    penalties = sum(
        0.5 * sum(problem.model.penalties(one, problem.model.smeared(one)))
        for one in field.reshape(2, -1)
    )
    worst = np.log((problem.bounds / found.ratio).max())
    assert found.value - penalties == pytest.approx(worst, abs=0.01)


def test_curvature_is_positive_definite_and_knows_each_field_alone(two_bends):
    cases, layers = two_bends
    problem = of_two(cases, layers, [0.25, 0.75], power=4.0)
    field = 0.5 * start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    solutions = problem.evaluate(field).solution
    matrix = problem.curvature(field, solutions).toarray()
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12 * matrix.max())
    assert np.linalg.eigvalsh(matrix).min() > 0.0
    count = len(problem.model.grid)
    assert not matrix[:count, count:].any()


def test_curvature_of_one_case_in_all_layers_is_that_of_its_problem(two_bends):
    cases, layers = two_bends
    problem = of_two(cases, layers, [1.0, 1.0])
    field = start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    (one, _), half = problem.evaluate(field).solution, len(field) // 2
    found = problem.curvature(field, (one, one)).toarray()[:half, :half]
    alone = problem.model.curvature(field[:half], one).toarray()
    np.testing.assert_allclose(found, alone, rtol=1e-12, atol=1e-12 * alone.max())


def test_levels_of_all_fields_cost_what_each_does_by_its_share(two_bends, rng):
    cases, layers = two_bends
    problem = of_two(cases, layers, [0.25, 0.75])
    field = start_fields(problem, cases.fields, layers[:1], 90.0, 0.75)
    (one, _), half = problem.evaluate(field).solution, len(field) // 2
    levels = problem.levels(field, (one, one))
    each = [problem.model.levels(part, one).cost(part)[0] for part in (field[:half], field[half:])]
    cost, slope = levels.cost(field)
    assert cost == pytest.approx(0.25 * each[0] + 0.75 * each[1], rel=1e-10)
    direction = rng.standard_normal(len(field))
    ends = [levels.cost(field + step * direction)[0] for step in (1e-6, -1e-6)]
    assert slope @ direction == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)
    lifted = levels.lifted(field)
    assert levels.cost(lifted)[0] <= cost
    change = (lifted - field).reshape(2, -1)
    np.testing.assert_allclose(change, change[:, :1] * np.ones_like(change), atol=1e-12)


def test_mixed_tension_of_two_cases_at_right_angles():
    # 3 along x and 1 along y: along x with 3; equal ones at 45 degrees to each other: between them.
    x = Tension(np.array([[1.0, 0.0]] * 2), np.array([3.0, 1.0]), np.array([True, True]))
    y = Tension(np.array([[0.0, 1.0], [0.0, 1.0]]), np.array([1.0, 1.0]), np.array([True, False]))
    slant = Tension(np.sqrt(0.5) * np.ones((2, 2)), np.ones(2), np.ones(2, dtype=bool))
    found = mixed_tension([x, y], np.array([1.0, 1.0]))
    np.testing.assert_allclose(np.abs(found.direction[:, 0]), 1.0)
    np.testing.assert_allclose(found.stress, [3.0, 1.0])
    between = mixed_tension([x, slant], np.array([0.5, 0.5])).direction[1]
    assert np.degrees(np.arctan2(between[1], between[0])) % 180.0 == pytest.approx(22.5)


@pytest.mark.parametrize(
    ("weights", "count", "expected"),
    [
        ([1.0, 1.0], 8, [4, 4]),
        ([1.0, 1.0, 1.0], 8, [3, 3, 2]),
        ([1.0, 0.5], 12, [8, 4]),
        ([5.0, 3.0, 1.0], 10, [6, 3, 1]),
        ([1.0, 1.0], 1, [1, 0]),
    ],
)
def test_layers_by_largest_remainder(weights, count, expected):
    np.testing.assert_array_equal(layer_counts(np.array(weights), count), expected)


def test_layers_take_turns_over_the_height():
    layers = Planar(count=12).cut(box_mesh((8.0, 8.0, 12.0), (2, 2, 2)))
    assert "".join("ab"[k] for k in layers_by_case(np.array([1.0, 1.0]), layers)) == "ab" * 6
    assert "".join("ab"[k] for k in layers_by_case(np.array([2.0, 1.0]), layers)) == "aba" * 4
    turned = layers_by_case(np.array([1.0, 1.0]), layers[::-1])
    assert "".join("ab"[k] for k in turned) == "ba" * 6
