"""The contour_zigzag baseline beside the zigzag-contour paths published with Chen et al. 2021."""

import os
from pathlib import Path

import numpy as np
import pytest

from ccfem.body.files import read_mesh
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.printing.export.waypoints import read_waypoints
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

FOLDER = "CCFEM_CHEN2021"
MACHINE = Machine()

pytestmark = pytest.mark.skipif(FOLDER not in os.environ, reason="the authors' data is not here")


@pytest.fixture(scope="module")
def loop():
    """Stress, four layers, and the published paths on them."""
    folder = Path(os.environ[FOLDER]) / "Loop"
    mesh = patches_from_rules(
        read_mesh(folder / "Loop.tet"),
        {
            "support": Cylinder((-0.2, 5, -50), "y", radius=5.0, tolerance=0.45, half="-z"),
            "load": Cylinder((-0.2, 5, 50), "y", radius=5.0, tolerance=0.45, half="z"),
        },
    )
    force = Force("load", (0.0, 0.0, 1000.0))
    problem = Problem(
        mesh, isotropic(3500.0, 0.35), (Support("support"),), {"pull": (force,)}, order=1
    )
    layers = Planar(heights=0.25 + 0.5 * np.arange(4)).cut(mesh, (0, 1, 0))
    paths = read_waypoints(folder / "GcodeGenerater_Zigzag_Contour_raw.txt", layers[0].plane.frame)
    return solve(problem)["pull"], layers, paths.select(paths.layer < 4)


def test_contour_zigzag_is_like_the_published_paths(loop):
    """The same kind of paths at the same length of fibre, only without their crossings."""
    stress, layers, published = loop
    theirs = evaluate(published, layers, stress, MACHINE).total
    # Paper 000, table 2: 35,895 mm on 12 layers.
    assert theirs["fibre_length"] == pytest.approx(35895.0 / 3.0, rel=0.02)
    paths = plan(create("contour_zigzag", {"spacing": 3.25}), layers, stress, MACHINE)
    ours = evaluate(paths, layers, stress, MACHINE).total
    assert ours["fibre_length"] == pytest.approx(theirs["fibre_length"], rel=0.05)
    assert ours["paths"] <= theirs["paths"]
    assert ours["angle_mean"] == pytest.approx(theirs["angle_mean"], abs=2.0)
    assert ours["efficiency"] == pytest.approx(theirs["efficiency"], abs=0.03)
    assert ours["coverage"] == pytest.approx(theirs["coverage"], abs=0.03)
    assert ours["crossings"] == 0
    assert ours["self_crossings"] == 0
    assert ours["spacing_below"] < 0.25 * theirs["spacing_below"]


@pytest.mark.parametrize("name", ["concentric", "zigzag", "contour_zigzag"])
def test_full_fill_keeps_strands_apart(loop, name):
    stress, layers, _ = loop
    total = evaluate(plan(create(name), layers[:2], stress, MACHINE), layers[:2], stress, MACHINE)
    assert total.total["spacing_below"] < 0.01
    assert total.total["spacing_1"] > 0.98
    assert total.total["outside_length"] == 0.0


def test_published_strands_are_as_short_as_the_way_from_the_cutter():
    """What `held_length` of 0 rests on: nothing has to lie when the shortest strands are cut."""
    files = [*Path(os.environ[FOLDER]).glob("*/GcodeGenerater_*_raw.txt")]
    assert len(files) == 6
    size = np.concatenate([read_waypoints(file, np.eye(3)).lengths for file in files])
    assert len(size) == 1047
    assert size.min() == pytest.approx(MACHINE.tail + MACHINE.held_length, abs=0.5)
