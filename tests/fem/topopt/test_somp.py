from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Force, PointForce, Support
from ccfem.fem.materials import plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh, rotate_plane, solve_plane
from ccfem.fem.topopt import Compliance, Simp, Somp
from ccfem.fem.topopt.design import harmonics
from ccfem.fem.topopt.somp import OrientedCompliance

FIBRE = plane_stress(50000.0, 4000.0, 0.3, 2500.0)
WANG = plane_stress(18300.0, 19800.0, 0.17, 5150.0)


def cantilever(nx=20, ny=10):
    mesh = raster_mesh(np.ones((ny, nx), dtype=bool))
    loads = {"tip": (PointForce((nx, ny / 2, 0.0), (0.0, -100.0, 0.0)),)}
    return PlaneProblem(mesh, FIBRE, 1.0, (Support("x_min"),), loads)


def test_angle_sensitivities_by_finite_differences():
    problem = cantilever(10, 6)
    more = {"pull": (PointForce((10.0, 6.0, 0.0), (30.0, 50.0, 0.0)),)}
    problem = replace(problem, loads={**problem.loads, **more}, thickness=np.linspace(0.5, 1.5, 60))
    rng = np.random.default_rng(0)
    factor, angle = rng.uniform(0.1, 1.0, 60), rng.uniform(-1.5, 1.5, 60)
    plate = Compliance(problem, {"tip": 1.0, "pull": 0.5}, "superlu")

    def part(angle):
        return OrientedCompliance(plate, harmonics(FIBRE), angle)

    first = part(angle)
    gradient = first.angle_gradient(first(factor), factor)
    step = 1e-5
    for cell in rng.choice(60, 12, replace=False):
        move = step * (np.arange(60) == cell)
        difference = part(angle + move)(factor).compliance - part(angle - move)(factor).compliance
        assert gradient[cell] == pytest.approx(
            difference / (2 * step), rel=1e-5, abs=1e-6 * np.abs(gradient).max()
        )


def test_bridge_of_wang_2021():
    # Prototype of specification 001 (addendum, A3 and I3): 18.825 after 60 iterations, 18.668 after
    # 197 with 16.92 for the thresholded design. Its load near the middle is not known exactly; with
    # 100 N over 5 mm the full plate has 9.166 against its 9.132.
    mesh = raster_mesh(np.ones((50, 185), dtype=bool))
    x, y = mesh.points.T
    sides = {
        "left": mesh.boundary_where((y == 0.0) & (x <= 5.0)),
        "right": mesh.boundary_where((y == 0.0) & (x >= 180.0)),
        "top": mesh.boundary_where((y == 50.0) & (np.abs(x - 92.5) <= 2.5)),
    }
    supports = (Support("left", "xy"), Support("right", "y"))
    loads = {"down": (Force("top", (0.0, -100.0, 0.0)),)}
    problem = PlaneProblem(mesh.with_patches(sides), WANG, 1.0, supports, loads)
    full = solve_plane(problem)["down"]
    assert 2.0 * full.strain_energy == pytest.approx(9.1315, rel=0.005)
    design = Somp(0.4, max_iterations=60)(problem, WANG)
    assert design.compliance[-1] == pytest.approx(18.825, rel=0.005)
    filled = np.where(design.filled(0.4), 1.0, 1e-3)[:, None, None]
    cut = solve_plane(replace(problem, stiffness=filled * design.full.stiffness))["down"]
    assert 2.0 * cut.strain_energy < 17.1


def test_fixed_axis_is_simp_of_the_turned_material():
    problem = cantilever()
    angle = 0.3
    turned = replace(problem, stiffness=rotate_plane(FIBRE, angle))
    wanted = Simp(0.5, radius=1.5, minimum_stiffness=1e-3, max_iterations=15)(turned)
    found = Somp(0.5, radius=1.5, orientation="fixed", max_iterations=15)(
        problem, FIBRE, angle=angle
    )
    np.testing.assert_allclose(found.density, wanted.density, atol=1e-6)
    np.testing.assert_allclose(found.compliance, wanted.compliance, rtol=1e-8)
    np.testing.assert_allclose(found.angle, angle)


@pytest.mark.parametrize("orientation", ["principal", "gradient"])
def test_turning_the_axis_pays(orientation):
    problem = cantilever()
    fixed = Somp(0.5, radius=1.5, orientation="fixed", max_iterations=60)(problem, FIBRE)
    free = Somp(0.5, radius=1.5, orientation=orientation, max_iterations=60)(problem, FIBRE)
    assert free.compliance[-1] < 0.8 * fixed.compliance[-1]
    assert free.volume_fraction == pytest.approx(0.5, abs=1e-6)
    field = solve_plane(free.problem)["tip"]
    assert 2.0 * field.strain_energy == pytest.approx(free.compliance[-1], rel=1e-6)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0])
def test_a_bar_in_tension_takes_its_axis_along_the_pull(degrees):
    # Whatever the bar's direction: pulled along x or y, or sheared at 45 degrees.
    mesh = raster_mesh(np.ones((8, 8), dtype=bool))
    a, b = mesh.nearest_nodes([[0, 0], [8, 0]])
    mesh = mesh.with_patches({"pin": [[a]], "roller": [[b]]})
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    sx, sy, t = 10 * c * c, 10 * s * s, 10 * c * s
    loads = tuple(
        Force(name, (8 * sign * fx, 8 * sign * fy, 0.0))
        for name, sign, fx, fy in (
            ("x_max", 1, sx, t),
            ("x_min", -1, sx, t),
            ("y_max", 1, t, sy),
            ("y_min", -1, t, sy),
        )
        if abs(fx) + abs(fy) > 1e-9
    )
    supports = (Support("pin", "xy"), Support("roller", "y"))
    problem = PlaneProblem(mesh, FIBRE, 1.0, supports, {"pull": loads})
    solid = np.ones(64, dtype=bool)
    solid[:2] = False
    design = Somp(0.99, radius=1.5, max_iterations=40, objective_tolerance=0.0, tolerance=0.0)(
        problem, FIBRE, solid=solid, angle=0.2
    )
    away = np.abs(np.sin(design.angle - np.radians(degrees)))
    assert np.degrees(away.max()) < 3.0


def test_principal_directions_are_those_of_the_stress():
    problem = cantilever(8, 4)
    plate = Compliance(problem, None, "superlu")
    angle = np.random.default_rng(3).uniform(-1.5, 1.5, 32)
    part = OrientedCompliance(plate, harmonics(WANG), angle)
    vector = part.principal(part(np.ones(32)), np.ones(32))
    field = solve_plane(replace(problem, stiffness=rotate_plane(WANG, angle)))["tip"]
    for (s11, s22, s12), (c2, s2) in zip(field.stress, vector, strict=True):
        values, directions = np.linalg.eigh([[s11, s12], [s12, s22]])
        k = np.abs(values).argmax()
        x, y = directions[:, k]
        wanted = np.abs(values[k]) * np.array([x * x - y * y, 2 * x * y])
        np.testing.assert_allclose([c2, s2], wanted, rtol=1e-6, atol=1e-9)


def test_the_design_is_mirrored_with_the_load():
    down = cantilever()
    up = replace(down, loads={"tip": (PointForce((20.0, 5.0, 0.0), (0.0, 100.0, 0.0)),)})
    first = Somp(0.5, radius=1.5, max_iterations=20)(down, FIBRE)
    # Turning the sign of the load changes no principal line.
    second = Somp(0.5, radius=1.5, max_iterations=20)(up, FIBRE)
    np.testing.assert_allclose(second.density, first.density, atol=1e-6)
    np.testing.assert_allclose(
        second.density.reshape(10, 20)[::-1], first.density.reshape(10, 20), atol=1e-4
    )


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"orientation": "random"}, "one of 'principal', 'gradient', 'fixed'; got 'random'"),
        ({"relaxation": 0.0}, "relaxation must be above 0 and at most 1; got 0.0"),
        ({"volume_fraction": 1.5}, r"somp\.volume_fraction must be above 0 and below 1; got 1.5"),
    ],
)
def test_bad_parameters_are_refused(more, message):
    with pytest.raises(InputError, match=message):
        Somp(**{"volume_fraction": 0.5, **more})


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"stiffness": np.eye(6)}, r"shape \(3, 3\) here; got \(6, 6\)"),
        ({"angle": np.zeros(3)}, "one number or one a cell"),
    ],
)
def test_bad_data_are_refused(more, message):
    with pytest.raises(InputError, match=message):
        Somp(0.5)(**{"problem": cantilever(), "stiffness": FIBRE, **more})
