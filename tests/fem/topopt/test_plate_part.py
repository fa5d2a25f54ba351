from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Force, PointForce, Support, solve
from ccfem.fem.materials import isotropic, plane_stress, transversely_isotropic
from ccfem.fem.plates import PlaneProblem, raster_mesh, rotate_plane, solve_plane
from ccfem.fem.topopt import Design, Simp, as_problem, part_shape

PLA = isotropic(3000.0, 0.35)
SHEET = plane_stress(3000.0, 3000.0, 0.35, 3000.0 / 2.7)


def full(problem, angle=None):
    """Design that fills its domain."""
    one = np.ones(len(problem.mesh.cells))
    return Design(problem, one, one, one, np.array([1.0]), np.zeros(0), "", angle)


def strip(mask, **more):
    mesh = raster_mesh(mask, 0.5)
    mesh = mesh.with_patches({"pin": mesh.nearest_nodes([[0.0, 0.0]])[:, None]})
    supports = (Support("x_min", "x"), Support("pin", "y"))
    loads = {"pull": (Force("x_max", (60.0, 0.0, 0.0)),)}
    return PlaneProblem(mesh, SHEET, 2.0, supports, {**loads, **more})


@pytest.mark.parametrize("thickness", [None, 3.0])
def test_a_pulled_strip_is_that_of_the_textbook(thickness):
    part = as_problem(full(strip(np.ones((16, 60), dtype=bool))), PLA, thickness)
    # One-dimensional: u = F L / (E A), and the forces keep their total.
    area = 8.0 * (2.0 if thickness is None else thickness)
    assert 2.0 * solve(part)["pull"].strain_energy == pytest.approx(
        60.0**2 * 30.0 / (3000.0 * area), rel=1e-3
    )
    assert part.mesh.facet_areas(part.mesh.patch("x_max"))[0].sum() == pytest.approx(area)


def test_axes_are_those_of_the_design():
    fibre = transversely_isotropic(50000.0, 4000.0, 0.3, 2500.0)
    angle = np.full(16 * 60, 0.4)
    part = as_problem(full(strip(np.ones((16, 60), dtype=bool)), angle), fibre)
    sheet = rotate_plane(plane_stress(50000.0, 4000.0, 0.3, 2500.0), 0.4)
    wanted = solve_plane(replace(strip(np.ones((16, 60), dtype=bool)), stiffness=sheet))["pull"]
    assert solve(part)["pull"].strain_energy == pytest.approx(wanted.strain_energy, rel=0.02)


@pytest.fixture(scope="module")
def cantilever():
    """Half-filled cantilever: held and loaded on 5 mm of its sides, and at a point."""
    mesh = raster_mesh(np.ones((20, 40), dtype=bool))
    x, y = mesh.points.T
    sides = {
        "high": mesh.boundary_where((x == 0.0) & (y >= 15.0)),
        "low": mesh.boundary_where((x == 0.0) & (y <= 5.0)),
        "tip": mesh.boundary_where((x == 40.0) & (np.abs(y - 10.0) <= 3.0)),
    }
    loads = {
        "down": (Force("tip", (0.0, -100.0, 0.0)),),
        "point": (PointForce((40.0, 10.0, 0.0), (0.0, -100.0, 0.0)),),
    }
    supports = (Support("high", "xy"), Support("low", "xy"))
    return Simp(0.5, radius=1.5, minimum_stiffness=1e-3, max_iterations=40)(
        PlaneProblem(mesh.with_patches(sides), SHEET, 1.5, supports, loads)
    )


def test_patches_lie_where_they_were(cantilever):
    part = as_problem(cantilever, PLA, edge_length=1.3)
    mesh, rim = part.mesh, part_shape(cantilever).boundary
    for name, x, low, high in (("high", 0, 15, 20), ("low", 0, 0, 5), ("tip", 40, 7, 13)):
        facets = mesh.patch(name)
        held = rim.intersection(shapely.LineString([(x, low), (x, high)]).buffer(1e-6)).length
        assert held > 2.0
        assert mesh.facet_areas(facets)[0].sum() == pytest.approx(1.5 * held, rel=1e-4)
        np.testing.assert_allclose(mesh.points[facets, 0], x, atol=1e-9)
        assert low - 1e-6 <= mesh.points[facets, 1].min() < mesh.points[facets, 1].max()
        assert mesh.points[facets, 1].max() <= high + 1e-6
    assert mesh.volumes.sum() == pytest.approx(0.5 * 40 * 20 * 1.5, rel=0.02)


def test_the_part_is_as_stiff_as_its_outline_on_a_fine_raster(cantilever):
    part = as_problem(cantilever, PLA, edge_length=1.0)
    polygon, h = part_shape(cantilever), 0.2
    y, x = h * (np.mgrid[:100, :200] + 0.5)
    mesh = raster_mesh(shapely.contains_xy(polygon, x, y)[::-1], h)
    x, y = mesh.points.T
    sides = {
        "high": mesh.boundary_where((x < 1e-6) & (y >= 15.0 - 1e-6)),
        "low": mesh.boundary_where((x < 1e-6) & (y <= 5.0 + 1e-6)),
        "tip": mesh.boundary_where((x > 40.0 - 1e-6) & (np.abs(y - 10.0) <= 3.0 + 1e-6)),
    }
    raster = replace(cantilever.full, mesh=mesh.with_patches(sides), stiffness=SHEET, thickness=1.5)
    wanted = solve_plane(raster)["down"]
    fields = solve(part)
    assert fields["down"].strain_energy == pytest.approx(wanted.strain_energy, rel=0.03)
    for case in ("down", "point"):
        reaction = fields[case].reactions.sum(axis=0)
        np.testing.assert_allclose(reaction, [0.0, 100.0, 0.0], atol=1e-5)
    small = part.mesh.patch("point_point_0")
    assert part.mesh.facet_areas(small)[0].sum() < 1.5 * 3.0
    assert np.abs(part.mesh.points[small] - [40.0, 10.0, 0.75]).max() < 1.5


def test_walls_of_a_hole_take_over_its_steps():
    # A hole of radius 6 mm in pixels, and the true circle as the domain.
    row, column = np.mgrid[:24, :40] + 0.5
    mask = np.hypot(column - 20.0, row - 12.0) > 6.0
    mesh = raster_mesh(mask)
    x, y = mesh.points.T
    rim = mesh.boundary_where(np.hypot(x - 20.0, y - 12.0) < 7.5)
    mesh = mesh.with_patches({"rim": rim})
    loads = {"push": (Force("rim", (10.0, 0.0, 0.0)),)}
    problem = PlaneProblem(mesh, SHEET, 1.0, (Support("x_min", "xy"),), loads)
    hole = shapely.Point(20.0, 12.0).buffer(6.0, quad_segs=32)
    part = as_problem(full(problem), PLA, domain=shapely.box(0, 0, 40, 24).difference(hole))
    rim = part.mesh.patch("rim")
    np.testing.assert_allclose(
        np.linalg.norm(part.mesh.points[rim, :2] - [20.0, 12.0], axis=-1), 6.0, atol=0.05
    )
    assert part.mesh.facet_areas(rim)[0].sum() == pytest.approx(2 * np.pi * 6.0, rel=0.01)
    assert len(np.unique(part.mesh.patch("x_min"))) > 4


def test_what_cannot_be_carried_over_is_refused():
    mask = np.ones((16, 60), dtype=bool)
    inside = strip(mask, push=(PointForce((15.0, 4.0, 0.0), (1.0, 0.0, 0.0)),))
    with pytest.raises(InputError, match="is not on the outline"):
        as_problem(full(inside), PLA)
    uneven = replace(strip(mask), thickness=np.linspace(1.0, 2.0, mask.sum()))
    with pytest.raises(InputError, match="1 to 2 mm thick: name the thickness"):
        as_problem(full(uneven), PLA)
    mesh = strip(mask).mesh
    named = replace(strip(mask), mesh=mesh.with_patches({"bottom": mesh.patch("y_min")}))
    with pytest.raises(InputError, match="'bottom' names the face at z = 0"):
        as_problem(full(named), PLA)
    middle = mesh.cells[np.linalg.norm(mesh.centres - [15.0, 4.0], axis=1).argmin()][:2]
    hidden = replace(
        strip(mask), mesh=mesh.with_patches({"x_min": [middle]}), supports=(Support("x_min"),)
    )
    with pytest.raises(InputError, match="does not reach patch 'x_min'"):
        as_problem(full(hidden), PLA)
