from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import (
    Bearing,
    Force,
    PointForce,
    Pressure,
    Problem,
    Support,
    Traction,
    solve,
)
from ccfem.fem.materials import isotropic, plane_stress
from ccfem.fem.plates import PlaneMesh, PlaneProblem, raster_mesh, rotate_plane, stack_plane
from ccfem.fem.plates.solve import PlaneElements, prepare, solve_plane

C_FRAM = (73200.0, 4100.0, 0.33, 2200.0)
STEEL = plane_stress(200000.0, 200000.0, 0.3, 200000.0 / 2.6)


def plate(width, height, nx, ny, corners=4, shake=0.0, seed=0):
    """Plate of quadrilaterals or triangles, its inner nodes shaken, pinned at two corners."""
    mesh = raster_mesh(np.ones((ny, nx), dtype=bool))
    rng = np.random.default_rng(seed)
    inner = np.ones(len(mesh.points), dtype=bool)
    inner[mesh.boundary] = False
    points = mesh.points + shake * inner[:, None] * rng.uniform(-1, 1, mesh.points.shape)
    points = points * [width / nx, height / ny]
    cells = mesh.cells
    if corners == 3:
        cells = np.vstack([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    result = PlaneMesh(points, cells, mesh.patches)
    a, b = result.nearest_nodes([[0, 0], [width, 0]])
    return result.with_patches({"pin": [[a]], "roller": [[b]]})


FREE = (Support("pin", "xy"), Support("roller", "y"))
KINDS = pytest.mark.parametrize(("corners", "shake"), [(4, 0.0), (4, 0.3), (3, 0.3)])


def uniform_tension(mesh, stiffness, thickness=1.0, stress=(5.0, -2.0, 1.5)):
    """Plate under tractions of a uniform stress."""
    sx, sy, t = stress
    loads = (
        Traction("x_max", (sx, t, 0.0)),
        Traction("x_min", (-sx, -t, 0.0)),
        Traction("y_max", (t, sy, 0.0)),
        Traction("y_min", (-t, -sy, 0.0)),
    )
    loads = tuple(load for load in loads if any(load.vector))
    return PlaneProblem(mesh, stiffness, thickness, FREE, {"pull": loads})


@KINDS
def test_patch_test(corners, shake):
    mesh = plate(6.0, 4.0, 6, 5, corners, shake)
    stiffness = rotate_plane(plane_stress(*C_FRAM), 0.4)
    field = solve_plane(uniform_tension(mesh, stiffness, 0.7), tolerance=1e-11)["pull"]
    wanted = np.array([5.0, -2.0, 1.5])
    np.testing.assert_allclose(field.stress, np.tile(wanted, (len(mesh.cells), 1)), atol=1e-8)
    strain = np.linalg.solve(stiffness, wanted)
    np.testing.assert_allclose(field.strain, np.tile(strain, (len(mesh.cells), 1)), atol=1e-12)
    assert field.strain_energy == pytest.approx(0.5 * wanted @ strain * 24.0 * 0.7, rel=1e-9)
    np.testing.assert_allclose(field.energy_density, 0.5 * wanted @ strain, rtol=1e-8)


@KINDS
@pytest.mark.parametrize("degrees", [0.0, 10.0, 37.0, 45.0, 90.0])
def test_off_axis_modulus_is_that_of_laminate_theory(corners, shake, degrees):
    e1, e2, nu, g = C_FRAM
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    # Jones, Mechanics of Composite Materials, 1999, eq. 2.97.
    inverse = c**4 / e1 + (1 / g - 2 * nu / e1) * s**2 * c**2 + s**4 / e2
    mesh = plate(8.0, 3.0, 7, 4, corners, shake)
    stiffness = rotate_plane(plane_stress(*C_FRAM), np.full(len(mesh.cells), np.radians(degrees)))
    problem = uniform_tension(mesh, stiffness, stress=(1.0, 0.0, 0.0))
    field = solve_plane(problem, tolerance=1e-12)["pull"]
    np.testing.assert_allclose(field.strain[:, 0] / inverse, 1.0, rtol=1e-10)
    np.testing.assert_allclose(
        field.stress_in(np.radians(degrees)),
        np.tile([c * c, s * s, -c * s], (len(mesh.cells), 1)),
        atol=1e-9,
    )


def test_cross_ply_is_the_mean_of_its_layers():
    q = plane_stress(*C_FRAM)
    layers = np.stack([rotate_plane(q, np.pi / 4), rotate_plane(q, -np.pi / 4)])
    mesh = plate(5.0, 5.0, 4, 4)
    problem = uniform_tension(mesh, stack_plane(layers), stress=(1.0, 0.0, 0.0))
    field = solve_plane(problem)["pull"]
    # E_x = 1 / a11 of the [+-45] extensional compliance; no coupling of shear and extension.
    compliance = np.linalg.inv(layers.mean(axis=0))
    np.testing.assert_allclose(field.strain, np.tile(compliance[:, 0], (16, 1)), atol=1e-12)
    assert np.abs(field.strain[:, 2]).max() < 1e-12
    # Each layer carries its own stress; their mean is that of the cell.
    own = [field.stress_in(a, q) for a in (np.pi / 4, -np.pi / 4)]
    np.testing.assert_allclose(own[0][:, :2], own[1][:, :2], atol=1e-9)
    np.testing.assert_allclose(own[0][:, 2], -own[1][:, 2], atol=1e-9)
    assert np.mean([o[:, 0] + o[:, 1] for o in own]) == pytest.approx(1.0)


@settings(max_examples=10, deadline=None)
@given(turn=st.floats(0.0, np.pi), shift=st.floats(-20.0, 20.0), seed=st.integers(0, 99))
def test_the_answer_turns_with_the_plate(turn, shift, seed):
    mesh = plate(6.0, 3.0, 4, 3, shake=0.2)
    q = plane_stress(*C_FRAM)
    angle = np.random.default_rng(seed).uniform(0.0, np.pi, len(mesh.cells))
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s], [s, c]])
    force = np.array([0.3, -1.0])

    def solved(mesh, angle, force):
        loads = {"load": (Force("x_max", (*force, 0.0)),)}
        clamped = (Support("x_min", "xy"),)
        return solve_plane(PlaneProblem(mesh, rotate_plane(q, angle), 1.0, clamped, loads))["load"]

    first = solved(mesh, angle, force)
    turned = replace(mesh, points=mesh.points @ matrix.T + shift)
    second = solved(turned, angle + turn, matrix @ force)
    scale = np.abs(first.displacement).max()
    np.testing.assert_allclose(
        second.displacement, first.displacement @ matrix.T, atol=1e-8 * scale
    )
    np.testing.assert_allclose(second.cell_energy, first.cell_energy, rtol=1e-6)
    np.testing.assert_allclose(
        second.stress_in(angle + turn),
        first.stress_in(angle),
        atol=1e-7 * np.abs(first.stress).max(),
    )


@KINDS
def test_energy_work_and_reactions_balance(corners, shake):
    mesh = plate(8.0, 3.0, 8, 4, corners, shake)
    thickness = 0.5 + np.random.default_rng(1).random(len(mesh.cells))
    loads = {
        "pull": (Force("x_max", (2.0, 1.0, 0.0)), PointForce((4.0, 3.0, 0.0), (0.0, -1.0, 0.0))),
        "press": (Pressure("y_max", 0.3),),
    }
    problem = PlaneProblem(mesh, STEEL, thickness, (Support("x_min", "xy"),), loads)
    forces = prepare(problem).forces
    fields = solve_plane(problem, tolerance=1e-11)
    for name, field in fields.items():
        total = field.reactions + forces[name]
        np.testing.assert_allclose(total.sum(axis=0), 0.0, atol=1e-9)
        moment = mesh.points[:, 0] * total[:, 1] - mesh.points[:, 1] * total[:, 0]
        assert abs(moment.sum()) < 1e-8
        work = np.vdot(forces[name], field.displacement)
        assert work == pytest.approx(2.0 * field.strain_energy, rel=1e-9)
        assert field.record.residual <= 1e-11
    np.testing.assert_allclose(forces["pull"].sum(axis=0), [2.0, 0.0], atol=1e-12)
    at_top = mesh.boundary_cells[
        [k for k, edge in enumerate(mesh.boundary) if np.allclose(mesh.points[edge, 1], 3.0)]
    ]
    assert forces["press"].sum(axis=0)[1] == pytest.approx(-0.3 * thickness[at_top].sum())


def test_agrees_with_tetrahedra_of_a_thin_plate():
    # A short cantilever: the tets stretch through the thickness freely, so plane stress holds.
    size = (24.0, 8.0, 0.5)
    tets = box_mesh(size, (24, 8, 1)).quadratic()
    material = isotropic(1000.0, 0.3)
    load = (0.0, -2.0, 0.0)
    supports = (Support("x_min", "xy"), Support("z_min", "z"))
    part = Problem(tets, material, supports, {"bend": (Force("x_max", load),)})
    thick = solve(part)["bend"]
    mesh = plate(*size[:2], 48, 16)
    q = plane_stress(1000.0, 1000.0, 0.3, 1000.0 / 2.6)
    clamped = (Support("x_min", "xy"),)
    thin = solve_plane(PlaneProblem(mesh, q, size[2], clamped, {"bend": (Force("x_max", load),)}))
    assert thin["bend"].strain_energy == pytest.approx(thick.strain_energy, rel=5e-3)


def cook(divisions, corners):
    """Cook's membrane: tapered panel 48 wide, 44 to 16 high, clamped left, sheared right."""
    mesh = plate(1.0, 1.0, divisions, divisions, corners)
    x, y = mesh.points.T
    points = np.stack([48.0 * x, 44.0 * x + y * (44.0 - 28.0 * x)], axis=1)
    mesh = replace(mesh, points=points)
    q = plane_stress(1.0, 1.0, 1.0 / 3.0, 1.0 / (2.0 * 4.0 / 3.0))
    loads = {"shear": (Force("x_max", (0.0, 1.0, 0.0)),)}
    field = solve_plane(PlaneProblem(mesh, q, 1.0, (Support("x_min", "xy"),), loads))["shear"]
    return field.displacement[mesh.nearest_nodes([[48.0, 52.0]])[0], 1]


@pytest.mark.parametrize("corners", [3, 4])
def test_cook_membrane(corners):
    # Reference 23.96 at the middle of the right side (plane stress, E 1, nu 1/3).
    found = [cook(n, corners) for n in (16, 32, 64)]
    assert np.all(np.diff(found) > 0.0)
    assert found[2] == pytest.approx(23.96, rel=0.01)
    errors = 23.96 - np.array(found)
    assert errors[0] / errors[1] > 2.5


def test_kirsch_stress_at_a_hole():
    # Quarter of a wide plate with a hole of radius 1: polar mesh to radius 20, symmetric.
    radial, around = 60, 40
    r = np.geomspace(1.0, 20.0, radial + 1)
    a = np.linspace(0.0, np.pi / 2, around + 1)
    points = np.stack([np.outer(r, np.cos(a)), np.outer(r, np.sin(a))], axis=2).reshape(-1, 2)
    number = np.arange(len(points)).reshape(radial + 1, around + 1)
    corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    mesh = PlaneMesh(points, np.stack(corners, axis=-1).reshape(-1, 4))
    on_x, on_y = np.abs(points[:, 1]) < 1e-9, np.abs(points[:, 0]) < 1e-9
    sides = {"x": mesh.boundary_where(on_x), "y": mesh.boundary_where(on_y)}
    middle = 0.5 * (a[1:] + a[:-1])
    # Kirsch's stress on the outer arc, as tractions edge by edge (far field 1 along x).
    loads = []
    for k, angle in enumerate(middle):
        name = f"arc{k}"
        sides[name] = number[-1, k : k + 2][None]
        q, c2, s2 = 1.0 / 400.0, np.cos(2 * angle), np.sin(2 * angle)
        rr = 0.5 * (1 - q) + 0.5 * (1 - 4 * q + 3 * q * q) * c2
        rt = -0.5 * (1 + 2 * q - 3 * q * q) * s2
        c, s = np.cos(angle), np.sin(angle)
        loads.append(Traction(name, (rr * c - rt * s, rr * s + rt * c, 0.0)))
    mesh = mesh.with_patches(sides)
    supports = (Support("x", "y"), Support("y", "x"))
    field = solve_plane(PlaneProblem(mesh, STEEL, 1.0, supports, {"pull": loads}))["pull"]
    x, y = mesh.centres.T
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    q = 1.0 / radius**2
    c2, s2 = np.cos(2 * angle), np.sin(2 * angle)
    exact = np.stack(
        [
            0.5 * (1 - q) + 0.5 * (1 - 4 * q + 3 * q * q) * c2,
            0.5 * (1 + q) - 0.5 * (1 + 3 * q * q) * c2,
            -0.5 * (1 + 2 * q - 3 * q * q) * s2,
        ],
        axis=1,
    )
    found = field.stress_in(angle)
    assert np.abs(found - exact).max() < 0.02
    assert found[:, 1].max() == pytest.approx(exact[:, 1].max(), rel=0.01)


def test_one_matrix_of_elements_serves_every_stiffness():
    mesh = plate(6.0, 4.0, 6, 4)
    elements = PlaneElements(mesh)
    q = plane_stress(*C_FRAM)
    loads = {"load": (Force("x_max", (0.0, 1.0, 0.0)),)}
    for angle in (0.0, 0.7):
        problem = PlaneProblem(mesh, rotate_plane(q, angle), 2.0, (Support("x_min"),), loads)
        shared = solve_plane(problem, elements=elements)["load"]
        alone = solve_plane(problem)["load"]
        np.testing.assert_array_equal(shared.displacement, alone.displacement)


@pytest.mark.parametrize("backend", ["superlu", "skyline", "auto"])
def test_backends_agree(backend):
    mesh = plate(80.0, 60.0, 80, 60)
    problem = PlaneProblem(
        mesh, STEEL, 1.0, (Support("x_min"),), {"load": (Force("x_max", (0.0, 1.0, 0.0)),)}
    )
    field = solve_plane(problem, backend, tolerance=1e-10)["load"]
    assert field.record.iterations == 0
    # Timoshenko: bending plus shear of a deep cantilever, within the clamp's and mesh's error.
    length, height = 80.0, 60.0
    bending = 4.0 * length**3 / (200000.0 * height**3)
    shear = 1.2 * length / (200000.0 / 2.6 * height)
    tip = field.displacement[mesh.nearest_nodes([[80.0, 30.0]])[0], 1]
    assert tip == pytest.approx(bending + shear, rel=0.03)


MESH = plate(4.0, 2.0, 4, 2)
LOAD = {"load": (Force("x_max", (1.0, 0.0, 0.0)),)}
CLAMP = (Support("x_min"),)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((MESH, np.ones((2, 3, 3)), 1.0, CLAMP, LOAD), r"shape \(3, 3\) or \(8, 3, 3\)"),
        ((MESH, STEEL, 0.0, CLAMP, LOAD), "thickness must be positive"),
        ((MESH, STEEL, np.ones(3), CLAMP, LOAD), "one a cell"),
        ((MESH, -STEEL, 1.0, CLAMP, LOAD), "positive definite"),
        ((MESH, STEEL * np.nan, 1.0, CLAMP, LOAD), "finite"),
        ((MESH, STEEL, 1.0, (Support("x_min", "z"),), LOAD), "hold x or y"),
        ((MESH, STEEL, 1.0, (), LOAD), "no support"),
        ((MESH, STEEL, 1.0, (Support("x_min", "x"),), LOAD), "free to move along y:"),
        ((MESH, STEEL, 1.0, (Support("pin", "xy"),), LOAD), "rotate about the axis through"),
        ((MESH, STEEL, 1.0, CLAMP, {}), "no load case"),
        ((MESH, STEEL, 1.0, CLAMP, {"a": (Force("x_max", (0.0, 0.0, 1.0)),)}), "in its plane"),
        ((MESH, STEEL, 1.0, CLAMP, {"a": (Force("pin", (1.0, 0.0, 0.0)),)}), "PointForce"),
        (
            (MESH, STEEL, 1.0, CLAMP, {"a": (Force("hole", (1.0, 0.0, 0.0)),)}),
            "named 'hole'",
        ),
    ],
)
def test_bad_problems_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        solve_plane(PlaneProblem(*arguments))


def test_an_iterative_backend_is_refused():
    with pytest.raises(InputError, match="direct backend"):
        solve_plane(PlaneProblem(MESH, STEEL, 1.0, CLAMP, LOAD), backend="amg")


def test_inverted_and_bent_cells_are_refused():
    turned = replace(MESH, cells=MESH.cells[:, ::-1])
    with pytest.raises(InputError, match="cell 0 of the plane mesh"):
        solve_plane(PlaneProblem(turned, STEEL, 1.0, CLAMP, LOAD))


def test_pieces_that_share_a_corner_are_hinged():
    mesh = raster_mesh(np.array([[0, 1], [1, 0]], dtype=bool))
    problem = PlaneProblem(mesh, STEEL, 1.0, CLAMP, LOAD)
    with pytest.raises(InputError, match="rotate about the axis through"):
        solve_plane(problem)


def test_a_pin_presses_on_half_of_a_hole():
    around = 64
    angle = 2 * np.pi * np.arange(around) / around
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.vstack([2.0 * unit, 5.0 * unit])
    k = np.arange(around)
    after = (k + 1) % around
    mesh = PlaneMesh(points, np.stack([k, around + k, around + after, after], axis=1))
    inner = np.arange(2 * around) < around
    mesh = mesh.with_patches(
        {"hole": mesh.boundary_where(inner), "rim": mesh.boundary_where(~inner)}
    )
    loads = {"pin": (Bearing("hole", (3.0, 0.0, 0.0)),)}
    problem = PlaneProblem(mesh, STEEL, 0.5, (Support("rim"),), loads)
    forces = prepare(problem).forces["pin"]
    np.testing.assert_allclose(forces.sum(axis=0), [3.0, 0.0], atol=1e-9)
    assert np.abs(forces[inner.nonzero()[0][np.cos(angle) < -0.1]]).max() < 1e-15 * 3.0
    # The pressure is a cosine: 4 F / (pi d t) at its middle.
    middle = forces[0, 0] / (2 * 2.0 * np.sin(np.pi / around) * 0.5)
    assert middle == pytest.approx(4 * 3.0 / (np.pi * 4.0 * 0.5), rel=0.01)
