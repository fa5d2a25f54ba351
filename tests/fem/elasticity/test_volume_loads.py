"""Weight, body forces, heat, regions and combinations, each beside its analytic solution."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, Pressure, Problem, Region, Support, solve
from ccfem.fem.elasticity.load_kinds import BodyForce, Displacement, Gravity, Temperature
from ccfem.fem.elasticity.support_kinds import PointSupport
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.materials import isotropic, transversely_isotropic

SYMMETRY = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"))
THREE_POINTS = (
    PointSupport((0.0, 0.0, 0.0)),
    PointSupport((8.0, 0.0, 0.0), "yz"),
    PointSupport((0.0, 3.0, 0.0), "z"),
)
"""Six components that hold a box without any force."""


CLAMPED = (Support("x_min"),)


def bar(order, loads, supports=CLAMPED, material=None, divisions=(6, 3, 2), **more):
    mesh = box_mesh((8.0, 3.0, 2.0), divisions)
    mesh = mesh if order == 1 else mesh.quadratic()
    material = isotropic(100.0, 0.0) if material is None else material
    return Problem(mesh, material, supports, loads, order=order, **more)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(
    "load", [BodyForce((0.02, 0.0, 0.0)), Gravity((2e4, 0.0, 0.0), mass_density=1.0)]
)
def test_a_bar_hangs_by_its_own_weight(order, load):
    # 1 g/cm^3 at 20 km/s^2 is 0.02 N/mm^3; u = w (L x - x^2 / 2) / E, s = w (L - x).
    part = bar(order, {"hang": (load,)})
    field = solve(part)["hang"]
    x = part.mesh.points[:, 0]
    exact = 0.02 * (8.0 * x - 0.5 * x**2) / 100.0
    coarse = 1e-9 if order == 2 else 0.08 * exact.max()
    np.testing.assert_allclose(field.displacement[:, 0], exact, atol=coarse)
    np.testing.assert_allclose(field.reactions.sum(axis=0), [-0.02 * 48.0, 0, 0], atol=1e-9)
    moment = np.cross(part.mesh.points, prepare(part).forces["hang"]).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross([4.0, 1.5, 1.0], [0.96, 0, 0]), atol=1e-12)
    if order == 2:
        np.testing.assert_allclose(field.nodal[:, 0, 0], 0.02 * (8.0 - x), atol=1e-8)


def test_weight_takes_the_density_of_each_material_and_cell():
    heavy = isotropic(100.0, 0.0, mass_density=4.0)
    part = bar(1, {"hang": (Gravity((0.0, 0.0, -10.0)),)}, material=heavy)
    half = part.mesh.points[part.mesh.corners].mean(axis=1)[:, 0] > 4.0
    light = Region(isotropic(100.0, 0.0, mass_density=1.0), np.flatnonzero(half))
    weight = 48.0 * 1e-9 * 1e4
    for change, share in (
        ({}, 4.0),
        ({"regions": (light,)}, 2.5),
        ({"density": np.where(half, 0.5, 1.0)}, 3.0),
    ):
        reaction = solve(replace(part, **change))["hang"].reactions.sum(axis=0)
        np.testing.assert_allclose(reaction, [0.0, 0.0, share * weight], rtol=1e-6, atol=1e-14)
    with pytest.raises(InputError, match="mass density of material 'isotropic', g/cm\\^3"):
        solve(replace(part, material=isotropic(100.0, 0.0)))


@pytest.mark.parametrize("order", [1, 2])
def test_heat_without_hindrance_makes_no_stress(order):
    part = bar(
        order, {"hot": (Temperature(50.0),)}, THREE_POINTS, isotropic(100.0, 0.3, expansion=1e-4)
    )
    field = solve(part)["hot"]
    np.testing.assert_allclose(field.displacement, 5e-3 * part.mesh.points, atol=1e-12)
    np.testing.assert_allclose(field.stress, 0.0, atol=1e-10)
    np.testing.assert_allclose(field.nodal, 0.0, atol=1e-10)
    assert field.strain_energy == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("order", [1, 2])
def test_heat_between_walls_presses(order):
    # s = - E a T along the bar, its energy E (a T)^2 / 2 a volume.
    material = isotropic(100.0, 0.3, expansion=1e-4)
    walls = (*SYMMETRY, Support("x_max", "x"))
    field = solve(bar(order, {"hot": (Temperature(50.0),)}, walls, material))["hot"]
    exact = np.zeros((3, 3))
    exact[0, 0] = -0.5
    np.testing.assert_allclose(field.stress, np.broadcast_to(exact, field.stress.shape), atol=1e-9)
    assert field.strain_energy == pytest.approx(0.5 * 0.5**2 / 100.0 * 48.0)
    end = np.isclose(field.mesh.points[:, 0], 8.0)
    np.testing.assert_allclose(field.reactions[end].sum(axis=0), [-3.0, 0, 0], atol=1e-9)


def test_fibres_expand_along_their_axes():
    fibre = transversely_isotropic(
        50.0, 8.0, 0.3, 4.0, expansion_fibre=1e-6, expansion_transverse=3e-5
    )
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    part = bar(1, {"hot": (Temperature(-20.0),)}, THREE_POINTS, fibre)
    field = solve(replace(part, axes=np.tile(turn, (len(part.mesh.cells), 1, 1))))["hot"]
    strain = -20.0 * turn @ np.diag([1e-6, 3e-5, 3e-5]) @ turn.T
    u = field.displacement
    slope = np.linalg.lstsq(part.mesh.points, u - u[0], rcond=None)[0]
    np.testing.assert_allclose(0.5 * (slope + slope.T), strain, atol=1e-14)
    np.testing.assert_allclose(field.stress, 0.0, atol=1e-12)


def test_a_bimetal_strip_bends_as_timoshenko_found():
    # J. Opt. Soc. Am. 11 (1925) 233: 1 / r = 6 (a2 - a1) T (1 + m)^2
    # / (h (3 (1 + m)^2 + (1 + m n) (m^2 + 1 / (m n)))), m = t1 / t2, n = E1 / E2.
    length, thickness = 60.0, 2.0
    mesh = box_mesh((length, 1.0, thickness), (60, 1, 4)).quadratic()
    upper = mesh.points[mesh.corners].mean(axis=1)[:, 2] > 0.5 * thickness
    low, high = isotropic(100.0, 0.0, expansion=2e-5), isotropic(40.0, 0.0, expansion=8e-5)
    part = Problem(
        mesh,
        low,
        (Support("x_min", "x"), PointSupport((0, 0, 0)), PointSupport((0, 1, 0), "z")),
        {"hot": (Temperature(100.0),)},
        regions=(Region(high, np.flatnonzero(upper)),),
    )
    field = solve(part)["hot"]
    m, n = 1.0, 100.0 / 40.0
    bent = 6.0 * 6e-5 * 100.0 * (1 + m) ** 2
    bent /= thickness * (3.0 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1.0 / (m * n)))
    end = np.isclose(mesh.points[:, 0], length)
    sag = -field.displacement[end, 2].mean()
    assert sag == pytest.approx(0.5 * bent * length**2, rel=0.005)


def test_heat_needs_an_expansion_and_a_problem_in_space():
    with pytest.raises(InputError, match="needs the expansion of material 'isotropic', 1/K"):
        solve(bar(1, {"hot": (Temperature(50.0),)}))


def test_two_materials_in_a_row_stretch_as_two_springs():
    part = bar(1, {"pull": (Force("x_max", (6.0, 0.0, 0.0)),)}, divisions=(8, 3, 2))
    soft = part.mesh.points[part.mesh.corners].mean(axis=1)[:, 0] > 5.0
    part = replace(part, regions=(Region(isotropic(20.0, 0.0), np.flatnonzero(soft)),))
    field = solve(part)["pull"]
    end = np.isclose(part.mesh.points[:, 0], 8.0)
    np.testing.assert_allclose(field.displacement[end, 0], 5.0 / 100.0 + 3.0 / 20.0, rtol=1e-8)
    np.testing.assert_allclose(field.stress[:, 0, 0], 1.0, rtol=1e-7)


def test_regions_turn_with_the_axes():
    fibre = transversely_isotropic(50.0, 8.0, 0.3, 4.0)
    part = bar(1, {"pull": (Force("x_max", (6.0, 0.0, 0.0)),)}, material=fibre)
    m = len(part.mesh.cells)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    part = replace(part, axes=np.tile(turn, (m, 1, 1)))
    whole = replace(part, material=isotropic(1.0, 0.0), regions=(Region(fibre, np.arange(m)),))
    one, other = (solve(p)["pull"].displacement for p in (part, whole))
    np.testing.assert_allclose(other, one, atol=1e-12)


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([[0]], "must name cells 0 to 215"),
        ([], "must name cells 0 to 215"),
        ([216], "must name cells 0 to 215"),
        ([3, 3], "or twice: give each cell to one region"),
    ],
)
def test_bad_regions_are_refused(cells, message):
    region = Region(isotropic(1.0, 0.0), np.array(cells, dtype=int))
    with pytest.raises(InputError, match=message):
        bar(1, {}, regions=(region,))
    first = Region(isotropic(1.0, 0.0), np.arange(5))
    with pytest.raises(InputError, match="cells that another region has"):
        bar(1, {}, regions=(first, first))


@pytest.mark.parametrize("order", [1, 2])
def test_a_combination_is_the_solve_of_the_combined_loads(order):
    material = isotropic(100.0, 0.3, expansion=1e-4)
    supports = (Support("x_min"), Support("x_max", "x"))
    loads = {
        "press": (Pressure("z_max", 0.2),),
        "hot": (Temperature(10.0),),
        "move": (Displacement("x_max", (0.05, 0.0, 0.0)),),
    }
    factors = {"press": 1.35, "hot": -0.5, "move": 2.0}
    part = bar(order, loads, supports, material, combinations={"all": factors})
    fields = solve(part, tolerance=1e-12)
    assert list(fields) == ["press", "hot", "move", "all"]
    together = (
        Pressure("z_max", 0.27),
        Temperature(-5.0),
        Displacement("x_max", (0.1, 0.0, 0.0)),
    )
    direct = solve(bar(order, {"all": together}, supports, material), tolerance=1e-12)["all"]
    for name in ("displacement", "stress", "nodal", "reactions"):
        one, other = getattr(fields["all"], name), getattr(direct, name)
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())
    assert fields["all"].strain_energy == pytest.approx(direct.strain_energy)


@pytest.mark.parametrize(
    ("sums", "message"),
    [
        ({"both": {"pull": 1.0, "push": 1.0}}, r"name load cases \(pull\)"),
        ({"pull": {"pull": 2.0}}, "must have a name of its own"),
        ({"none": {}}, "must have a name of its own and name load cases"),
        ({"much": {"pull": float("inf")}}, "factors of combination 'much' must be finite"),
    ],
)
def test_bad_combinations_are_refused(sums, message):
    with pytest.raises(InputError, match=message):
        bar(1, {"pull": (Force("x_max", (1.0, 0.0, 0.0)),)}, combinations=sums)


def test_each_load_case_moves_the_support_its_own_way():
    supports = (*SYMMETRY, Support("x_max", "x"))
    loads = {
        "short": (Displacement("x_max", (0.08, 0.0, 0.0)),),
        "long": (Displacement("x_max", (0.16, 0.0, 0.0)),),
        "still": (Pressure("z_max", 0.2),),
    }
    fields = solve(bar(1, loads, supports))
    for name, stress in (("short", 1.0), ("long", 2.0), ("still", 0.0)):
        np.testing.assert_allclose(fields[name].stress[:, 0, 0], stress, atol=1e-8)
    for vector, held in (((0.0, 0.1, 0.0), "x"), ((0.1, 0.0, 0.0), "nothing")):
        patch = "x_max" if held == "x" else "y_max"
        with pytest.raises(InputError, match=f"supports on it hold {held}: hold the components"):
            solve(bar(1, {"move": (Displacement(patch, vector),)}, supports))
