"""Normals of round walls: what slides on a bore turns about it, and is stressed as Lame found."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.face_rules import Holes
from ccfem.body.mesh.patches import Plane, patches_from_rules
from ccfem.body.mesh.smooth_faces import smooth_faces
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Pressure, Problem, Support, solve
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.problem import Bearing
from ccfem.fem.elasticity.support_kinds import (
    Foundation,
    PointSupport,
    PressingSupport,
    SlidingSupport,
)
from ccfem.fem.elasticity.supports import held, spring_forces
from ccfem.fem.materials import isotropic

TURN = np.linalg.qr([[1.0, 2.0, 3.0], [4.0, -1.0, 2.0], [0.5, 1.0, -3.0]])[0]
CENTRE, RADIUS = np.array([11.0, 9.0]), 3.0


def plate(order: int, edge: float, turn: np.ndarray) -> TetMesh:
    """A plate of 20 x 20 x 3 mm with a bore of radius 3, turned."""
    outline = shapely.box(0, 0, 20, 20).difference(shapely.Point(CENTRE).buffer(RADIUS, 32))
    mesh = extrude(outline, 3.0, edge)
    wall = np.linalg.norm(mesh.points[mesh.boundary][..., :2] - CENTRE, axis=2).max(axis=1)
    patches = {"bore": mesh.boundary[wall < 1.01 * RADIUS], "under": Plane("z", "min")(mesh)}
    mesh = replace(mesh, points=mesh.points @ turn.T, patches=patches)
    return mesh if order == 1 else mesh.quadratic()


SUPPORTS = (SlidingSupport("bore"), PressingSupport("bore"), Foundation("bore", 50.0))


@pytest.mark.parametrize("support", SUPPORTS, ids=lambda each: type(each).__name__)
@pytest.mark.parametrize(("order", "edge"), [(1, 3.0), (2, 3.0), (1, 8.0)])
@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_a_body_on_its_bore_is_free_to_turn(support, order, edge, turn):
    """Whatever the facets of the bore: at an edge length of 8 mm it has 12."""
    mesh = plate(order, edge, turn)
    supports = (support, SlidingSupport("under"))
    problem = Problem(mesh, isotropic(100.0, 0.3), supports, {}, order=order)
    with pytest.raises(InputError, match="the part is free to rotate about the axis through"):
        held(problem)


@pytest.mark.parametrize("order", [1, 2])
def test_a_bed_round_a_bore_does_not_resist_its_rotation(order):
    mesh = plate(order, 3.0, TURN)
    centre = TURN @ [*CENTRE, 0.0]
    turned = np.cross(TURN[:, 2], mesh.points - centre)
    bed = (Foundation("bore", 50.0),)
    assert np.abs(spring_forces(mesh, bed, turned)).max() < 1e-6
    # Along a bed of k, the moment about the axis is k r^2 over the wall.
    along = (Foundation("bore", 0.0, 50.0),)
    moment = -np.cross(mesh.points - centre, spring_forces(mesh, along, turned)).sum(axis=0)
    exact = 50.0 * RADIUS**2 * 2.0 * np.pi * RADIUS * 3.0
    assert moment @ TURN[:, 2] == pytest.approx(exact, rel=0.02)


def test_a_pin_in_a_bore_passes_no_moment_about_its_axis():
    mesh = plate(1, 3.0, TURN)
    force = 100.0 * TURN @ [0.6, 0.8, 0.0]
    forces = nodal_forces(mesh, Bearing("bore", tuple(force)))
    np.testing.assert_allclose(forces.sum(axis=0), force, atol=1e-9)
    moment = np.cross(mesh.points - TURN @ [*CENTRE, 0.0], forces).sum(axis=0)
    assert moment @ TURN[:, 2] == pytest.approx(0.0, abs=1e-9)


def test_a_whole_tube_in_a_rigid_sleeve_is_stressed_as_lame_found():
    # Plane strain, u(b) = 0, p = 1 inside: u = A (r - b^2 / r), 2 (mu + lam) A + 2 mu A b^2 / a^2
    # = -1; one node is kept from turning, which takes no force.
    inner, outer, young, nu = 4.0, 8.0, 100.0, 0.3
    ring = shapely.Point(0, 0).buffer(outer, 64).difference(shapely.Point(0, 0).buffer(inner, 64))
    mesh = extrude(ring, 0.5, 0.5)
    rules = {"in": Holes(inner), "low": Plane("z", "min"), "high": Plane("z", "max")}
    mesh = patches_from_rules(mesh, rules).quadratic()
    wall = np.linalg.norm(mesh.points[mesh.boundary][..., :2], axis=2).min(axis=1) > 0.99 * outer
    mesh = replace(mesh, patches={**mesh.patches, "out": mesh.boundary[wall]})
    supports = (
        SlidingSupport("out"),
        Support("low", "z"),
        Support("high", "z"),
        PointSupport((inner, 0.0, 0.0), "y"),
    )
    loads = {"p": (Pressure("in", 1.0),)}
    field = solve(Problem(mesh, isotropic(young, nu), supports, loads, order=2))["p"]
    mu, lam = young / (2 + 2 * nu), young * nu / ((1 + nu) * (1 - 2 * nu))
    a = -1.0 / (2.0 * (mu + lam) + 2.0 * mu * (outer / inner) ** 2)
    radius = np.hypot(*mesh.points[:, :2].T)
    radial = np.einsum("ij,ij->i", field.displacement[:, :2], mesh.points[:, :2]) / radius
    around = np.cross(mesh.points, field.displacement)[:, 2]
    inside = np.isclose(radius, inner, rtol=2e-3)
    exact = a * (inner - outer**2 / inner)
    assert radial[inside].mean() == pytest.approx(exact, rel=0.005)
    assert np.abs(around / radius).max() < 0.02 * abs(exact)


def seat(half: float) -> TetMesh:
    """A washer whose bore opens upwards by a half angle, degrees, as a countersink does; turned."""
    mesh = plate(1, 2.5, np.eye(3)).linear()
    points = mesh.points.copy()
    arm = points[:, :2] - CENTRE
    away = np.linalg.norm(arm, axis=1)
    grown = np.maximum(1.0 - (away - RADIUS) / 5.0, 0.0) * np.tan(np.radians(half)) * points[:, 2]
    points[:, :2] += arm / away[:, None] * grown[:, None]
    return replace(mesh, points=points @ TURN.T)


@pytest.mark.parametrize("half", [10.0, 40.0])
def test_a_body_on_a_conical_seat_is_free_to_turn(half):
    mesh = seat(half)
    (face,) = smooth_faces(mesh.points, mesh.patches["bore"])
    assert (face.kind, face.hollow) == ("cone", True)
    assert np.degrees(np.arctan(abs(face.slope))) == pytest.approx(half, abs=0.05)
    problem = Problem(mesh, isotropic(100.0, 0.3), (SlidingSupport("bore"),), {}, order=1)
    with pytest.raises(InputError, match=r"free to .*rotate about the axis through"):
        held(problem)


def test_a_body_in_a_spherical_socket_is_free_to_turn_every_way():
    mesh = box_mesh((2.0, 2.0, 2.0), (5, 5, 5), (-1.0, -1.0, -1.0))
    # Cube to ball: each shell of the cube becomes one of the ball.
    length = np.maximum(np.linalg.norm(mesh.points, axis=1), 1e-9)
    factor = 4.0 * np.abs(mesh.points).max(axis=1) / length
    points = np.array([5.0, 6.0, 7.0]) + mesh.points * factor[:, None]
    mesh = replace(mesh, points=points, patches={"ball": mesh.boundary})
    (face,) = smooth_faces(mesh.points, mesh.boundary)
    assert (face.kind, face.hollow) == ("sphere", False)
    np.testing.assert_allclose([*face.centre, face.radius], [5.0, 6.0, 7.0, 4.0], rtol=1e-9)
    problem = Problem(mesh, isotropic(100.0, 0.3), (SlidingSupport("ball"),), {}, order=1)
    with pytest.raises(InputError, match=r"(rotate about .*){3}"):
        held(problem)
