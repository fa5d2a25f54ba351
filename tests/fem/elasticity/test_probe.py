"""What a solution says at points, along lines and on patches, against exact solutions."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import EdgeSupport, Force, PointSupport, Pressure, Problem, Support, solve
from ccfem.fem.materials import isotropic

YOUNG, NU = 100.0, 0.3
SIDES = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))


def pulled(order):
    mesh = box_mesh((8.0, 3.0, 2.0), (6, 3, 2))
    loads = {"pull": (Force("x_max", (12.0, 0.0, 0.0)),)}
    return solve(Problem(mesh, isotropic(YOUNG, NU), SIDES, loads, order=order))["pull"]


@pytest.mark.parametrize("order", [1, 2])
def test_tension_is_found_everywhere(order):
    # Stress 12 N / 6 mm^2 along x; strain s / E and -nu s / E; displacement linear.
    field = pulled(order)
    points = np.random.default_rng(2).uniform((0, 0, 0), (8, 3, 2), (50, 3))
    strain = 2.0 / YOUNG * np.diag([1.0, -NU, -NU])
    for found in (
        field.probe(points),
        field.along((0.1, 1.0, 1.0), (7.9, 2.0, 0.3)),
        field.on("y_max"),
    ):
        shape = (len(found.points), 3, 3)
        np.testing.assert_allclose(found.displacement, found.points @ strain, atol=1e-9)
        np.testing.assert_allclose(found.strain, np.broadcast_to(strain, shape), atol=1e-10)
        stress = np.broadcast_to(np.diag([2.0, 0.0, 0.0]), shape)
        np.testing.assert_allclose(found.stress, stress, atol=1e-8)
    line = field.along((0.0, 1.0, 1.0), (3.0, 1.0, 1.0), 4)
    np.testing.assert_allclose(line.distance, [0.0, 1.0, 2.0, 3.0])
    assert (field.on("y_max").points[:, 1] == 3.0).all()
    np.testing.assert_allclose(
        field.strain, np.broadcast_to(strain, field.strain.shape), atol=1e-10
    )


def test_quadratic_displacement_is_found_between_the_nodes():
    # Pure bending as prescribed: u = (x z, 0, -x^2 / 2) times a curvature, given at the nodes.
    field = pulled(2)
    x, y, z = field.mesh.points.T
    u = np.stack([x * z, 0.0 * y, -0.5 * x**2], axis=1)
    object.__setattr__(field, "displacement", u)
    points = np.random.default_rng(3).uniform((0, 0, 0), (8, 3, 2), (50, 3))
    x, y, z = points.T
    exact = np.stack([x * z, 0.0 * y, -0.5 * x**2], axis=1)
    np.testing.assert_allclose(field.probe(points).displacement, exact, atol=1e-10)
    np.testing.assert_allclose(field.probe(points).strain[:, 0, 0], z, atol=1e-10)


def test_forces_of_supports_balance_the_load_and_share_what_they_share():
    # A pressure of 1 MPa on top of a box on its bottom: the bottom takes 24 N, and the side and the
    # end, which slide, take nothing; shared nodes count once.
    mesh = box_mesh((8.0, 3.0, 2.0), (6, 3, 2))
    loads = {"press": (Pressure("z_max", 1.0),)}
    field = solve(Problem(mesh, isotropic(YOUNG, NU), SIDES, loads, order=1))["press"]
    forces = field.support_forces
    assert set(forces) == {"x_min", "y_min", "z_min"}
    np.testing.assert_allclose(forces["z_min"], [0.0, 0.0, 24.0], atol=1e-8)
    np.testing.assert_allclose(forces["x_min"], 0.0, atol=1e-8)
    twice = (*SIDES, Support("z_min", "z"))
    again = solve(Problem(mesh, isotropic(YOUNG, NU), twice, loads, order=1))["press"]
    np.testing.assert_allclose(again.support_forces["z_min"], [0.0, 0.0, 24.0], atol=1e-8)


def test_forces_of_edges_and_points_have_their_names():
    mesh = box_mesh((8.0, 3.0, 2.0), (6, 3, 2))
    # Held at the lower edges of both ends, as a beam on two supports: half of the load each.
    supports = (
        EdgeSupport(("x_min", "z_min"), "xz"),
        EdgeSupport(("x_max", "z_min"), "z"),
        PointSupport((0.0, 0.0, 0.0), "y"),
    )
    loads = {"press": (Pressure("z_max", 1.0),)}
    field = solve(Problem(mesh, isotropic(YOUNG, NU), supports, loads, order=2))["press"]
    forces = field.support_forces
    np.testing.assert_allclose(forces["edge of x_min and z_min"][2], 12.0, atol=1e-6)
    np.testing.assert_allclose(forces["edge of x_max and z_min"], [0.0, 0.0, 12.0], atol=1e-6)
    np.testing.assert_allclose(forces["point (0, 0, 0)"], 0.0, atol=1e-6)
    np.testing.assert_allclose(sum(forces.values()), field.reactions.sum(axis=0), atol=1e-9)


def test_points_outside_and_wrong_shapes_are_refused():
    field = pulled(1)
    with pytest.raises(InputError, match="1 of 2 points lie outside"):
        field.probe([[1.0, 1.0, 1.0], [9.0, 1.0, 1.0]])
    with pytest.raises(InputError, match=r"of shape \(k, 3\)"):
        field.probe([1.0, 1.0, 1.0])
    with pytest.raises(InputError, match="number of points of a line"):
        field.along((0, 0, 0), (1, 1, 1), 1)
    with pytest.raises(InputError, match="no patch named 'top'"):
        field.on("top")
