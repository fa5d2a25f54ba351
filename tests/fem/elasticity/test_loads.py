from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.loads import load_case, nodal_forces
from ccfem.fem.elasticity.problem import (
    Bearing,
    Force,
    PointForce,
    Pressure,
    Problem,
    Support,
    Traction,
)
from ccfem.fem.materials import isotropic

NAN = float("nan")


def box(order=1):
    mesh = box_mesh((4.0, 3.0, 2.0), (3, 2, 2), (1.0, 0.0, 0.0))
    return mesh if order == 1 else mesh.quadratic()


def half_ring(order=1, count=16):
    """Return the half y > 0 of a ring of radii 5 and 6; its patch y_min is the hole's wall."""
    mesh = box_mesh((np.pi, 1.0, 1.0), (count, 2, 2))
    angle, radius = mesh.points[:, 0], 5.0 + mesh.points[:, 1]
    x, y = -radius * np.cos(angle), radius * np.sin(angle)
    mesh = replace(mesh, points=np.stack([x, y, mesh.points[:, 2]], axis=1))
    assert mesh.volumes.min() > 0.0
    return mesh if order == 1 else mesh.quadratic()


def moments(mesh, forces):
    return np.cross(mesh.points, forces).sum(axis=0)


@pytest.mark.parametrize("order", [1, 2])
def test_force_acts_at_the_centroid_of_its_patch(order):
    mesh, vector = box(order), np.array([3.0, -2.0, 5.0])
    forces = nodal_forces(mesh, Force("x_max", tuple(vector)))
    np.testing.assert_allclose(forces.sum(axis=0), vector, atol=1e-13)
    np.testing.assert_allclose(moments(mesh, forces), np.cross([5.0, 1.5, 1.0], vector))


@pytest.mark.parametrize("order", [1, 2])
def test_traction_does_the_work_of_its_integral(order):
    # Work over a displacement that the elements hold exactly: u_x = y z on P2, y on P1.
    mesh = box(order)
    forces = nodal_forces(mesh, Traction("x_max", (2.0, 0.0, 0.0)))
    y, z = mesh.points[:, 1], mesh.points[:, 2]
    assert forces[:, 0] @ y == pytest.approx(2.0 * 2.0 * 4.5)
    if order == 2:
        assert forces[:, 0] @ (y * z) == pytest.approx(2.0 * 4.5 * 2.0)


def test_quadratic_facets_load_their_middles_only():
    mesh = box(2)
    forces = nodal_forces(mesh, Force("z_max", (0.0, 0.0, 1.0)))
    assert not forces[: len(box().points)].any()
    assert (forces[np.unique(mesh.facet_nodes(mesh.patch("z_max"))[:, 3:]), 2] > 0.0).all()


@pytest.mark.parametrize("order", [1, 2])
def test_pressure_pushes_inward_however_facets_are_turned(order):
    mesh = box(order)
    flipped = mesh.with_patches({"flipped": mesh.patch("x_max")[:, ::-1]})
    for name in ("x_max", "flipped"):
        forces = nodal_forces(flipped, Pressure(name, 0.5))
        np.testing.assert_allclose(forces.sum(axis=0), [-3.0, 0.0, 0.0], atol=1e-13)


def test_pressure_on_the_whole_boundary_is_in_balance():
    mesh = half_ring()
    forces = nodal_forces(mesh.with_patches({"all": mesh.boundary}), Pressure("all", 3.0))
    assert np.abs(forces).max() > 0.1
    np.testing.assert_allclose(forces.sum(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(moments(mesh, forces), 0.0, atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_bearing_force_is_the_total_and_passes_through_the_axis(order):
    mesh = half_ring(order)
    for vector in ((0.0, 100.0, 0.0), (30.0, 80.0, 0.0)):
        forces = nodal_forces(mesh, Bearing("y_min", vector))
        np.testing.assert_allclose(forces.sum(axis=0), vector, atol=1e-11)
        # Every facet pushes along its normal, through the axis x = y = 0.
        assert moments(mesh, forces)[2] == pytest.approx(0.0, abs=1e-10)


def test_bearing_pressure_is_the_cosine():
    # p = 2 F cos(t) / (pi r l): facet k of n carries p times its area, at its middle angle t.
    count, total = 32, 100.0
    mesh = half_ring(count=count)
    forces = nodal_forces(mesh, Bearing("y_min", (0.0, total, 0.0)))
    on_wall = np.isclose(np.hypot(mesh.points[:, 0], mesh.points[:, 1]), 5.0)
    angle = np.arctan2(mesh.points[:, 0], mesh.points[:, 1])[on_wall]
    radial = np.hypot(forces[on_wall, 0], forces[on_wall, 1])
    middle = (np.abs(angle) < 1.4) & np.isclose(mesh.points[on_wall, 2], 0.5)
    expected = 2.0 * total / np.pi * np.cos(angle[middle]) * (np.pi / count) * 0.5
    # The facets are flat: their pressure is a cosine in steps, to O(count^-2).
    np.testing.assert_allclose(radial[middle], expected, rtol=0.01)


def test_bearing_presses_only_the_touched_half():
    mesh = half_ring()
    forces = nodal_forces(mesh, Bearing("y_min", (50.0, 50.0, 0.0)))
    loaded = np.abs(forces).max(axis=1) > 1e-12
    angle = np.degrees(np.arctan2(mesh.points[loaded, 1], mesh.points[loaded, 0]))
    assert angle.max() < 45.0 + 90.0 + 12.0
    outward = (forces[loaded, :2] * mesh.points[loaded, :2]).sum(axis=1)
    assert (outward > 0.0).all()


@pytest.mark.parametrize("vector", [(0.0, -100.0, 0.0), (0.0, 100.0, 20.0), (0.0, 0.0, 1.0)])
def test_bearing_that_no_pin_can_press_is_refused(vector):
    with pytest.raises(InputError, match="cannot press on patch 'y_min'"):
        nodal_forces(half_ring(), Bearing("y_min", vector))


def test_point_force_goes_to_the_nearest_node():
    mesh = box()
    forces = nodal_forces(mesh, PointForce((5.1, 2.9, 2.2), (0.0, 1.0, 0.0)))
    np.testing.assert_allclose(mesh.points[np.flatnonzero(forces[:, 1])], [[5.0, 3.0, 2.0]])


@given(st.tuples(*[st.integers(-1000, 1000)] * 3).filter(any))
def test_total_of_a_force_is_its_vector(vector):
    total = nodal_forces(box(), Force("y_max", vector)).sum(axis=0)
    np.testing.assert_allclose(total, vector, atol=1e-12 * max(map(abs, vector)))


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (Force("x_max", (0.0, 0.0, 0.0)), "must not be zero"),
        (Force("x_max", (1e-300, 0.0, 0.0)), "must not be zero"),
        (Force("x_max", (1e300, 0.0, 0.0)), "must be at most 1e[+]12"),
        (Pressure("x_max", 0.0), "must not be zero"),
        (Force("x_max", (NAN, 0.0, 0.0)), "must be finite"),
        (PointForce((NAN, 0.0, 0.0), (1.0, 0.0, 0.0)), "must be finite"),
        (Force("nowhere", (1.0, 0.0, 0.0)), "no patch named 'nowhere'; there are: .*x_max"),
        (Traction("empty", (1.0, 0.0, 0.0)), "patch 'empty' is empty"),
        (Pressure("inside", 1.0), "facets inside the part"),
    ],
)
def test_bad_loads_are_refused(load, message):
    mesh = box()
    on_boundary = {tuple(facet) for facet in np.sort(mesh.boundary, axis=1).tolist()}
    faces = np.sort(mesh.cells[:, mesh.faces].reshape(-1, 3), axis=1).tolist()
    inside = np.array([next(face for face in faces if tuple(face) not in on_boundary)])
    mesh = mesh.with_patches({"empty": np.empty((0, 3), dtype=int), "inside": inside})
    with pytest.raises(InputError, match=message):
        nodal_forces(mesh, load)


def test_a_load_case_must_load():
    loads = {"none": (), "cancel": (Force("x_max", (1, 0, 0)), Force("x_max", (-1, 0, 0)))}
    problem = Problem(box(), isotropic(1.0, 0.3), (Support("x_min"),), loads)
    for name in loads:
        with pytest.raises(InputError, match=f"load case '{name}' is zero"):
            load_case(problem, name)
    moved = replace(problem, supports=(Support("x_min", "x", (0.1, 0.0, 0.0)),))
    assert not load_case(moved, "none").any()
