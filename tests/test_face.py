"""The public face: what ``import ccfem`` gives, and how values show themselves."""

import dataclasses
import subprocess
import sys

import pytest

import ccfem
from ccfem.base.errors import InputError


@pytest.fixture(scope="module")
def flow():
    case = ccfem.read("bar", element_size=5.0)
    stress = ccfem.solve(case.problem)["pull"]
    layers = ccfem.slice(stress, 2, case.build)
    paths = ccfem.plan(ccfem.strategies.Zigzag(spacing=4.0), layers, stress, case.machine)
    return case, stress, layers, paths


def test_every_name_is_there():
    for name in dir(ccfem):
        assert getattr(ccfem, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'compair'"):
        _ = ccfem.compair


def test_a_module_that_is_not_there_and_one_that_lacks_a_library(monkeypatch):
    with pytest.raises(AttributeError, match=r"'ccfem\.geometry' has no attribute 'ofsets'"):
        _ = ccfem.geometry.ofsets
    monkeypatch.delattr(ccfem.geometry, "offsets", raising=False)
    monkeypatch.delitem(sys.modules, "ccfem.geometry.offsets", raising=False)
    monkeypatch.setitem(sys.modules, "shapely", None)
    with pytest.raises(ModuleNotFoundError, match="shapely"):
        _ = ccfem.geometry.offsets


def test_importing_loads_nothing_heavy():
    """Whoever asks for help or one function does not wait for the rest."""
    said = "import sys, ccfem; print(sorted({'numpy', 'pyvista', 'numba'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_strategies_and_slicers_by_their_class():
    assert ccfem.strategies.StreamFunction(coverage=0.3).coverage == 0.3
    assert ccfem.slicing.slicers.Planar(count=3).count == 3
    with pytest.raises(AttributeError):
        _ = ccfem.strategies.Isokurve


def test_values_show_themselves_in_one_line(flow):
    case, stress, layers, paths = flow
    evaluation = ccfem.evaluate(paths, layers, stress, case.machine)
    test = ccfem.virtual_test(paths, stress)
    values = [
        *(case, case.problem, case.problem.mesh, case.problem.material, stress, layers[0], paths),
        *(evaluation, test, test.strands),
    ]
    for value in values:
        text = repr(value)
        assert type(value).__name__ in text
        assert "\n" not in text
        assert len(text) < 300
    assert "346 nodes, 768 cells" in repr(case.problem.mesh)
    assert f"{paths.lengths.sum():.0f} mm of fibre" in repr(paths)


def test_an_evaluation_is_a_table_in_a_notebook(flow):
    case, stress, layers, paths = flow
    page = ccfem.evaluate(paths, layers, stress, case.machine)._repr_html_()
    assert "<table" in page
    assert "fibre_length" in page


def test_a_case_by_its_name_and_strategies_themselves(flow):
    case = flow[0]
    zigzag = ccfem.strategies.Zigzag
    given = [zigzag(spacing=6.0), "concentric", zigzag(spacing=8.0, angle=30.0)]
    found = ccfem.compare(case, given, layers=1, natural=True, strand=None)
    assert [run.name for run in found.runs] == ["zigzag", "concentric", "zigzag_2"]
    assert found.runs[2].strategy.spacing == 8.0
    named = ccfem.compare(case, {"a": given[0], "b": given[2]}, layers=1, natural=True, strand=None)
    assert [run.length_per_layer for run in named.runs] == [
        found.runs[0].length_per_layer,
        found.runs[2].length_per_layer,
    ]


@pytest.fixture(scope="module")
def compared(flow):
    """Two strategies on two layers."""
    strategies = {name: ccfem.strategies.create(name) for name in ("concentric", "zigzag")}
    return ccfem.compare(flow[0], strategies, layers=2)


def test_a_comparison_prints_as_a_short_table(compared):
    lines = str(compared).splitlines()
    assert lines[0].split("  ")[0] == "strategy"
    for title in ("stiffness ratio", "first failure, N", "fibre, mm a layer"):
        assert title in lines[0]
    assert [line.split()[0] for line in lines[1:3]] == [run.name for run in compared.ranking]
    for line, run in zip(lines[1:3], compared.ranking, strict=True):
        bracket = run.tested.bracket
        low, high = (f"{test.ratio:.2f}" for test in (bracket.tension, bracket.partial))
        assert f" {low} " in line if low == high else f" {low} (to {high}) " in line
        assert f" {run.tested.failure.load:.0f} ({run.tested.failure.what}) " in line
        assert f" {run.length_per_layer:.0f} " in line
        assert len(line) <= len(lines[0])
    assert lines[3:] == [compared.verdict]
    assert all(len(line) < 120 for line in lines[:3])


def test_a_comparison_and_its_runs_are_one_line_each(compared):
    assert repr(compared) == "Comparison of 2 strategies on 'bar': 2 layers, 768 cells"
    for run in compared.runs:
        assert repr(run).startswith(f"Run '{run.name}': {len(run.toolpaths)} paths, ")
        assert f"{run.tested.bracket.tension.ratio:.2f} times as stiff" in repr(run)
    for value in (compared, *compared.runs):
        assert "\n" not in repr(value)


def test_a_failed_strategy_keeps_its_row(compared):
    first, second = compared.runs
    broken = dataclasses.replace(second, evaluation=None, tested=None, failure="no <such> field")
    left = dataclasses.replace(compared, runs=(broken, first))
    assert str(left).splitlines()[2].split("  ")[0] == second.name
    assert str(left).splitlines()[2].endswith("failed: no <such> field")
    assert "failed: no &lt;such&gt; field" in left._repr_html_()
    assert repr(left).endswith("768 cells, 1 failed")
    assert repr(broken) == f"Run '{second.name}': failed: no <such> field"


def test_a_comparison_is_a_table_in_a_notebook(compared):
    page = compared._repr_html_()
    assert page.count("<tr>") == 3
    assert f"<td>{compared.ranking[0].tested.bracket.tension.ratio:.2f}<" in page
    assert compared.verdict in page


def test_wrong_names_are_one_line():
    with pytest.raises(InputError, match=r"no case named 'barr'; .*did you mean 'bar'"):
        ccfem.compare("barr", ["zigzag"])
    with pytest.raises(InputError, match=r"parameters are for cases by name"):
        ccfem.read("hook.toml", element_size=2.0)
    with pytest.raises(InputError, match=r"part file .*hook.toml.* does not exist"):
        ccfem.read("hook.toml")
