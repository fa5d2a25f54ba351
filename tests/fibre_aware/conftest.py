"""Small parts for the fibre-aware planning."""

import numpy as np
import pytest

from ccfem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.elasticity.solve import solve
from ccfem.layers.slicing.planar import Planar
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh


@pytest.fixture(scope="session")
def pulled_bar():
    """A bar, 60 x 20 x 4 mm, in uniform tension along x, with 4 layers."""
    mesh = box_mesh((60.0, 20.0, 4.0), (20, 8, 4))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {"pull": (Traction("x_max", (5.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads, order=1)
    return solve(problem, tolerance=1e-10)["pull"], Planar(count=4).cut(mesh)


@pytest.fixture(scope="session")
def bent_beam():
    """A beam, 60 x 24 x 4 mm, clamped at one end and pushed sideways at the other; 4 layers."""
    mesh = box_mesh((60.0, 24.0, 4.0), (24, 10, 2))
    loads = {"tip": (Force("x_max", (0, 50, 0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads, order=1)
    return solve(problem, tolerance=1e-10)["tip"], Planar(count=4).cut(mesh)


@pytest.fixture
def rng():
    return np.random.default_rng(7)
