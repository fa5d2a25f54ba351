import json

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.cases.load_cases import weighted_cases
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import printed_pla
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine import Machine
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.stream_function import StreamFunction
from ccfem.strategies.zigzag import Zigzag


def case_of(loads=None, **options):
    mesh = box_mesh((60.0, 24.0, 4.0), (15, 6, 2))
    given = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),), "side": (Force("x_max", (0, 40.0, 0)),)}
    problem = Problem(mesh, printed_pla(), (Support("x_min"),), loads or given, order=1)
    machine = Machine(minimum_length=15.0)
    return Case("small", "Small", problem, slicing=Planar(count=2), machine=machine, **options)


@pytest.fixture(scope="module")
def compared():
    case = case_of(weights={"pull": 1.0, "side": 0.5})
    strategies = {"stream": StreamFunction(evaluations=3, phases=1, inset=0.6), "zigzag": Zigzag()}
    return compare(case, strategies, fibre_per_layer=400.0, load_case="all")


def test_every_run_is_tested_under_every_case(compared):
    assert compared.cases.names == ("pull", "side")
    np.testing.assert_allclose(compared.cases.weights, [2.0 / 3.0, 1.0 / 3.0])
    fields = solve(compared.case.problem)
    for run in compared.runs:
        found = run.tested.cases
        alone = [
            virtual_test(
                cut_strands(
                    run.toolpaths,
                    fields[name].mesh,
                    machine=compared.case.machine,
                    layers=compared.layers,
                    crosses=False,
                ),
                fields[name],
                span=(),
            ).ratio
            for name in ("pull", "side")
        ]
        np.testing.assert_allclose(found.tension.ratios, alone, rtol=1e-5)
        bound = compared.bound
        assert (found.shares() < 1.0).all()
        assert bound.gap(found.tension.ratios) > 0.0
        assert found.merit() == pytest.approx((alone / bound.singles).min(), rel=1e-5)
        loads = [
            one.load / test.force
            for one, test in zip(found.failure.each, found.tension.tests, strict=True)
        ]
        assert found.failure.factor == min(loads)


def test_ranked_by_the_worst_case(compared):
    assert [run.name for run in compared.ranking] == ["stream", "zigzag"]
    assert compared.verdict.startswith("stream serves all load cases best: the worst of them")
    said = " ".join(compared.remarks)
    assert "planned for 2 load cases, by weight: pull 0.67, side 0.33" in said
    assert "first table are those of 'pull'" in said
    assert "no paths of this length bring the worst case above" in said


def test_results_hold_every_case(compared, tmp_path):
    write_results(compared, tmp_path)
    found = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert found["load_cases"]["bound"]["least"] == compared.bound.least
    run = compared.runs[0]
    values = found["strategies"][0]["load_cases"]
    assert values["stiffness_ratio_tension[side]"] == pytest.approx(
        run.tested.cases.tension.ratios[1], rel=1e-12
    )
    head = (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "stiffness_ratio_tension[side]" in head
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    share = run.tested.cases.shares()[1]
    assert f"{run.tested.cases.tension.ratios[1]:.2f} ({share:.0%})" in page


def test_without_weights_all_but_combinations_count_alike():
    case = case_of()
    found = weighted_cases(case, solve(case.problem))
    assert found.names == ("pull", "side")
    np.testing.assert_array_equal(found.weights, [0.5, 0.5])


def test_what_makes_no_sense_is_refused():
    one = case_of({"pull": (Force("x_max", (300.0, 0.0, 0.0)),)})
    with pytest.raises(InputError, match=r"of 'small' were asked for and it has one \(pull\)"):
        compare(one, ["zigzag"], load_case="all")
    single = case_of(weights={"side": 1.0})
    with pytest.raises(InputError, match=r"and weights name one \(side\)"):
        compare(single, ["zigzag"], load_case="all")
    for weight in (-1.0, 0.0, np.nan):
        with pytest.raises(InputError, match="weight of load case 'side' must be"):
            case_of(weights={"side": weight})
    with pytest.raises(InputError, match="no load case named 'up'"):
        case_of(weights={"up": 1.0})
    refused = {
        "a curve": {"curve": True},
        "several slicings": {"slicings": ["planar:z"]},
    }
    for what, options in refused.items():
        with pytest.raises(InputError, match=f"planned for at once; got {what} too"):
            compare(case_of(), ["zigzag"], load_case="all", **options)
    with pytest.raises(InputError, match="are cut and ranked by virtual tests: leave these in"):
        compare(case_of(), ["zigzag"], load_case="all", strand=None)
