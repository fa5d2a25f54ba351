"""No strand of a strategy that is not published with folds has any."""

import numpy as np
import pytest

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine import Machine
from ccfem.paths.folds import folds_in
from ccfem.paths.planning import plan_to_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create

MACHINE = Machine()
ROWS = 588.0
"""Six rows of 98 mm, in every layer."""


@pytest.fixture(scope="module")
def cantilever():
    """A bar of 100 x 14 x 6 mm, held at its root, with 20 N down at its tip."""
    mesh = box_mesh((100.0, 14.0, 6.0), (25, 7, 2))
    load = {"tip": (Force("x_max", (0.0, -20.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), load, order=1)
    return solve(problem)["tip"], Planar(count=2).cut(mesh)


@pytest.mark.parametrize("name", ["stream_function", "pruned"])
def test_planners_do_not_lose_to_straight_rows(name, cantilever):
    """Six honest rows, three beside each face, are what a printer would lay."""
    stress, layers = cantilever
    heights = np.array([0.5, 1.5, 2.5, 11.5, 12.5, 13.5])
    rows = Toolpaths.concatenate(
        Toolpaths.from_plane([np.array([(0.0, y), (98.0, y)]) for y in heights], layer)
        for layer in layers
    )
    given = {"evaluations": 5, "phases": 1} if name == "stream_function" else {}
    paths = plan_to_length(create(name, given), layers, stress, MACHINE, ROWS).toolpaths
    assert rows.lengths.sum() == pytest.approx(2 * ROWS)
    assert paths.lengths.sum() <= 2 * ROWS * (1.0 + 1e-9)
    ratios = [virtual_test(x, stress, span=(), machine=MACHINE).ratio for x in (paths, rows)]
    assert ratios[0] >= ratios[1]
    assert not folds_in(paths, MACHINE).counts.any()
