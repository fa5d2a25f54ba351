"""What is drawn or written was computed before: pictures and files evaluate nothing."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ccfem
from ccfem.cases.case import Case
from ccfem.comparison import pictures
from ccfem.comparison.engine import compare
from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.evaluation import FibreSamples
from ccfem.evaluation.matching import THRESHOLDS
from ccfem.layers.slicing import Planar
from ccfem.machine import Machine
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh

ROOT = Path(ccfem.__file__).parent
DRAWN = [
    *sorted((ROOT / "plot").glob("*.py")),
    *(
        ROOT / "comparison" / f"{name}.py"
        for name in ("pictures", "report", "record", "files", "charts", "shown")
    ),
    *(ROOT / "comparison" / f"{name}_view.py" for name in ("layer", "part", "path")),
]
COMPUTED = ("sample_", "evaluate", "plan_", "plan", "matching_rate", "virtual_test", "plane_paths")


@pytest.mark.parametrize("path", DRAWN, ids=lambda path: path.stem)
def test_nothing_that_evaluates_or_plans_is_imported(path):
    imported = {
        name.name
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ccfem")
        for name in node.names
    }
    assert not [name for name in imported if name.startswith(COMPUTED)]


def test_curves_are_those_of_the_samples(monkeypatch):
    """Half of the fibre at 20 degrees, half at 70; curvatures of 0.1, 0.2 and 0.4 per mm."""
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 1))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {"pull": (Force("x_max", (1000.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads)
    machine = Machine(minimum_length=20.0)
    case = Case("strip", "Strip", problem, slicing=Planar(count=1), machine=machine)
    result = compare(case, ["zigzag"], natural=True, strand=None)
    (run,) = result.runs
    (own,) = run.evaluation.samples
    ones, angle = np.ones(2), np.radians([20.0, 70.0])
    alignment = replace(
        own.alignment, length=ones, angle=angle, largest=5.0 * ones, smallest=ones, along=ones
    )
    curvature = replace(own.curvature, curvature=np.array([0.4, 0.1, 0.2]))
    evaluation = replace(run.evaluation, samples=(FibreSamples(curvature, alignment),))
    drawn = {}
    for name in ("matching_curves", "curvature_curves"):
        real = getattr(pictures, name)

        def spy(*arguments, real=real, name=name):
            drawn[name] = arguments[0]
            return real(*arguments)

        monkeypatch.setattr(pictures, name, spy)
    pictures.draw_pictures(replace(result, runs=(replace(run, evaluation=evaluation),)))
    expected = np.where(THRESHOLDS >= 70.0, 1.0, np.where(THRESHOLDS >= 20.0, 0.5, 0.0))
    np.testing.assert_allclose(drawn["matching_curves"]["zigzag"], expected)
    np.testing.assert_array_equal(np.sort(drawn["curvature_curves"]["zigzag"]), [0.1, 0.2, 0.4])
