"""Planning: of curved layers, and of stress that ccfem did not solve."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.elasticity import Force, GivenStress, Problem, Support, solve
from ccfem.errors import InputError
from ccfem.layers.slicing import Planar
from ccfem.machine import Machine
from ccfem.materials import isotropic
from ccfem.mesh import box_mesh
from ccfem.planning import plan
from ccfem.strategies import create, named

MESH = box_mesh((60.0, 24.0, 3.0), (15, 6, 1))


@pytest.fixture(scope="module")
def field():
    pull = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),)}
    return solve(Problem(MESH, isotropic(3500.0, 0.3), (Support("x_min"),), pull))["pull"]


@pytest.mark.parametrize("name", sorted(named()))
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
