"""Temperature fields, and loads and supports at nodes, against what is known of them."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.base.formula import formula_values
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import (
    Centrifugal,
    EdgeSupport,
    NodeForces,
    NodeSupport,
    PointSupport,
    Problem,
    Support,
    Temperature,
    solve,
)
from ccfem.fem.elasticity.loads import nodal_forces, strain_forces, volume_forces
from ccfem.fem.materials import isotropic

ALPHA, MODULUS = 1.2e-5, 210000.0
STEEL = isotropic(MODULUS, 0.3, expansion=ALPHA, mass_density=7.85)
BOX = box_mesh((20.0, 4.0, 4.0), (10, 2, 2))
STATICALLY = (
    PointSupport((0.0, 0.0, 0.0), "xyz"),
    PointSupport((20.0, 0.0, 0.0), "yz"),
    PointSupport((0.0, 4.0, 0.0), "z"),
)


def heated(change, supports=STATICALLY, material=STEEL, order=2):
    return solve(Problem(BOX, material, supports, {"heat": (change,)}, order=order))["heat"]


def at_points(change):
    """Changes at the nodes of the linear mesh alone; quadratic cells have more."""
    values = tuple(formula_values(change, BOX.points).tolist())
    return Temperature(values, tuple(map(tuple, BOX.points.tolist())))


@pytest.mark.parametrize("load", [Temperature("3*x - 2*y + z"), at_points("3*x - 2*y + z")])
def test_a_linear_field_strains_without_stress(load):
    # A body free to move takes no stress from a temperature that is linear in space, and its axis
    # bends: u_x = a (3 x^2 / 2 - 3 (y^2 + z^2) / 2 - ...) is quadratic, so the cells hold it.
    field = heated(load)
    assert np.abs(field.stress).max() < 1e-9
    assert np.abs(field.nodal).max() < 1e-9
    assert abs(field.strain_energy) < 1e-9
    assert field.record.error == 0.0
    along = field.displacement[np.argmax(BOX.points @ [1.0, -1.0, -1.0]), 0]
    assert along == pytest.approx(ALPHA * 3.0 * 20.0**2 / 2.0, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_held_bar_takes_its_mean_change(order):
    # Both ends held, nu = 0: the force is E A alpha times the mean of T = x^2, 400 / 3, over the
    # bar; each cell takes T as linear, which adds the trapezium's 2^2 / 6 at most.
    ends = (Support("x_min"), Support("x_max", "x"))
    field = heated(Temperature("x**2"), ends, isotropic(MODULUS, 0.0, expansion=ALPHA), order)
    push = field.support_forces["x_min"][0]
    assert push == pytest.approx(MODULUS * 16.0 * ALPHA * 400.0 / 3.0, rel=6e-3)


def test_a_formula_without_places_is_a_uniform_change():
    one, other = heated(Temperature(40.0), order=1), heated(Temperature("8 * 5"), order=1)
    np.testing.assert_allclose(other.displacement, one.displacement, atol=1e-14)


def test_stress_linear_in_cells_is_integrated_over_curved_ones_too():
    # Equilibrium: the forces of any stress have no resultant; of a constant one given at the
    # corners they are those of the constant.
    mesh = BOX.quadratic()
    bent = mesh.points + 0.05 * np.sin(mesh.points[:, [1, 2, 0]])
    curved = type(mesh)(bent, mesh.cells)
    assert len(curved.curved)
    given = np.random.default_rng(1).normal(size=(len(mesh.cells), 6))
    np.testing.assert_allclose(
        strain_forces(curved, np.repeat(given[:, None], 4, axis=1)),
        strain_forces(curved, given),
        atol=1e-12,
    )
    linear = given[:, None] * np.array([1.0, -2.0, 0.5, 3.0])[:, None]
    assert np.abs(strain_forces(curved, linear).sum(axis=0)).max() < 1e-12


@pytest.mark.parametrize("order", [1, 2])
def test_a_turning_bar_is_pulled_by_its_own_mass(order):
    # About its end: rho w^2 L^2 A / 2 there, and u = rho w^2 L^3 / 3 E at the tip (nu = 0).
    spin = Centrifugal(100.0, (0.0, 2.0, 2.0), (0.0, 0.0, 3.0))
    bar = isotropic(MODULUS, 0.0, mass_density=7.85)
    held = (
        Support("x_min", "x"),
        EdgeSupport(("x_min", "y_min"), "y"),
        EdgeSupport(("x_min", "z_min"), "z"),
    )
    field = solve(Problem(BOX, bar, held, {"spin": (spin,)}, order=order))["spin"]
    load = 7.85e-9 * 100.0**2
    assert field.reactions[:, 0].sum() == pytest.approx(-load * 20.0**2 / 2.0 * 16.0, rel=1e-9)
    tip = field.displacement[np.isclose(field.mesh.points[:, 0], 20.0), 0].mean()
    assert tip == pytest.approx(load * 20.0**3 / (3.0 * MODULUS), rel=4e-3)
    given = Centrifugal(100.0, (0.0, 2.0, 2.0), (0.0, 0.0, 3.0), mass_density=7.85)
    np.testing.assert_array_equal(
        volume_forces(field.problem, spin), volume_forces(field.problem, given)
    )


def test_nodes_are_held_and_loaded_by_their_places():
    # A tension bar held and pulled at the nodes of its ends as the patches are.
    ends = [BOX.points[np.unique(BOX.patch(name))] for name in ("x_min", "x_max")]
    start, end = (tuple(map(tuple, points.tolist())) for points in ends)
    pull = NodeForces(end, tuple((160.0 / len(end), 0.0, 0.0) for _ in end))
    held = NodeSupport("foot", start, "xyz", (0.0, 0.0, 0.1))
    problem = Problem(BOX, STEEL, (held,), {"pull": (pull,)}, order=1)
    field = solve(problem)["pull"]
    np.testing.assert_allclose(field.support_forces["foot"], [-160.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(field.on("x_min").displacement, [[0.0, 0.0, 0.1]] * len(start))
    middle = np.flatnonzero(np.abs(BOX.centres[:, 0] - 10.0) < 1.0)
    assert field.stress[middle, 0, 0].mean() == pytest.approx(10.0, rel=0.01)
    assert field.problem.mesh.order == 1


def test_two_nodes_at_one_place_are_named():
    two = type(BOX)(
        np.concatenate([BOX.points, BOX.points + np.array([20.0, 0.0, 0.0])]),
        np.concatenate([BOX.cells, BOX.cells + len(BOX.points)]),
    )
    with pytest.raises(InputError, match="where two nodes lie"):
        nodal_forces(two, NodeForces(((20.0, 0.0, 0.0),), ((1.0, 0.0, 0.0),)))


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')", "x.real", "x if y else z", "[x]", "f(x)", "sqrt(x, y)", "", "x +",
        "1e400", "lambda: x", "x == y", "'a'", "True", "1 << 3", "(" * 400 + "x" + ")" * 400,
        "-" * 990 + "x",
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(InputError, match="a formula has numbers"):
        Temperature(text)


def test_formulas_have_finite_values():
    at = np.array([[4.0, -2.0, 1.0]])
    assert formula_values("max(x, y)**2 / 2 - abs(y) + cos(pi)", at) == pytest.approx(5.0)
    with pytest.raises(InputError, match="no finite value at"):
        formula_values("log(y)", at)
    with pytest.raises(InputError, match="give a point a change"):
        Temperature((1.0, 2.0), ((0.0, 0.0, 0.0),))
