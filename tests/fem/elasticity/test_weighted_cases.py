"""Load cases that are planned for together belong to one mesh."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic


def field(name, cells):
    mesh = box_mesh((20.0, 10.0, 4.0), cells)
    loads = {name: (Force("x_max", (10.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), loads, order=1)
    return solve(problem)[name]


def test_cases_on_different_meshes_are_refused():
    pull, same, other = field("pull", (4, 2, 1)), field("side", (4, 2, 1)), field("up", (5, 2, 1))
    together = WeightedCases((pull, same), np.array([3.0, 1.0]))
    assert together.heaviest is pull
    np.testing.assert_allclose(together.weights, [0.75, 0.25])
    with pytest.raises(InputError, match=r"'up' is solved on another mesh than 'pull'"):
        WeightedCases((pull, other), np.array([1.0, 1.0]))
