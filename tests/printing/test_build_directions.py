"""How much of the tension flat layers hold, and which build direction is proposed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.printing.build_directions import AXES, BuildDirection, better_direction, tension_share
from ccfem.printing.support.overhang import overhang

BOX = box_mesh((60.0, 20.0, 40.0), (3, 2, 2))
UP = AXES["z"]


def uniform(stress, mesh=BOX):
    return SimpleNamespace(mesh=mesh, stress=np.tile(np.asarray(stress), (len(mesh.cells), 1, 1)))


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0, 90.0])
def test_layers_hold_a_pull_by_the_square_of_the_sine(angle):
    """The projection of s e e^T has the eigenvalue s sin^2 of the angle to the normal."""
    along = np.array([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))])
    share = tension_share(uniform(3.0 * np.outer(along, along)), UP)
    assert share == pytest.approx(np.sin(np.radians(angle)) ** 2, abs=1e-12)


def test_what_is_pressed_has_no_tension():
    assert tension_share(uniform(-np.eye(3)), UP) == 0.0
    assert better_direction(uniform(-np.eye(3)), UP, Machine()) == ""


def test_a_part_pulled_upwards_is_laid_down_on_the_side_that_is_lowest():
    pulled = uniform(np.diag([0.0, 0.0, 2.0]))
    said = better_direction(pulled, UP, Machine())
    assert said.startswith(
        "layers along y would let fibre take 100% of the tension (now 0%), 20 mm high in 25 "
        "layers (now 40 mm in 50), with nothing in air without support (now nothing in air): "
    )
    assert said.endswith('build = "y", or --turn x=90')
    assert better_direction(pulled, AXES["y"], Machine()) == ""
    assert better_direction(uniform(np.diag([2.0, 2.0, 1.0])), UP, Machine()) == ""
    # A bed on which it cannot lie leaves it as it is.
    bed = replace(Machine().gcode, bed=(50.0, 30.0, 100.0))
    assert better_direction(pulled, UP, replace(Machine(), gcode=bed)) == ""


def test_the_side_on_which_less_hangs_over_is_proposed():
    """A stem below a plate, along y: with the plate down nothing hangs over."""
    box = box_mesh((40.0, 30.0, 40.0), (8, 6, 8))
    at = box.points[box.corners].mean(axis=1)
    kept = (at[:, 1] > 20.0) | (np.abs(at[:, [0, 2]] - 20.0).max(axis=1) < 5.0)
    tee = TetMesh(box.points, box.cells[kept])
    pulled = uniform(np.diag([0.0, 0.0, 1.0]) + np.diag([0.3, 0.0, 0.0]), tee)
    said = better_direction(pulled, UP, Machine())
    assert 'build = "-y"' in said
    assert overhang(tee, AXES["y"], Machine()).share == pytest.approx(
        BuildDirection.of(pulled, AXES["y"], Machine()).in_air
    )


def test_an_upright_bracket_in_layers_along_z_is_turned():
    """An L whose arm bends: its tension runs up, across the layers."""
    box = box_mesh((40.0, 12.0, 60.0), (10, 3, 15))
    at = box.points[box.corners].mean(axis=1)
    kept = (at[:, 2] < 8.0) | (at[:, 0] < 8.0)
    bracket = box.__class__(box.points, box.cells[kept])
    top = [f for f in bracket.boundary if (bracket.points[f][:, 2] > 59.9).all()]
    foot = [f for f in bracket.boundary if (bracket.points[f][:, 2] < 0.1).all()]
    mesh = TetMesh(bracket.points, bracket.cells, {"top": np.array(top), "foot": np.array(foot)})
    loads = {"push": (Force("top", (50.0, 0.0, 0.0)),)}
    stress = solve(Problem(mesh, isotropic(3500.0, 0.35), (Support("foot"),), loads))["push"]
    now, lying = tension_share(stress, UP), tension_share(stress, AXES["y"])
    assert now < 0.4
    assert lying > 0.85
    assert 'build = "y", or --turn x=90' in better_direction(stress, UP, Machine())
