import sys
from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware import smeared
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.upper_bound import upper_bound
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.stream_function import StreamFunction

MACHINE = Machine(fibre_width=1.5, minimum_length=20.0)
PLA = isotropic(3500.0, 0.35)


def coverage_of(paths, layers):
    return paths.lengths.sum() * MACHINE.fibre_width / sum(layer.areas.sum() for layer in layers)


@pytest.fixture(scope="module")
def pulled_bar():
    mesh = box_mesh((60.0, 20.0, 4.0), (18, 6, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    problem = Problem(mesh, PLA, supports, {"pull": (Traction("x_max", (5.0, 0.0, 0.0)),)}, order=1)
    return solve(problem, tolerance=1e-10)["pull"], Planar(count=2).cut(mesh)


@pytest.fixture(scope="module")
def bent_beam():
    """A beam that is bent in the plane of its layers."""
    mesh = box_mesh((80.0, 30.0, 4.0), (18, 7, 2))
    loads = {"tip": (Force("x_max", (0.0, -50.0, 0.0)),)}
    problem = Problem(mesh, PLA, (Support("x_min"),), loads, order=1)
    return solve(problem, tolerance=1e-10)["tip"], Planar(count=2).cut(mesh)


@pytest.fixture(scope="module")
def bent_plate():
    """A plate that is bent across its layers: stretched at the top, pressed at the bottom."""
    mesh = box_mesh((60.0, 20.0, 10.0), (18, 6, 4))
    loads = {"tip": (Force("x_max", (0.0, 0.0, -20.0)),)}
    problem = Problem(mesh, PLA, (Support("x_min"),), loads, order=1)
    return solve(problem, tolerance=1e-10)["tip"], Planar(count=4).cut(mesh)


@pytest.fixture
def designs_alone(monkeypatch):
    """Designed plans without the rows, contours and stripes that may be stiffer."""
    monkeypatch.setattr(sys.modules[StreamFunction.__module__], "plain_plans", lambda *_: [])


@pytest.mark.usefixtures("designs_alone")
@pytest.mark.parametrize("factorised", [25_000, 0])
def test_uniform_tension_gets_straight_fibre_and_the_stiffness_of_parallel_bars(
    pulled_bar, factorised, monkeypatch
):
    monkeypatch.setattr(smeared, "DIRECT_UNKNOWNS", factorised)  # others by multigrid
    stress, layers = pulled_bar
    strategy = StreamFunction(coverage=0.4, overfill=1.0, evaluations=10, phases=2, inset=0.0)
    paths = plan(strategy, layers, stress, MACHINE)
    steps = np.concatenate([np.diff(path, axis=0) for path in paths])
    middle = np.concatenate([0.5 * (path[1:, 0] + path[:-1, 0]) for path in paths])
    inner = steps[np.abs(middle - 30.0) < 25.0]  # without the links at the ends
    assert np.abs(inner[:, 0]).sum() > 0.999 * np.linalg.norm(inner, axis=1).sum()
    # Bars in parallel: 1 + rho L / V, which nothing exceeds.
    exact = 1.0 + 4.0 * paths.lengths.sum() / (60.0 * 20.0 * 4.0)
    reached = virtual_test(paths, stress, span=()).ratio
    assert 1.0 + 0.97 * (exact - 1.0) < reached <= exact


@pytest.mark.usefixtures("designs_alone")
def test_little_fibre_beside_much_joins_the_ends_of_a_pulled_bar_too(pulled_bar):
    """Cut from a plan of three times as much, its strands would end where they carry."""
    stress, layers = pulled_bar
    strategy = StreamFunction(evaluations=5, phases=1, overfill=1.0, inset=0.0)
    full = 20.0 * 60.0 / MACHINE.fibre_width
    planned = strategy.to_lengths(stress, layers, MACHINE, (0.2 * full, 0.6 * full))
    for (_, planner), share in zip(planned, (0.2, 0.6), strict=True):
        paths = planner.toolpaths
        laid = paths.lengths.sum()
        assert 0.8 * share < coverage_of(paths, layers) <= share
        exact = 1.0 + 4.0 * laid / (60.0 * 20.0 * 4.0)  # bars in parallel
        assert virtual_test(paths, stress, span=()).ratio > 1.0 + 0.9 * (exact - 1.0)


def test_stiffer_than_isocurves_of_the_same_length(bent_beam):
    stress, layers = bent_beam
    paths = plan(StreamFunction(coverage=0.3, evaluations=10, phases=1), layers, stress, MACHINE)
    length = paths.lengths.sum()
    assert 0.97 * 0.3 < coverage_of(paths, layers) <= 0.3 * (1.0 + 1e-9)
    isocurves = prune(plan(Isocurve(cap=60.0), layers, stress, MACHINE), stress, length, MACHINE)
    ratios = [virtual_test(p, stress, span=()).ratio for p in (isocurves, paths)]
    assert isocurves.lengths.sum() > 0.9 * length
    assert ratios[1] > 1.02 * ratios[0]
    bound = upper_bound(stress, layers, length, MACHINE)
    assert 0.8 < bound.share(ratios[1]) <= 1.0


@pytest.mark.usefixtures("designs_alone")
def test_strands_keep_their_width_and_the_layer(bent_beam):
    stress, layers = bent_beam
    paths = plan(StreamFunction(coverage=0.5, evaluations=8, phases=2), layers, stress, MACHINE)
    total = evaluate(paths, layers, stress, MACHINE).total
    # Nearer are only ends that meet the boundary at a small angle.
    assert total["spacing_5"] > 1.0
    assert total["spacing_below"] < 0.03
    assert total["outside_length"] == 0.0
    assert total["crossings"] + total["self_crossings"] == 0
    assert paths.lengths.min() >= MACHINE.minimum_length * (1.0 - 1e-9)


def test_plain_plans_keep_to_the_layer_and_off_each_other(bent_beam):
    """The best plan here is one of stripes, whose strands may lie closer than a design's."""
    stress, layers = bent_beam
    paths = plan(StreamFunction(coverage=0.5, evaluations=1, phases=1), layers, stress, MACHINE)
    total = evaluate(paths, layers, stress, MACHINE).total
    assert total["on_fibre"] < 0.5 * MACHINE.limits.on_fibre
    assert total["outside_length"] == 0.0
    assert total["crossings"] + total["self_crossings"] == 0
    assert paths.lengths.min() >= MACHINE.minimum_length * (1.0 - 1e-9)


@pytest.mark.usefixtures("designs_alone")
def test_fibre_lies_where_bending_across_the_layers_stretches(bent_plate):
    stress, layers = bent_plate
    strategy = StreamFunction(coverage=0.25, evaluations=10, phases=1)
    paths = plan(strategy, layers, stress, MACHINE)
    upper = paths.lengths[paths.layer >= 2].sum()
    assert upper > 0.9 * paths.lengths.sum()
    one = plan(replace(strategy, groups=1), layers, stress, MACHINE)
    ratios = [virtual_test(p, stress, span=()).ratio for p in (one, paths)]
    assert ratios[1] > 1.02 * ratios[0]


@pytest.mark.usefixtures("designs_alone")
def test_one_layer_by_itself_gets_its_share(pulled_bar):
    stress, layers = pulled_bar
    strategy = StreamFunction(coverage=0.4, evaluations=5, phases=2)
    alone = plan(strategy, layers[1:2], stress, MACHINE)
    assert set(alone.layer) == {1}
    assert 0.95 * 0.4 < coverage_of(alone, layers[1:2]) <= 0.4 * (1.0 + 1e-9)


def test_quadratic_cells_are_planned_too(pulled_bar):
    stress, _ = pulled_bar
    mesh = stress.mesh.quadratic()
    quadratic = solve(replace(stress.problem, mesh=mesh))["pull"]
    layers = Planar(count=2).cut(mesh)
    paths = plan(StreamFunction(coverage=0.4, evaluations=3), layers, quadratic, MACHINE)
    assert 0.35 < coverage_of(paths, layers) <= 0.4 * (1.0 + 1e-9)


def test_load_that_only_presses_is_refused(pulled_bar):
    stress, layers = pulled_bar
    push = {"push": (Traction("x_max", (-5.0, 0.0, 0.0)),)}
    supports = (*stress.problem.supports, Support("y_max", "y"))
    problem = replace(stress.problem, loads=push, supports=supports)
    with pytest.raises(InputError, match="largest tensile stress"):
        plan(StreamFunction(), layers, solve(problem)["push"], MACHINE)


@pytest.mark.parametrize(
    ("name", "value"),
    [("coverage", 0.0), ("coverage", 1.5), ("overfill", 0.9), ("evaluations", 0), ("rho", np.inf)],
)
def test_impossible_parameters_are_refused(name, value):
    with pytest.raises(InputError, match=f"stream_function.{name} must be"):
        StreamFunction(**{name: value})


@pytest.mark.usefixtures("designs_alone")
def test_strands_keep_off_the_boundary(bent_beam):
    stress, layers = bent_beam
    for inset in (0.45, 1.0):
        strategy = StreamFunction(evaluations=3, phases=2, inset=inset, link_limit=0.0)
        paths = plan(strategy, layers, stress, MACHINE)
        across = np.array([80.0, 30.0])
        edge = np.minimum(paths.points[:, :2], across - paths.points[:, :2]).min()
        assert inset - 1e-9 <= edge < inset + 0.5
