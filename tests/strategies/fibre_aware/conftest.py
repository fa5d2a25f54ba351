"""Small parts for the fibre-aware planning."""

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.slicing.slicers.planar import Planar


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


@pytest.fixture(scope="session")
def two_pulls():
    """A square plate, 24 x 24 x 4 mm, without Poisson effect, pulled along x or along y."""
    mesh = box_mesh((24.0, 24.0, 4.0), (8, 8, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    loads = {
        "along_x": (Traction("x_max", (5.0, 0.0, 0.0)),),
        "along_y": (Traction("y_max", (0.0, 2.0, 0.0)),),
    }
    problem = Problem(mesh, isotropic(3500.0, 0.0), supports, loads, order=1)
    return WeightedCases.of(solve(problem, tolerance=1e-10)), Planar(count=4).cut(mesh)


@pytest.fixture(scope="session")
def two_bends():
    """A beam, 60 x 24 x 4 mm, clamped at one end, its tip pushed sideways or pulled at a slant."""
    mesh = box_mesh((60.0, 24.0, 4.0), (15, 6, 2))
    loads = {"tip": (Force("x_max", (0, 50, 0)),), "slant": (Force("x_max", (300, -40, 0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads, order=1)
    fields = solve(problem, tolerance=1e-10)
    return WeightedCases.of(fields, {"tip": 2.0, "slant": 1.0}), Planar(count=2).cut(mesh)


@pytest.fixture(scope="session")
def pulled_and_moved():
    """The plate of `two_pulls`; along y it is stretched by moving a support, not by a force."""
    mesh = box_mesh((24.0, 24.0, 4.0), (8, 8, 2))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
    problem = Problem(
        mesh,
        isotropic(3500.0, 0.0),
        supports,
        {"along_x": (Traction("x_max", (5.0, 0.0, 0.0)),), "along_y": ()},
        order=1,
        case_supports={"along_y": (Support("y_max", "y", (0.0, 0.1, 0.0)),)},
    )
    return WeightedCases.of(solve(problem, tolerance=1e-10)), Planar(count=4).cut(mesh)
