from dataclasses import replace

import numpy as np
import pytest

from ccfem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.elasticity.solve import solve
from ccfem.fibre_aware.heights import alike_share, fibre_capacity, group_layers, nearest_layer
from ccfem.fibre_aware.smeared import SmearedPart
from ccfem.fibre_aware.spline_grid import SplineGrid
from ccfem.fibre_aware.stream_design import StreamModel, StreamProblem, design
from ccfem.fibre_aware.stream_start import plane_axes, start_fields
from ccfem.layers.slicing.planar import Planar
from ccfem.machine import Machine
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh

MACHINE = Machine()


def problem_of(stress, layers, coverage=0.4, groups=1, size=2.5):
    part = SmearedPart.of(stress, layers[0].plane.frame)
    centres = part.centroids @ part.frame[:2].T
    capacity = fibre_capacity(part, layers, MACHINE)
    model = StreamModel(
        part=part,
        grid=SplineGrid.over(centres, centres.mean(axis=0), np.eye(2), size),
        group=group_layers(layers, groups)[nearest_layer(part, layers)],
        centres=centres,
        capacity=capacity,
        width=MACHINE.fibre_width,
        axial_stiffness=4.0 * part.modulus,
        budget=coverage * float(part.mesh.volumes @ capacity),
    )
    return StreamProblem.alone(model)


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
    smooth = np.linalg.inv(np.eye(len(field)) + 4.0 * problem.laplacian.toarray())
    direction = smooth @ rng.standard_normal(len(field))
    step = 1e-4

    def value(sign):
        return problem.evaluate(field + sign * step * direction, found.solution, 1e-12).value

    difference = (value(1.0) - value(-1.0)) / (2.0 * step)
    assert found.gradient @ direction == pytest.approx(difference, rel=1e-5)


def test_gradient_with_a_moving_support(bent_beam, rng):
    stress, layers = bent_beam
    supports = (*stress.problem.supports, Support("x_max", "y", (0.0, 0.1, 0.0)))
    moved = solve(replace(stress.problem, supports=supports, loads={"move": ()}))["move"]
    problem, field = started(moved, layers)
    found = problem.evaluate(field, tolerance=1e-12)
    smooth = np.linalg.inv(np.eye(len(field)) + 4.0 * problem.laplacian.toarray())
    direction = smooth @ rng.standard_normal(len(field))
    ends = [
        problem.evaluate(field + step * direction, found.solution, 1e-12).value
        for step in (1e-4, -1e-4)
    ]
    assert found.gradient @ direction == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)


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
    assert alike_share(part, stress.stress, 2.0) == pytest.approx(1.0, abs=1e-9)
    bent = np.zeros((len(part.mesh.cells), 3, 3))
    bent[:, 0, 0] = part.centroids[:, 2] - 2.0
    assert alike_share(part, bent, 5.0) < 0.05


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
