"""Quadratic cells with sides on round walls: against volumes, patch tests and Lame's cylinder."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import CELL_POINTS, CELL_WEIGHTS, EDGES, NODES, jacobians
from ccfem.body.mesh.face_rules import Holes
from ccfem.body.mesh.patches import Plane, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Pressure, Problem, Support, solve
from ccfem.fem.elasticity.assembly import assemble
from ccfem.fem.elasticity.load_kinds import BodyForce, Force, Traction
from ccfem.fem.elasticity.loads import nodal_forces, strain_forces, volume_forces
from ccfem.fem.elasticity.plausibility import about_problem
from ccfem.fem.elasticity.recovery import nodal_stress
from ccfem.fem.elasticity.support_kinds import PointSupport
from ccfem.fem.materials import isotropic

ANGLE = np.radians(37.0)
TURN = np.array(
    [[np.cos(ANGLE), -np.sin(ANGLE), 0.0], [np.sin(ANGLE), np.cos(ANGLE), 0.0], [0.0, 0.0, 1.0]]
)
INNER, OUTER, HEIGHT = 4.0, 8.0, 2.0
YOUNG, POISSON = 100.0, 0.3
LAW = isotropic(YOUNG, POISSON)


def tube(edge: float, height: float = HEIGHT) -> TetMesh:
    """A quadratic mesh of a tube, its bore the patch "in"."""
    disc = shapely.Point(0, 0)
    ring = disc.buffer(OUTER, 64).difference(disc.buffer(INNER, 64))
    rules = {"in": Holes(INNER), "low": Plane("z", "min"), "high": Plane("z", "max")}
    return patches_from_rules(extrude(ring, height, edge), rules).quadratic()


def straight(mesh: TetMesh) -> TetMesh:
    """The mesh with all middles on the chords."""
    points = np.array(mesh.points)
    points[mesh.cells[:, 4:]] = points[mesh.cells[:, EDGES]].mean(axis=2)
    return replace(mesh, points=points)


def test_the_rule_integrates_polynomials_of_degree_five():
    # The mean of L1^a L2^b L3^c over a tetrahedron is 3! a! b! c! / (a + b + c + 3)!.
    factorial = np.cumprod([1.0, *range(1, 9)])
    for powers in ((1, 0, 0), (2, 2, 1), (5, 0, 0), (3, 1, 1)):
        exact = 6.0 * np.prod(factorial[list(powers)]) / factorial[3 + sum(powers)]
        values = np.prod(CELL_POINTS[:, :3] ** np.array(powers), axis=1)
        assert CELL_WEIGHTS @ values == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("turn", [np.eye(3), TURN, TURN @ np.diag([1.0, -1.0, 1.0])])
def test_a_tube_has_its_volume_and_its_nodes_lie_on_it(turn):
    source = tube(2.0).linear()
    cells = source.cells if np.linalg.det(turn) > 0.0 else source.cells[:, [1, 0, 2, 3]]
    mesh = TetMesh(source.points @ turn.T, cells).quadratic()
    exact = np.pi * (OUTER**2 - INNER**2) * HEIGHT
    assert mesh.volumes.sum() == pytest.approx(exact, rel=2e-5)
    assert straight(mesh).volumes.sum() < 0.99 * exact
    assert sorted(wall.radius for wall in mesh.round_walls) == pytest.approx(
        [INNER, OUTER], abs=2e-3
    )
    on_wall = np.unique(mesh.facet_nodes(mesh.boundary[mesh.wall_of >= 0]))
    away = np.linalg.norm(mesh.points[on_wall, :2], axis=1)
    assert np.abs(away[:, None] - [INNER, OUTER]).min(axis=1).max() < 2e-3
    # The rims stay in their planes.
    assert mesh.bounds[:, 2] == pytest.approx([0.0, HEIGHT], abs=1e-12)
    assert mesh.flaw == ""


def test_curved_cells_pass_the_patch_test():
    """Rigid motions without a force, and a linear displacement with its own stress and energy."""
    mesh = tube(3.0)
    assert len(mesh.curved) > 50
    matrix = assemble(mesh, LAW.stiffness)
    scale = float(np.abs(matrix.data).max())
    x, y, z = mesh.points.T
    for motion in (np.ones((len(x), 3)), np.stack([-y, x, 0 * x], 1), np.stack([z, 0 * x, -x], 1)):
        assert np.abs(matrix @ motion.reshape(-1)).max() < 1e-10 * scale * np.abs(motion).max()
    slope = np.array([[0.3, 0.1, -0.2], [0.0, -0.4, 0.2], [0.5, 0.1, 0.2]])
    u = mesh.points @ slope.T
    e = 0.5 * (slope + slope.T)
    strain = np.array([*np.diag(e), 2 * e[1, 2], 2 * e[0, 2], 2 * e[0, 1]])
    energy = mesh.volumes.sum() * strain @ LAW.stiffness @ strain
    assert u.reshape(-1) @ (matrix @ u.reshape(-1)) == pytest.approx(energy, rel=1e-10)
    stress = nodal_stress(mesh, u, LAW.stiffness)
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    exact = lame * np.trace(e) * np.eye(3) + YOUNG / (1 + POISSON) * e
    np.testing.assert_allclose(stress, np.broadcast_to(exact, stress.shape), atol=1e-10 * YOUNG)
    # int B^T s dV of that constant stress is what the matrix gives.
    constant = np.tile(LAW.stiffness @ strain, (len(mesh.cells), 1))
    forces = strain_forces(mesh, constant)
    np.testing.assert_allclose(forces.reshape(-1), matrix @ u.reshape(-1), atol=1e-10 * scale)


def test_loads_on_curved_walls_have_their_totals():
    mesh = tube(3.0)
    problem = Problem(mesh, LAW, (Support("low"),), {}, order=2)
    weight = volume_forces(problem, BodyForce((0.0, 0.0, -2.0))).sum(axis=0)
    volume = np.pi * (OUTER**2 - INNER**2) * HEIGHT
    np.testing.assert_allclose(weight, [0.0, 0.0, -2.0 * volume], rtol=2e-5, atol=1e-9)
    area = 2.0 * np.pi * INNER * HEIGHT
    along = nodal_forces(mesh, Traction("in", (0.0, 0.0, 3.0))).sum(axis=0)
    np.testing.assert_allclose(along, [0.0, 0.0, 3.0 * area], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(
        nodal_forces(mesh, Force("in", (5.0, 0.0, 1.0))).sum(axis=0), [5.0, 0.0, 1.0], atol=1e-9
    )
    # A pressure p on half a bore pushes with p times its diameter and length.
    middles = mesh.points[mesh.patch("in")].mean(axis=1)
    half = mesh.with_patches({"half": mesh.patch("in")[middles[:, 0] > 0.0]})
    push = nodal_forces(half, Pressure("half", 1.5)).sum(axis=0)
    np.testing.assert_allclose(push, [1.5 * 2.0 * INNER * HEIGHT, 0.0, 0.0], rtol=1e-3, atol=1e-9)


def lame_error(mesh: TetMesh) -> float:
    """Largest relative error of the displacement of a tube under inner pressure, plane strain."""
    supports = (
        Support("low", "z"),
        Support("high", "z"),
        PointSupport((INNER, 0.0, 0.0), "y"),
        PointSupport((-INNER, 0.0, 0.0), "y"),
        PointSupport((0.0, INNER, 0.0), "x"),
    )
    problem = Problem(mesh, LAW, supports, {"p": (Pressure("in", 1.0),)}, order=2)
    field = solve(problem)["p"]
    ratio = INNER**2 / (OUTER**2 - INNER**2)
    radius = np.hypot(*mesh.points[:, :2].T)
    exact = (1 + POISSON) / YOUNG * ratio * ((1 - 2 * POISSON) * radius + OUTER**2 / radius)
    radial = np.einsum("ij,ij->i", field.displacement[:, :2], mesh.points[:, :2]) / radius
    return float(np.abs(radial / exact - 1.0).max())


def test_lames_tube_converges_with_the_mesh():
    """With straight sides 1.7 % stay, whatever the mesh: 24 chords a turn are none the rounder."""
    coarse, fine = tube(3.0, 0.5), tube(1.2, 0.5)
    assert lame_error(coarse) < 0.009
    assert lame_error(fine) < 0.0025
    assert lame_error(straight(fine)) > 0.012


def test_sides_that_would_fold_a_cell_stay_straight_and_are_told():
    """A lining so thin that its bore of 12 chords reaches through it."""
    disc = shapely.Point(0, 0)
    ring = disc.buffer(4.1, 3).difference(disc.buffer(4.0, 3))
    lining = extrude(ring, 1.0, 5.0)
    (bore,) = (wall for wall in lining.round_walls if wall.hollow)
    mesh = replace(lining, walls=(bore,)).quadratic()
    assert mesh.flaw == ""
    nodes = mesh.points[mesh.cells]
    assert min(jacobians(nodes, at).min() for at in (*NODES, *CELL_POINTS)) > 0.0
    count, gap = mesh.chords
    assert count >= 12
    # The sagitta of a twelfth of a turn.
    assert gap == pytest.approx(4.0 * (1.0 - np.cos(np.pi / 12.0)), rel=0.02)
    patches = {"low": Plane("z", "min")(mesh), "high": Plane("z", "max")(mesh)}
    loads = {"pull": (Force("high", (0.0, 0.0, 1.0)),)}
    problem = Problem(replace(mesh, patches=patches), LAW, (Support("low"),), loads, order=2)
    assert any("stay straight, up to 0.136 mm off the wall" in x for x in about_problem(problem))
    assert tube(3.0).chords == (0, 0.0)
