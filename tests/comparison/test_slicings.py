"""Comparison over several slicings: equal fibre in all, one order, one table."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.cli.screen import print_comparison
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.comparison.ranking import best_values, off_length
from ccfem.comparison.request import InAll
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.slicing.slicers import Planar, Spatial, as_slicer, from_text, split

PULL = 400.0


@pytest.fixture(scope="module")
def case():
    """A strip 60 x 24 x 12 mm, pulled along x: no two axes give it the same layers."""
    mesh = box_mesh((60.0, 24.0, 12.0), (10, 4, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {"pull": (Force("x_max", (PULL, 0.0, 0.0)),)}
    pla = isotropic(3500.0, 0.35, tensile_strength=50.0, interlayer_tensile=18.0)
    problem = Problem(mesh, pla, supports, loads)
    slicing = Planar(count=4)
    return Case("strip", "Strip", problem, slicing=slicing, machine=Machine(minimum_length=10.0))


@pytest.fixture(scope="module")
def compared(case):
    slicings = {
        "z": Planar(count=4),
        "y": Planar(count=3, axis="y"),
        "x": Planar(count=3, axis="x"),
    }
    return compare(case, ["zigzag", "concentric"], slicings=slicings)


def test_every_run_lays_the_same_length_in_all(compared):
    (setter,) = (run for run in compared.runs if "compared at this length" in run.note)
    assert compared.fibre == pytest.approx(setter.toolpaths.lengths.sum(), rel=1e-9)
    assert [len(each.layers) for each in compared.slicings.values()] == [4, 3, 3]
    assert len(compared.runs) == 6
    for run in compared.runs:
        assert not run.failure
        laid = run.toolpaths.lengths.sum()
        assert run.length == pytest.approx(laid, rel=1e-6)
        assert off_length(run, InAll(compared.fibre)) == (abs(laid / compared.fibre - 1.0) > 0.01)


def test_layers_across_the_pull_are_weak_and_make_no_stiff_part(compared):
    """The pull is uniform: 400 N on 288 mm^2, to which layers along it are blind."""
    table = compared.frame.set_index(["slicing", "strategy"])
    for strategy in ("zigzag", "concentric"):
        across = table.loc[("x", strategy)]
        # The matrix between layers carries the whole pull: it parts at 18 MPa.
        assert across["interlayer_load"] == pytest.approx(18.0 * 288.0, rel=0.05)
        assert across["across_tension"] == pytest.approx(1.0, abs=1e-6)
        assert across["stiffness_ratio_tension"] < 1.01
        for slicing in ("y", "z"):
            along = table.loc[(slicing, strategy)]
            assert along["interlayer_load"] > 3.0 * across["interlayer_load"]
            assert along["across_tension"] < 1e-6
            # Turns of the two patterns fold, and carry nothing: 1.02 along the pull.
            assert along["stiffness_ratio_tension"] > across["stiffness_ratio_tension"] + 0.015


def test_order_over_slicings_obeys_the_laws_of_rank(compared):
    """Printable first, then those of the wanted length, then the stiffer."""
    runs = compared.ranking
    assert sorted(run.name for run in runs) == sorted(run.name for run in compared.runs)
    rank = [
        (
            not run.printable,
            off_length(run, compared.wanted),
            -run.tested.bracket.tension.ratio,
        )
        for run in runs
    ]
    assert rank == sorted(rank)
    assert list(compared.frame["rank"]) == list(range(1, 7))
    best = best_values(runs, compared.wanted)
    for name, value in best.items():
        held = [run for run in runs if run.printable and not off_length(run, compared.wanted)]
        owner = compared.frame.set_index(["slicing", "strategy"])[name]
        names = {tuple(reversed(run.name.split(" on "))) for run in held}
        assert value in {owner.loc[each] for each in names}


def test_verdict_speaks_of_strategy_and_slicing(compared):
    said, first = compared.verdict, compared.ranking[0]
    assert f"with {compared.fibre / 1e3:.2f} m of fibre in all" in said
    assert first.name in said
    assert re.fullmatch(r"(zigzag|concentric) on [xyz]", first.name)
    if " makes the stiffest part" in said:
        assert said.startswith(first.name)
    assert first.name in str(compared)
    assert "layers: z 4 (4 with fibre), y 3 (3 with fibre), x 3" in " ".join(compared.remarks)


def test_a_run_that_cannot_be_printed_stands_below_all_that_can(compared):
    best = compared.ranking[0].name
    runs = [replace(run, why_not="too sharp") if run.name == best else run for run in compared.runs]
    worse = replace(compared, runs=tuple(runs))
    broken = [run.name for run in worse.ranking if not run.printable]
    assert best in broken
    assert [run.name for run in worse.ranking][-len(broken) :] == broken
    assert best in worse.verdict.partition("Not printable as planned: ")[2]


def test_fronts_and_views_name_strategy_and_slicing(compared, tmp_path):
    (axes,) = compared.pareto().axes
    table = compared.frame
    points = sorted(axes.collections[0].get_offsets().tolist())
    expected = table[["first_failure_load", "stiffness"]].dropna().values.tolist()
    np.testing.assert_allclose(points, sorted(expected))
    compared.show("zigzag on y", tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 5000
    with pytest.raises(InputError, match="no run with paths named 'zigzag'"):
        compared.show("zigzag")


def test_files_hold_every_run_and_one_report(compared, tmp_path):
    few = [run for run in compared.runs if run.name in ("zigzag on z", "zigzag on x")]
    stacks = {name: compared.stacks[name] for name in ("z", "x")}
    compared = replace(compared, runs=tuple(few), stacks=stacks)
    write_results(compared, tmp_path, "ccfem compare strip", pictures=True)
    table = pd.read_csv(tmp_path / "results.csv")
    total = table[table["layer"] == "total"]
    assert list(zip(total["slicing"], total["strategy"], strict=True)) == [
        ("z", "zigzag"),
        ("x", "zigzag"),
    ]
    said = total[["printable", "why_not"]].fillna("").to_records(index=False).tolist()
    assert said == [(run.printable, run.why_not) for run in few]
    record = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert record["fibre"] == compared.fibre
    assert record["verdict"] == compared.verdict
    assert {name: each["layers"] for name, each in record["slicings"].items()} == {"z": 4, "x": 3}
    assert sorted(record["files"]) == sorted(path.name for path in tmp_path.iterdir())
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    for run in compared.runs:
        assert f'data-value="{run.name}">' in report
    for word in (compared.verdict, "joints linked", "delamination load, N", "first failure, N"):
        assert word in report
    for name in compared.slicings:
        assert (tmp_path / f"{name}_zigzag_space.html").exists()
        assert (tmp_path / f"{name}_overview.png").stat().st_size > 1000


@pytest.mark.parametrize("count", [0, 1, 2])
def test_the_short_table_says_where_the_rest_is(compared, monkeypatch, capsys, count):
    lines = [f"remark {k}" for k in range(3 + count)]
    monkeypatch.setattr(type(compared), "notes", lines)
    print_comparison(compared, Path("somewhere"), 1.0)
    more = {0: "", 1: "1 more remark, ", 2: "2 more remarks, "}[count]
    assert f"--details or the report: {more}every index" in capsys.readouterr().out.splitlines()


@pytest.mark.parametrize("width", ["200", "90"])
def test_screen_shows_every_run_its_figures_and_the_verdict(
    compared, width, capsys, monkeypatch, tmp_path
):
    """On a narrow screen columns are left to the report, and no number is cut in two."""
    monkeypatch.setenv("COLUMNS", width)
    monkeypatch.chdir(tmp_path)
    Path("somewhere").mkdir()
    Path("somewhere/report.html").touch()
    print_comparison(compared, Path("somewhere"), 1.0, details=True)
    said = capsys.readouterr().out
    for run in compared.runs:
        assert run.name in said
        assert width == "90" or f"{run.tested.bracket.tension.ratio:.2f}" in said
    flat = " ".join(said.split())
    assert compared.verdict in flat
    assert "somewhere/report.html" in flat
    assert ("in the report: " in said) == (width == "90")
    assert "…" not in said
    print_comparison(compared, Path("somewhere"), 1.0)
    short = capsys.readouterr().out
    assert len(short.splitlines()) < len(said.splitlines())
    assert compared.verdict in " ".join(short.split())


def test_flat_layers_named_alone_are_as_thick_as_the_parts_own(case):
    """Those of the part are 12 / 4 = 3 mm: 24 mm take 8, 60 mm take 20."""
    slicings = ["planar:y", "planar:x", "planar:z,count=2", "planar:z,thickness=99"]
    found = compare(case, ["zigzag"], slicings=slicings, strand=None, fibre=900.0)
    assert {name: len(each.layers) for name, each in found.slicings.items()} == {
        "planar:y": 8,
        "planar:x": 20,
        "planar:z,count=2": 2,
    }
    assert list(found.refused) == ["planar:z,thickness=99"]
    assert any("planar:z,thickness=99: cannot cut the part" in line for line in found.remarks)
    for run in found.runs:
        if not off_length(run, InAll(900.0)):
            assert run.toolpaths.lengths.sum() == pytest.approx(900.0, rel=0.011)


def test_short_forms_of_slicings():
    assert from_text("planar:z") == Planar(axis="z") == from_text("planar:axis=z")
    assert from_text("planar: x , thickness=0.5") == Planar(axis="x", thickness=0.5)
    assert as_slicer("spatial:count=20") == Spatial(count=20)
    assert split("planar:z, planar:x,thickness=0.5,spatial,count=9,planar") == (
        "planar:z",
        "planar:x,thickness=0.5",
        "spatial:count=9",
        "planar",
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"slicings": ["planar:w"]}, "axis"),
        ({"slicings": ["spatial:z"]}, r"expects NAME=VALUE; got 'z'"),
        ({"slicings": ["planet"]}, r"planar"),
        ({"slicings": []}, r"at least one"),
        ({"slicings": "planar"}, r"must be a list"),
        ({"slicings": ["planar:z", "planar:z"]}, r"'planar:z' more than once"),
        ({"slicings": ["planar"], "layers": 3}, r"no layers"),
        ({"slicings": ["planar"], "fibre_per_layer": 3.0}, r"give fibre"),
        ({"slicings": ["planar"], "print_plans": True}, r"one slicing"),
        ({"fibre": 100.0, "fibre_per_layer": 3.0}, r"not both"),
        ({"fibre": 100.0, "natural": True}, r"natural amount"),
        ({"slicings": ["planar"], "fibre": -1.0}, r"-1"),
        ({"slicings": ["planar:z,thickness=99"]}, r"no slicing could cut 'strip': planar:z"),
    ],
)
def test_wrong_slicings_are_refused_in_one_line(case, given, said):
    with pytest.raises(InputError, match=said) as error:
        compare(case, ["zigzag"], strand=None, **given)
    assert "\n" not in str(error.value)
