"""Stiffness and first failure over the length of fibre under several load cases at once."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.front_cases import PointCases
from ccfem.comparison.front_plans import fibre_front
from ccfem.comparison.front_points import FibreFront, FrontPoint
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.elasticity.support_kinds import PressingSupport
from ccfem.fem.materials import printed_pla
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.plan_cases import plan_cases
from ccfem.strategies.fibre_aware.upper_bound import UpperBound, upper_bound
from ccfem.strategies.pruned import Pruned
from ccfem.strategies.stream_function import StreamFunction

STREAM = StreamFunction(evaluations=2, phases=1, inset=0.6)


@pytest.fixture(scope="module")
def part():
    """Beam of 40 x 16 x 4 mm, pulled at its end or pushed sideways."""
    mesh = box_mesh((40.0, 16.0, 4.0), (8, 3, 2))
    loads = {"pull": (Force("x_max", (200.0, 0.0, 0.0)),), "side": (Force("x_max", (0, 40.0, 0)),)}
    material = replace(printed_pla(), tensile_strength=40.0)
    problem = Problem(mesh, material, (Support("x_min"),), loads, order=1)
    machine = Machine(fibre_width=1.5, minimum_length=10.0)
    case = Case("small", "", problem, slicing=Planar(count=2), machine=machine)
    return case, WeightedCases.of(solve(problem), {"pull": 1.0, "side": 2.0})


@pytest.fixture(scope="module")
def front(part):
    return fibre_front(*part, "stream_function", STREAM, (2, 1), points=2)


def test_every_plan_is_tested_in_every_case_by_itself(part, front):
    case, cases = part
    assert len(front.points) >= 4
    for each in front.points:
        alone = [
            virtual_test(each.toolpaths, field, span=(), machine=case.machine).ratio
            for field in cases.fields
        ]
        np.testing.assert_allclose(each.cases.ratios, alone, rtol=1e-5)
        shares = np.array(alone) / each.cases.bound.singles
        assert each.cases.share == pytest.approx(shares.min(), rel=1e-5)
        assert each.ratio == pytest.approx(alone[shares.argmin()], rel=1e-5)
        assert each.bound == each.cases.bound.singles[shares.argmin()]


def test_supports_that_only_press_are_refused_before_anything_is_planned(part, monkeypatch):
    case, cases = part
    supports = (*case.problem.supports, PressingSupport("z_min"))
    case = replace(case, problem=replace(case.problem, supports=supports))
    fields = {field.case: replace(field, problem=case.problem) for field in cases.fields}
    monkeypatch.setitem(fibre_front.__globals__, "answer", lambda *_: pytest.fail("was planned"))
    with pytest.raises(InputError, match="supports that only press have none"):
        fibre_front(case, WeightedCases.of(fields, {"pull": 1.0, "side": 2.0}), "x", STREAM, (4,))


def test_no_plan_exceeds_a_bound(front):
    lengths = np.array([length for length, _ in front.cases_bounds])
    for each in front.points:
        assert each.toolpaths.lengths.sum() == pytest.approx(each.length, rel=1e-9)
        assert (each.cases.ratios > 1.0).all()
        assert (each.cases.ratios <= each.cases.bound.singles).all()
        assert each.cases.share <= 1.0 / each.cases.bound.least
        # The bound is that of no less fibre, and of hardly more.
        own = lengths[[one is each.cases.bound for _, one in front.cases_bounds]]
        assert each.length <= own.max() <= 1.01 * each.length


def test_bounds_are_those_of_several_load_cases(part, front):
    case, cases = part
    layers = case.fibre_layers(cases.heaviest, Planar(count=2))
    length, bound = front.cases_bounds[-1]
    found = upper_bound(cases, layers, length, case.machine)
    assert found.least == bound.least
    np.testing.assert_array_equal(found.singles, bound.singles)
    # More fibre never lowers what is possible in a case.
    singles = np.array([one.singles for _, one in front.cases_bounds])
    assert (np.diff(singles, axis=0) > -0.006 * singles[1:]).all()


def test_a_plan_asked_for_again_is_the_same(part, front):
    case, cases = part
    each = front.points[-2]
    layers = case.fibre_layers(cases.heaviest, Planar(count=each.layers))
    again = plan_cases(STREAM, layers, cases, case.machine, each.asked)
    np.testing.assert_array_equal(again.toolpaths.points, each.toolpaths.points)


def test_fewer_layers_than_cases_are_planned_for_too(front):
    assert {each.layers for each in front.points} == {1, 2}


def test_first_failure_is_of_the_case_that_fails_at_the_least_multiple_of_its_load(front):
    loads = {"pull": 200.0, "side": 40.0}
    for each in front.points:
        first = each.cases.fails_first
        factor = each.cases.factors.min()
        assert each.cases.factors[each.cases.names.index(first)] == factor
        assert each.failure == pytest.approx(factor * loads[first], rel=1e-9)
        assert each.fails_in in ("matrix", "fibre", "interlayer")
    # Without fibre: stress grows as the load, far from the clamp 200 N / 64 mm^2 under the pull.
    assert 1.0 < front.bare < 40.0 / (200.0 / 64.0)


def test_one_case_in_the_list_gives_the_numbers_of_one(part):
    case, cases = part
    field, strategy = cases.fields[0], Pruned(of="zigzag")
    alone = fibre_front(case, field, "pruned", strategy, (2,), points=2)
    listed = fibre_front(
        case, WeightedCases.of({"pull": field}), "pruned", strategy, (2,), points=2
    )
    for one, other in zip(alone.points, listed.points, strict=True):
        np.testing.assert_array_equal(one.toolpaths.points, other.toolpaths.points)
        assert other.ratio == pytest.approx(one.ratio, rel=1e-6)
        assert other.bound == pytest.approx(one.bound, rel=0.01)
    assert alone.stiffest.tolist() == listed.stiffest.tolist()


def point(length, ratios, singles, least=1.1, factors=(2.0, 3.0), why_not=""):
    bound = UpperBound("worst", singles, [0.5, 0.5], least, least, [0.5, 0.5])
    cases = PointCases(("a", "b"), ratios, factors, bound)
    return FrontPoint(
        1, length, length, min(ratios), 9.0, "fibre", 9.0, why_not, Toolpaths.empty(), 0.0, cases
    )


def test_a_plan_is_marked_where_none_with_as_little_fibre_has_a_better_worst_case():
    points = (
        point(100.0, [1.5, 1.4], [2.0, 2.0]),
        # By its own bounds .6 and .7; the plan before has .5 and .7 of these.
        point(200.0, [1.8, 1.4], [3.0, 2.0]),
        # The worst case is no better than it was with less fibre: .45 for both.
        point(300.0, [2.9, 1.35], [3.0, 3.0]),
        point(400.0, [3.0, 3.0], [4.0, 4.0], why_not="turns tighter than it may"),
    )
    front = FibreFront("part", "zigzag", points, {}, 1.0)
    assert front.stiffest.tolist() == [True, True, False, False]
    assert "4 plans, up to 3 times as stiff in every one of 2 load cases" in repr(front)


def test_a_plan_that_serves_its_worst_case_less_than_no_fibre_is_not_marked():
    # Without fibre 1 of 1.3 in the worst case; the plan has .9 of 1.2.
    front = FibreFront("part", "zigzag", (point(100.0, [1.25, 0.9], [1.3, 1.2]),), {}, 3.0)
    assert front.stiffest.tolist() == [False]
    assert front.strongest.tolist() == [False]  # fails at twice the load, without fibre at three


def test_table_and_picture_show_every_case(front, tmp_path):
    front.to_frame().to_csv(tmp_path / "front.csv", index=False)
    with (tmp_path / "front.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row, each in zip(rows, front.points, strict=True):
        for k, name in enumerate(("pull", "side")):
            assert float(row[f"stiffness_ratio_tension[{name}]"]) == each.cases.ratios[k]
            assert float(row[f"bound[{name}]"]) == each.cases.bound.singles[k]
        assert float(row["worst_share_of_bound"]) == each.cases.share
        assert float(row["worst_share_of_bound"]) <= float(row["most_share_of_bound"])
        assert float(row["above_bound"]) >= 0.0
        assert float(row["first_failure_factor"]) == each.cases.factors.min()
        assert row["fails_first"] in ("pull", "side")
    axes = front.plot().axes
    values = [
        [each.cases.share for each in front.points],
        [each.cases.ratios[0] for each in front.points],
        [each.cases.ratios[1] for each in front.points],
        [each.cases.factors.min() for each in front.points],
    ]
    for one, wanted in zip(axes, values, strict=True):
        drawn = [line for line in one.lines if line.get_marker() == "o"]
        assert sorted(float(line.get_ydata()[0]) for line in drawn) == pytest.approx(sorted(wanted))
    # What none exceed in all cases at once lies below what none exceed in one alone.
    for one in axes[1:3]:
        alone, together = (line.get_ydata() for line in one.lines[-2:])
        assert (np.asarray(together) <= np.asarray(alone)).all()


def test_trade_is_that_of_the_worst_case():
    weak = replace(point(500.0, [2.0, 1.5], [4.0, 2.0]), strength=0.0)
    strong = replace(point(500.0, [1.8, 1.5], [4.0, 2.0], factors=(4.0, 3.5)), strength=0.5)
    axes = FibreFront("part", "pruned", (weak, strong), {}).plot_trade().axes[0]
    line = next(line for line in axes.lines if line.get_marker() == "None")
    assert line.get_xydata().tolist() == [[0.5, 2.0], [0.45, 3.5]]
    assert axes.get_ylabel() == "first failure, times the load"
