"""What is drawn or written was computed before: pictures and files evaluate nothing."""

import ast
import errno
import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import ccfem
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison import pictures
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.comparison.report import charts, html_report as report
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation import FibreSamples
from ccfem.judging.evaluation.indices.matching import THRESHOLDS
from ccfem.machine import Machine
from ccfem.printing.export import layer_drawings
from ccfem.slicing.slicers import Planar

ROOT = Path(ccfem.__file__).parent
DRAWN = [
    *sorted((ROOT / "comparison" / "plot").glob("*.py")),
    *sorted((ROOT / "comparison" / "report").glob("*.py")),
    *(ROOT / "comparison" / f"{name}.py" for name in ("pictures", "files", "shown")),
]
COMPUTED = ("sample_", "evaluate", "plan_", "matching_rate", "virtual_test", "plane_paths")


@pytest.mark.parametrize("path", DRAWN, ids=lambda path: path.stem)
def test_nothing_that_evaluates_or_plans_is_imported(path):
    imported = {
        name.name
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ccfem")
        for name in node.names
    }
    assert not [name for name in imported if name == "plan" or name.startswith(COMPUTED)]


@pytest.fixture(scope="module")
def case():
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 1))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {"pull": (Force("x_max", (1000.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads)
    machine = Machine(minimum_length=20.0)
    return Case("strip", "Strip", problem, slicing=Planar(count=1), machine=machine)


@pytest.fixture(scope="module")
def result(case):
    return compare(case, ["zigzag"], natural=True, strand=None)


def broken(*arguments, **more):
    raise ZeroDivisionError("a view\nthat fails")


@pytest.mark.parametrize(
    ("module", "name", "said"),
    [
        (report, "part_view", "view of the part"),
        (report, "layer_views", "view of layers and paths"),
        (report, "fronts", "fronts"),
        (report, "headline_table", "report.html"),
        (pictures, "draw_pictures", "pictures"),
        (layer_drawings, "draw_layer", "drawings (svg)"),
    ],
)
def test_a_picture_that_fails_costs_no_numbers(
    result, module, name, said, monkeypatch, tmp_path, recwarn
):
    monkeypatch.setattr(module, name, broken)
    warnings.simplefilter("always")
    write_results(result, tmp_path, pictures=name.startswith("draw_p"), drawings=["svg"])
    line = f"{said} left out: ZeroDivisionError: a view that fails"
    assert [str(each.message) for each in recwarn] == [line]
    about = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert about["left_out"] == [line]
    laid = result.runs[0].evaluation.total["fibre_length"]
    assert about["strategies"][0]["total"]["fibre_length"] == laid
    assert pd.read_csv(tmp_path / "results.csv")["fibre_length"].iloc[-1] == laid
    page = tmp_path / "report.html"
    assert page.exists() == (name != "headline_table")
    assert not page.exists() or f'<p class="warning">{line}.' in page.read_text(encoding="utf-8")


def test_over_slicings_a_picture_that_fails_costs_no_numbers(case, monkeypatch, tmp_path):
    found = compare(case, ["zigzag"], natural=True, strand=None, slicings=["planar:z,count=1"])
    monkeypatch.setattr(pictures, "overview_picture", broken)
    monkeypatch.setattr(report, "layer_views", broken)
    with pytest.warns(UserWarning, match="left out: ZeroDivisionError: a view that fails"):
        write_results(found, tmp_path, pictures=True)
    about = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    whats = ["pictures of planar:z,count=1", "view of layers and paths"]
    assert [line.partition(" left out")[0] for line in about["left_out"]] == whats
    assert {"results.csv", "report.html"} <= {path.name for path in tmp_path.iterdir()}


def test_a_file_that_cannot_be_written_is_no_picture_that_fails(result, monkeypatch, tmp_path):
    def full(*arguments, **more):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(report, "layer_views", full)
    with pytest.raises(OSError, match="No space left"):
        write_results(result, tmp_path)


def test_curves_are_those_of_the_samples(result):
    """Half of the fibre at 20 degrees, half at 70; curvatures of 0.1, 0.2 and 0.4 per mm."""
    (run,) = result.runs
    (own,) = run.evaluation.samples
    ones, angle = np.ones(2), np.radians([20.0, 70.0])
    alignment = replace(
        own.alignment, length=ones, angle=angle, largest=5.0 * ones, smallest=ones, along=ones
    )
    curvature = replace(own.curvature, curvature=np.array([0.4, 0.1, 0.2]))
    evaluation = replace(run.evaluation, samples=(FibreSamples(curvature, alignment),))
    sampled = replace(run, evaluation=evaluation)
    angles, bends = charts.spreads([sampled], {"zigzag": "#000000"}, 0.0)
    expected = np.where(THRESHOLDS >= 70.0, 1.0, np.where(THRESHOLDS >= 20.0, 0.5, 0.0))
    np.testing.assert_allclose(angles["series"][1]["y"], 100.0 * expected)
    np.testing.assert_allclose(np.array(bends["series"][0]["x"])[[0, 50, 100]], [0.1, 0.2, 0.4])
    assert np.array(bends["series"][0]["y"])[[0, 50, 100]].tolist() == [0.0, 50.0, 100.0]
