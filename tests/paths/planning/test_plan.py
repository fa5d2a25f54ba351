"""Planning: of curved layers, and of stress that ccfem did not solve."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, GivenStress, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create, named

MESH = box_mesh((60.0, 24.0, 3.0), (15, 6, 1))


@pytest.fixture(scope="module")
def field():
    pull = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),)}
    return solve(Problem(MESH, isotropic(3500.0, 0.3), (Support("x_min"),), pull))["pull"]


FLAT_ONLY = [name for name in sorted(named()) if getattr(named()[name], "flat_layers_only", False)]
IN_PLANE = [name for name in sorted(named()) if getattr(named()[name], "in_plane", False)]


def test_strategies_work_in_a_plane_but_for_winding_and_those_of_a_whole_part():
    assert FLAT_ONLY == ["svt"]
    whole_part = {"pruned", "stream_function"}
    assert set(named()) == {*FLAT_ONLY, *IN_PLANE, *whole_part, "winding"}


def bent(layer, radius):
    """A flat layer at a height of 0 rolled up about y, and its triangles where they come to lie."""
    x, y, z = layer.points.T
    angle = (x - 30.0) / radius
    points = np.column_stack([radius * np.sin(angle), y, radius * np.cos(angle) + z])
    return replace(layer, points=points, flat=None)


@pytest.mark.parametrize("name", IN_PLANE)
def test_a_rolled_layer_gets_the_fibre_of_the_flat_one_rolled_up(field, name):
    """A cylinder rolls off without distortion; the stress rolls with it."""
    radius = 40.0
    # Not whole numbers of strands long and wide: rounding shall not decide on how many there are.
    mesh = replace(MESH, points=MESH.points * [59.4 / 60.0, 23.3 / 24.0, 1.0])
    flat = Planar(count=1).cut(mesh)[0]
    roll = (mesh.points[:, 0] - 30.0) / radius
    stress = GivenStress(
        mesh,
        rolled(field.stress, roll[mesh.cells].mean(axis=1)),
        rolled(field.nodal, roll),
        ("x_max", "x_min"),
    )
    machine = Machine()
    given = GivenStress(mesh, field.stress, field.nodal, ("x_max", "x_min"))
    expected = plan(create(name), [flat], given, machine)
    found = plan(create(name), [bent(flat, radius)], stress, machine)
    assert len(expected) > 0
    assert found.lengths.sum() == pytest.approx(expected.lengths.sum(), rel=0.002)
    x, y, _ = expected.points.T
    angle = (x - 30.0) / radius
    height = flat.plane.height
    wanted = np.column_stack([radius * np.sin(angle), y, radius * np.cos(angle) + height])
    away, _ = cKDTree(found.points).query(wanted)
    # Points are half a millimetre apart; chords of the triangles lie 0.05 mm inside the cylinder.
    assert away.max() < 0.6
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0)


def rolled(stress, angle):
    """Tensors turned about y with the layer."""
    c, s, o = np.cos(angle), np.sin(angle), np.zeros_like(angle)
    turn = np.stack([c, o, s, o, o + 1.0, o, -s, o, c], axis=-1).reshape(-1, 3, 3)
    return turn @ stress @ np.swapaxes(turn, 1, 2)


@pytest.mark.parametrize("name", FLAT_ONLY)
def test_a_curved_layer_is_refused_in_one_line(field, name):
    curved = replace(Planar(count=1).cut(MESH)[0], flat=None)
    with pytest.raises(InputError, match=r"flat layers only; 1 of 1 layers are curved") as caught:
        plan(create(name), [curved], field, Machine())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["isocurve", "mps", "streamline", "concentric"])
def test_given_stress_is_planned_like_solved_stress(field, name):
    """What planning sees is the mesh, the tensors and the names of patches, and no more."""
    given = GivenStress(MESH, field.stress, field.nodal, ("x_max", "x_min"))
    layers, machine = Planar(count=2).cut(MESH), Machine()
    found, expected = (plan(create(name), layers, s, machine) for s in (given, field))
    assert len(found) > 0
    np.testing.assert_array_equal(found.points, expected.points)
    np.testing.assert_array_equal(found.offsets, expected.offsets)


@pytest.mark.parametrize("name", ["pruned", "stream_function"])
def test_strategies_that_solve_again_say_what_they_need(field, name):
    given = GivenStress(MESH, field.stress, field.nodal)
    with pytest.raises(InputError, match=f"{name} solves the part again and needs its problem"):
        plan(create(name), Planar(count=1).cut(MESH), given, Machine())


def test_given_stress_must_fit_its_mesh(field):
    with pytest.raises(InputError, match=r"stress must have shape \(\d+, 3, 3\), one tensor for"):
        GivenStress(MESH, field.stress[:-1], field.nodal)
    with pytest.raises(InputError, match=r"nodal must have shape .* use tensor.from_voigt"):
        GivenStress(MESH, field.stress, np.zeros((len(MESH.points), 6)))
