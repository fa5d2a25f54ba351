"""Levels drawn to stretched borders, against a plate whose strip can be worked out by hand."""

import numpy as np
import pytest

from ccfem.base.errors import SolveError
from ccfem.strategies.fibre_aware.border_levels import BorderLevels
from ccfem.strategies.fibre_aware.field_descent import FieldMetric
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.stream_design import design

from .test_stream_design import problem_of, started


def sloped(model, slope, constant=0.0):
    """Coefficients of the field ``slope . x + constant``: splines hold it by their middles."""
    grid = model.grid
    middles = grid.centre + grid.size * (grid.used + 0.5) @ grid.axes
    return middles @ np.asarray(slope) + constant


def test_cost_of_strands_along_a_pulled_bar(pulled_bar):
    # 60 mm long, four layers: a strand along one side carries EA * eps^2 * length of the work.
    stress, layers = pulled_bar
    model = problem_of(stress, layers).model
    solution = model.part.unreinforced
    levels = BorderLevels.of(model, sloped(model, (0.0, 0.5)), solution)
    strand = 60.0 * len(layers)
    energy = model.axial_stiffness * strand * solution.strain[:, 0].mean() ** 2
    assert levels.weight.sum() == pytest.approx(2 * 0.5 * energy / solution.work, rel=0.02)


def test_strands_that_end_on_the_border_cost_nothing(pulled_bar):
    model = problem_of(*pulled_bar).model
    oblique = np.tan(np.radians(25.0)) * 0.5
    for slope in ((oblique, 0.5), (0.5, 0.5)):
        levels = BorderLevels.of(model, sloped(model, slope), model.part.unreinforced)
        assert levels.weight.sum() < 1e-4


def test_cost_has_the_derivative_of_finite_differences(bent_beam, rng):
    problem, field = started(*bent_beam, groups=2)
    (solution,) = problem.evaluate(field).solution
    levels = BorderLevels.of(problem.model, field, solution)
    assert levels.weight.sum() > 0.0
    assert (levels.weight >= 0.0).all()
    direction = rng.standard_normal(len(field))
    ends = [levels.cost(field + step * direction)[0] for step in (1e-6, -1e-6)]
    slope = levels.cost(field)[1] @ direction
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


def test_lifted_field_has_a_level_where_the_first_strand_is_to_lie(pulled_bar):
    # Of 20 mm of width 18.94 mm lie between the first strands: 19 strands fit on both sides.
    model = problem_of(*pulled_bar).model
    field = sloped(model, (0.0, 18.0 / 18.94), 0.3)
    levels = BorderLevels.of(model, field, model.part.unreinforced)
    before, after = levels.cost(field)[0], levels.cost(levels.lifted(field))[0]
    assert after < 0.05 * levels.weight.sum() < before
    change = levels.lifted(field) - field
    np.testing.assert_allclose(change, change[0], rtol=1e-12)


def test_design_draws_levels_to_the_border(bent_beam):
    problem, field = started(*bent_beam)
    found = design(problem, field, evaluations=40)
    (designed,), (solution,) = found.fields, found.objective.solution
    levels = BorderLevels.of(problem.model, designed, solution)
    shares = [
        levels.cost(designed + constant)[0] / levels.weight.sum()
        for constant in np.linspace(0.0, 1.0, 11)
    ]
    assert shares[0] < 0.5
    assert shares[0] < min(shares[3:8])


def test_metric_has_the_lengths_and_derivatives_of_its_matrix(rng):
    root = rng.standard_normal((12, 12))
    matrix = root @ root.T + np.eye(12)
    metric = FieldMetric.of(matrix)
    field, gradient = rng.standard_normal((2, 12))
    unknowns = metric.unknowns(field)
    assert unknowns @ unknowns == pytest.approx(field @ matrix @ field, rel=1e-10)
    np.testing.assert_allclose(metric.field(unknowns), field, rtol=1e-8)
    assert metric.pulled(gradient) @ unknowns == pytest.approx(gradient @ field, rel=1e-8)


def test_matrix_that_is_not_positive_definite_is_refused():
    with pytest.raises(SolveError, match="not positive definite"):
        FieldMetric.of(np.diag([1.0, -1.0, 2.0]))


def test_grid_covers_points_that_it_has_all_splines_of(rng):
    axes = np.array([[0.6, 0.8], [-0.8, 0.6]])
    made = rng.uniform(0.0, 20.0, (30, 2))
    grid = SplineGrid.over(made, np.zeros(2), axes, 2.0)
    points = rng.uniform(-10.0, 30.0, (400, 2))
    covered = grid.covers(points)
    assert covered.any()
    assert not covered.all()
    assert grid.covers(made).all()
    used = {tuple(pair) for pair in grid.used.tolist()}
    for (i, j), inside in zip(np.floor(points @ axes.T / 2.0).tolist(), covered, strict=True):
        near = {(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)}
        assert inside == (near <= used)
