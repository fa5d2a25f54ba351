"""Stiffness and first failure over the length of fibre."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison import engine
from ccfem.comparison.engine import Solved
from ccfem.comparison.front_plans import fibre_front, front_of
from ccfem.comparison.front_points import FibreFront, FrontPoint
from ccfem.comparison.plan_to_stiffness import counts_to_try
from ccfem.comparison.request import Request
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import evaluated
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.strand import RHO
from ccfem.machine import Machine
from ccfem.paths.placement.fibre_places import FibrePlaces
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

ALONG = {"angle": 0.0, "turn": 0.0}


@pytest.fixture(scope="module")
def bar():
    """Bar of 60 x 8 x 4 mm under a pull along x, with two layers."""
    mesh = box_mesh((60.0, 8.0, 4.0), (12, 4, 4))
    material = replace(isotropic(3500.0, 0.0), tensile_strength=50.0)
    pull = {"pull": (Force("x_max", (1000.0, 0.0, 0.0)),)}
    problem = Problem(mesh, material, (Support("x_min"),), pull, order=1)
    case = Case("bar", "", problem, slicing=Planar(count=2), machine=Machine())
    return case, solve(problem)["pull"]


@pytest.fixture(scope="module")
def front(bar):
    return fibre_front(*bar, "zigzag", create("zigzag", ALONG), (2, 1), points=2)


def test_straight_strands_add_their_section(bar, front):
    """Bar in parallel: EA of the strands that cross every section adds to that of the matrix."""
    best = max(front.points, key=lambda each: each.ratio)
    assert best.layers == 2
    # Strands of length l along x spread over 60 mm: rho E A_strands / (E A) of a mixture, at most.
    mixture = 1.0 + RHO * (best.length / 60.0) / (8.0 * 4.0)
    assert 0.8 * mixture < best.ratio <= mixture * (1.0 + 1e-6)


def test_no_plan_exceeds_the_bound(front):
    assert len(front.points) >= 3
    for each in front.points:
        assert 1.0 < each.ratio <= each.bound
        assert each.toolpaths.lengths.sum() == pytest.approx(each.length, rel=1e-9)


def test_fewer_layers_reach_less(front):
    most = {n: max(p.length for p in front.points if p.layers == n) for n in (1, 2)}
    assert most[2] == pytest.approx(2.0 * most[1], rel=0.02)


def point(layers, asked, length, ratio, failure, why_not=""):
    return FrontPoint(
        layers, asked, length, ratio, failure, "fibre", 9.0, why_not, Toolpaths.empty()
    )


def test_marked_are_those_that_none_with_as_little_fibre_exceeds():
    points = (
        point(1, 500.0, 499.0, 2.0, 90.0),  # as much was asked for as of the next: exceeded
        point(2, 250.0, 500.0, 2.5, 80.0),
        point(2, 400.0, 700.0, 2.4, 95.0),  # lays less than asked; weaker than the one before
        point(2, 450.0, 900.0, 3.5, 99.0, "turns tighter than it may"),
        point(2, 475.0, 950.0, 3.0, np.nan),
    )
    front = FibreFront("bar", "zigzag", points, {})
    assert front.stiffest.tolist() == [False, True, False, False, True]
    assert front.strongest.tolist() == [True, False, True, False, False]


def test_plans_to_one_length_are_compared_as_if_they_laid_it():
    """Both ask for 250 mm on 2 layers, 500 mm; the weaker lays 1 mm less, and is not marked."""
    pair = (point(2, 250.0, 500.0, 2.5, 8000.0), point(2, 250.0, 499.0, 2.4, 7900.0))
    assert [each.asked_in_all for each in pair] == [500.0, 500.0]
    assert FibreFront("bar", "pruned", pair, {}).stiffest.tolist() == [True, False]


def test_plans_that_fail_before_the_part_without_fibre_are_not_marked():
    points = (point(1, 500.0, 500.0, 1.4, 80.0), point(1, 900.0, 900.0, 2.0, 120.0))
    front = FibreFront("bar", "zigzag", points, {}, bare=100.0)
    assert front.strongest.tolist() == [False, True]
    assert front.stiffest.tolist() == [True, True]


def test_a_strand_too_short_on_the_last_layer_alone_is_named(bar):
    case, stress = bar
    basis = Solved(case, WeightedCases.of({"pull": stress}), limits_only=True)
    part = basis.cut()
    lines = [(50.0, 0.0), (20.0, 3.0)]  # 20 mm: less than the 42 mm that the cutter needs
    paths = Toolpaths.concatenate(
        Toolpaths.from_plane([np.array([[5.0, y], [5.0 + length, y]])], layer)
        for layer, (length, y) in zip(part.layers, lines, strict=True)
    )
    run = evaluated(Run("by hand", create("zigzag"), paths, None), part)
    assert "shorter than 42 mm" in run.why_not
    assert run.evaluation.taken_on_some == 1
    assert np.isnan(run.evaluation.of_layer(1)["coverage"])


def test_table_and_picture_show_every_plan(front, tmp_path):
    front.to_frame().to_csv(tmp_path / "front.csv", index=False)
    with (tmp_path / "front.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["stiffness_ratio_tension"]) for row in rows] == pytest.approx(
        [each.ratio for each in front.points]
    )
    share = [float(row["share_of_gain"]) for row in rows]
    assert all(0.0 < each <= 1.0 for each in share)
    axes = front.plot().axes
    drawn = [line for line in axes[0].lines if line.get_marker() == "o"]
    assert sorted(float(line.get_ydata()[0]) for line in drawn) == pytest.approx(
        sorted(each.ratio for each in front.points)
    )


def test_twice_as_many_layers_where_strands_have_room(bar):
    case, stress = bar
    assert counts_to_try(case, stress) == (2, 4)
    sparse = replace(case, fibre=FibrePlaces(every=2, covered=False))
    assert counts_to_try(sparse, stress) == (2, 4)  # layers of matrix count
    thick = Machine(filament_area=1.2)  # 1.2 mm high: no room in layers of 1 mm
    case = Case("bar", "", case.problem, slicing=Planar(count=2), machine=thick)
    assert counts_to_try(case, stress) == (2,)


def test_a_front_is_tested_under_the_supports_of_the_part_alone(bar, monkeypatch):
    case, _ = bar
    other = replace(case, alternative_supports=(Support("x_min"), Support("x_max", "y")))
    asked = []
    module = front_of.__globals__
    monkeypatch.setitem(module, "answer", lambda *given: asked.append(given))
    monkeypatch.setitem(module, "_front", lambda name, found: found)
    front_of(Request(other, {"zigzag": create("zigzag", ALONG)}), (2,))
    ((_, _, basis),) = asked
    assert len(basis.tests.models) == 1


def test_layers_of_matrix_count_but_take_no_fibre(bar):
    """Of 2 layers one has fibre; of 1 none is left, which is said."""
    case, stress = bar
    sparse = replace(case, fibre=FibrePlaces(layers="1:", covered=False))
    front = fibre_front(sparse, stress, "zigzag", create("zigzag", ALONG), (2, 1), points=2)
    assert {each.layers for each in front.points} == {2}
    assert list(front.refused) == [1]
    assert "none is left for fibre" in front.refused[1]
    for each in front.points:
        assert set(each.toolpaths.layer) == {1}
        assert each.length_per_layer == pytest.approx(each.toolpaths.lengths.sum())
        assert each.asked_in_all == each.asked


def test_front_begins_with_the_part_without_fibre_and_bounds_lie_above_all_between(front):
    # Far from its clamp the bar has the stress F / A: it fails at X A.
    assert front.bare == pytest.approx(50.0 * 8.0 * 4.0, rel=0.05)
    lengths, bounds = np.array(front.bounds).T
    for each in front.points:
        assert each.ratio <= np.interp(each.length, lengths, bounds) * (1.0 + 1e-3)
    # The bound is concave in the length, and reaches 1 without fibre.
    slopes = np.diff(np.concatenate([[1.0], bounds])) / np.diff(np.concatenate([[0.0], lengths]))
    assert (np.diff(slopes) < 0.02 * slopes[0]).all()


def test_trade_has_a_curve_for_each_length_with_several_strengths():
    weak = point(2, 250.0, 500.0, 2.5, 8000.0)
    strong = replace(weak, ratio=2.4, failure=9000.0, strength=0.5)
    other = point(2, 450.0, 900.0, 3.5, 9900.0)
    axes = FibreFront("bar", "pruned", (weak, strong, other), {}).plot_trade().axes[0]
    lines = [line for line in axes.lines if line.get_marker() == "None"]
    assert [line.get_xydata().tolist() for line in lines] == [[[2.5, 8.0], [2.4, 9.0]]]
    assert [text.get_text() for text in axes.texts] == ["0", "0.5"]
    with pytest.raises(InputError, match="several strengths"):
        FibreFront("bar", "pruned", (weak, other), {}).plot_trade()


def test_strategies_that_know_no_strength_are_refused(bar):
    with pytest.raises(InputError, match="'zigzag' does not plan for strength"):
        fibre_front(*bar, "zigzag", create("zigzag", ALONG), (2,), strengths=(0.5,))


def test_refused(bar):
    with pytest.raises(InputError, match="points must be at least 2; got 1"):
        fibre_front(*bar, "zigzag", create("zigzag", ALONG), (2,), points=1)
    with pytest.raises(InputError, match="at least one number of layers"):
        fibre_front(*bar, "zigzag", create("zigzag", ALONG), ())
    with pytest.raises(InputError, match="number of layers must be at least 1"):
        fibre_front(*bar, "zigzag", create("zigzag", ALONG), (0,))


def test_a_front_solves_with_one_thread_of_blas(bar, monkeypatch):
    """Their number would change the last digits, by which paths can differ."""
    threads, solved = set(), engine.solve

    def solving(*about, **more):
        blas = (pool for pool in threadpool_info() if pool["user_api"] == "blas")
        threads.update(pool["num_threads"] for pool in blas)
        return solved(*about, **more)

    monkeypatch.setattr(engine, "solve", solving)
    with threadpool_limits(2, user_api="blas"):
        front_of(Request(bar[0], {"zigzag": create("zigzag", ALONG)}), (2,), points=2)
    assert threads == {1}


def test_no_plan_says_why(bar):
    case, stress = bar
    cutter = Case("bar", "", case.problem, machine=Machine(minimum_length=500.0))
    with pytest.raises(InputError, match="zigzag finds no plan of 'bar': 2 layers: laid no fibre"):
        fibre_front(cutter, stress, "zigzag", create("zigzag", ALONG), (2,), points=2)


def test_a_front_of_a_request_with_a_curve_is_the_curve(bar):
    case, _ = bar
    request = Request(case, {"zigzag": create("zigzag", ALONG)}, curve=True)
    assert {point.layers for point in front_of(request, (2,), points=3).points} == {2}
