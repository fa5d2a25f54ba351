"""The study of Chen et al. 2021, reduced: coarse meshes, one layer."""

import tomllib

import numpy as np
import pytest

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.papers.chen_2021.contents import EXPECTED, quantities, write
from ccfem.papers.chen_2021.study import run_study, turned_by, turns_at
from ccfem.slicing.layers.layer import stress_on
from ccfem.strategies.isocurve import Isocurve


@pytest.fixture(scope="module")
def study():
    return run_study(element_size=8.0, layers=1, step=4.0)


def test_the_stages_are_the_algorithm_as_printed(study):
    """Run stage by stage from vectors of random sign, the paths are those of `Isocurve.literal`."""
    loop = study.loop
    planner = Isocurve.literal().for_part(loop.stress, loop.layers, loop.case.machine)
    for stages in loop.stages:
        on_layer = stress_on(stages.layer, loop.stress)
        paths = planner(stages.layer, on_layer, loop.case.machine)
        assert sorted(stages.paths.lengths) == pytest.approx(sorted(paths.lengths), rel=1e-6)


def test_processing_and_power_do_what_they_are_for(study):
    found = quantities(study)
    assert found["within 10 degrees with processing, %"] > (
        2.0 * found["within 10 degrees without processing, %"]
    )
    fibre = [found[f"fibre, m, p = {power:g}"] for power in study.powers]
    assert fibre == sorted(fibre, reverse=True)


def test_every_quantity_of_the_claims_is_computed(study, tmp_path):
    claims = write(study, tmp_path)
    with EXPECTED.open("rb") as file:
        named = {c["quantity"] for claim in tomllib.load(file)["claim"] for c in claim["checks"]}
    missing = named - set(quantities(study))
    left_out = ("authors' paths", "lifting_eye", "layers unlike")
    assert all(any(what in name for what in left_out) for name in missing)
    assert claims.count("| not tried |") == len(missing)
    for k in (4, 5, 6, 7, 8, 9, 10, 14):
        (picture,) = tmp_path.glob(f"figure_{k:02}_*.png")
        assert picture.stat().st_size > 10_000
    assert "| here: Loop |" in (tmp_path / "report.md").read_text()


def test_a_pulled_bar_turns_nowhere_and_a_bent_one_does():
    """Under a pull along its axis a bar keeps its principal directions, however far it is pulled.

    Its tip moved across, a slender beam turns by more than the slope of its chord at the far end.
    """
    mesh = box_mesh((40.0, 4.0, 4.0), (20, 2, 2))
    held = (Support("x_min"),)
    named = mesh.with_patches({"support": mesh.patches["x_min"], "load": mesh.patches["x_max"]})
    loads = {"pull": (Force("load", (1.0, 0.0, 0.0)),)}
    problem = Problem(named, isotropic(3500.0, 0.0), held, loads, order=1)
    pulled = turns_at(problem, np.array([1.0, 0.0, 0.0]), (8.0,), step=2.0)[8.0]
    assert pulled.in_space.max() < 1e-6
    bent = turns_at(problem, np.array([0.0, 0.0, 1.0]), (8.0,), step=2.0)[8.0]
    assert np.percentile(bent.in_space, 90) > np.degrees(np.arctan(8.0 / 40.0))


def test_turning_with_the_material_is_no_turn():
    axis = np.radians(30.0)
    turn = np.array([[np.cos(axis), -np.sin(axis), 0], [np.sin(axis), np.cos(axis), 0], [0, 0, 1]])
    first = np.diag([5.0, 1.0, 0.0])
    last = turn @ first @ turn.T
    assert turned_by(first[None], last[None], turn[None]) == pytest.approx(0.0, abs=1e-5)
    assert turned_by(first[None], last[None], np.eye(3)[None]) == pytest.approx(30.0)
