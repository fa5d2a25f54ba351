"""Published and analytic problems: NAFEMS LE1 and LE10, Cook, Kirsch, Lame, cantilever.

Each is solved on two or three meshes of one family; the band of the finest is what the sequence
leaves open, and the coarser ones must lie farther off. Curved sides are straight in each cell,
which the refinement counts in.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import (
    Bearing,
    EdgeSupport,
    Force,
    Pressure,
    Problem,
    Support,
    Traction,
    solve,
)
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.stress_field import SolveRecord
from ccfem.fem.elasticity.system import System
from ccfem.fem.materials import isotropic


def mapped(divisions, place, order=2):
    """Return the unit cube, divided, with its points at ``place(r, s, t)``."""
    mesh = box_mesh((1.0, 1.0, 1.0), divisions)
    mesh = replace(mesh, points=np.stack(place(*mesh.points.T), axis=1))
    return mesh.quadratic() if order == 2 else mesh


def ellipses(thickness):
    """Map the unit cube to the quarter between the ellipses of NAFEMS LE1 and LE10, in m.

    Grading by the power 1.3 puts smaller cells at the inner ellipse.
    """

    def place(r, s, t):
        r, angle = r**1.3, 0.5 * np.pi * s
        return (2 + 1.25 * r) * np.cos(angle), (1 + 1.75 * r) * np.sin(angle), thickness * t

    return place


def quarter_ring(outer, thickness=0.2):
    """Map the unit cube to the quarter of a ring of inner radius 1, cells of one aspect."""

    def place(r, s, t):
        angle = 0.5 * np.pi * s
        return outer**r * np.cos(angle), outer**r * np.sin(angle), thickness * t

    return place


def solve_held(mesh, material, free, values, forces):
    """Solve with any component of any node held."""
    supports = Held(free, np.where(free, 0.0, values), np.flatnonzero(free.any(axis=1)))
    system = System(Problem(mesh, material, ()), supports, {"case": forces})
    matrix = system.assemble()
    solution = system.factorise(matrix).solve(supports.right_hand_side(matrix, forces))
    record = SolveRecord("", solution.iterations, solution.residual, 0.0, 0.0, 0)
    return system.field("case", supports.expand(solution.values), matrix, record)


def nodes_of(mesh, patch):
    return np.unique(mesh.facet_nodes(mesh.patch(patch)))


def at(mesh, point):
    """Return the node at a point."""
    distance = np.linalg.norm(mesh.points - point, axis=1)
    assert distance.min() < 1e-9
    return distance.argmin()


def le1(divisions):
    """Stress s_yy at D = (2, 0) of the elliptic membrane, outward pressure 10 MPa outside."""
    mesh = mapped(divisions, ellipses(0.1))
    supports = (Support("y_min", "y"), Support("y_max", "x"), Support("z_min", "z"))
    problem = Problem(mesh, isotropic(210e3, 0.3), supports, {"out": (Pressure("x_max", -10.0),)})
    line = [at(mesh, [2.0, 0.0, z]) for z in (0.0, 0.05, 0.1)]
    return solve(problem)["out"].nodal[line, 1, 1].mean()


def test_nafems_le1():
    # NAFEMS, The Standard NAFEMS Benchmarks (1990), LE1: 92.7 MPa. The sequence 91.9, 92.8, 93.1
    # closes in to within 0.5 %.
    coarse, fine = le1((6, 9, 1)), le1((12, 24, 1))
    assert fine == pytest.approx(92.7, rel=0.01)
    assert abs(fine - 92.7) < abs(coarse - 92.7)


def le10(divisions):
    """Stress s_yy at D = (2, 0, 0.6) of the thick plate under 1 MPa on top."""
    mesh = mapped(divisions, ellipses(0.6))
    outside = mesh.patch("x_max")
    lower = mesh.points[outside, 2].mean(axis=1) < 0.3
    mesh = mesh.with_patches({"lower": outside[lower], "upper": outside[~lower]})
    supports = (
        Support("y_min", "y"),
        Support("y_max", "x"),
        Support("x_max", "xy"),
        EdgeSupport(("lower", "upper"), "z"),
    )
    problem = Problem(mesh, isotropic(210e3, 0.3), supports, {"top": (Pressure("z_max", 1.0),)})
    return solve(problem)["top"].nodal[at(mesh, [2.0, 0.0, 0.6]), 1, 1]


def test_nafems_le10():
    # NAFEMS, The Standard NAFEMS Benchmarks (1990), LE10: -5.38 MPa. The sequence -5.29, -5.44,
    # -5.50 and, finer than here, -5.47, -5.46 settles 1.5 % beyond the target; commercial
    # quadratic tetrahedra miss it by up to 7 %.
    assert le10((12, 18, 4)) == pytest.approx(-5.38, rel=0.025)


def cook(count, plane_strain):
    """Vertical displacement of Cook's membrane at the upper corner and the middle of its end."""
    corners = np.array([[0.0, 0.0], [48.0, 44.0], [48.0, 60.0], [0.0, 44.0]])

    def place(r, s, t):
        weights = np.stack([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s], axis=1)
        return *(weights @ corners).T, t

    mesh = mapped((count, count, 1), place)
    supports = (Support("x_min", "xy"), Support("z_min", "z"))
    supports += (Support("z_max", "z"),) if plane_strain else ()
    loads = {"shear": (Traction("x_max", (0.0, 6.25, 0.0)),)}
    field = solve(Problem(mesh, isotropic(70.0, 1.0 / 3.0), supports, loads))["shear"]
    return field.displacement[[at(mesh, [48.0, 60.0, 0.0]), at(mesh, [48.0, 52.0, 0.0])], 1]


def test_cook_membrane_in_plane_strain():
    # Published 32.2 to 32.3 mm at the upper corner. The corner at (0, 44) is singular and slows
    # the convergence to a bit above first order: extrapolate (Aitken) from three meshes.
    one, two, three = (cook(count, True)[0] for count in (6, 12, 24))
    assert one < two < three < 32.3
    limit = three + (three - two) ** 2 / ((two - one) - (three - two))
    assert limit == pytest.approx(32.25, rel=0.003)


def test_cook_membrane_in_plane_stress():
    # Published 23.96 for E = 1 and a total shear of 1 in the middle of the end, plane stress; the
    # sequence 33.46, 34.08, 34.18 (32 divisions: 34.22) approaches 23.96 * 100 / 70 = 34.23.
    assert cook(16, False)[1] == pytest.approx(23.96 * 100.0 / 70.0, rel=0.003)


def kirsch(divisions, outer=4.0):
    """Stress at the top and the side of a hole of radius 1 in an infinite plate, pulled by 1.

    The exact displacement in plane strain is held on the circle of radius `outer`, so that no
    finite width has to be corrected for.
    """
    young, nu = 1000.0, 0.3
    mesh = mapped(divisions, quarter_ring(outer))
    x, y, _ = mesh.points.T
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    c, s, c3, s3 = np.cos(angle), np.sin(angle), np.cos(3 * angle), np.sin(3 * angle)
    k, shear = 3 - 4 * nu, young / (2 + 2 * nu)
    ux = r * (k + 1) * c + 2 / r * ((1 + k) * c + c3) - 2 / r**3 * c3
    uy = r * (k - 3) * s + 2 / r * ((1 - k) * s + s3) - 2 / r**3 * s3
    exact = np.stack([ux, uy, 0 * r], axis=1) / (8 * shear)
    free = np.ones(mesh.points.shape, dtype=bool)
    free[:, 2] = False
    free[nodes_of(mesh, "y_min"), 1] = False
    free[nodes_of(mesh, "y_max"), 0] = False
    free[nodes_of(mesh, "x_max")] = False
    field = solve_held(mesh, isotropic(young, nu), free, exact, np.zeros(exact.shape))
    line = [[at(mesh, [*point, z]) for z in (0.0, 0.1, 0.2)] for point in ((0, 1), (1, 0))]
    top, side = field.nodal[line[0], 0, 0].mean(), field.nodal[line[1], 1, 1].mean()
    error = np.abs(field.displacement - exact).max() / np.abs(exact).max()
    return np.array([top, side, error])


def test_kirsch_hole():
    # Kirsch (1898): 3 at the top, -1 at the side. Errors with 6, 12 and 18 cells from the hole out:
    # 0.016, 0.005, 0.002 at the top; 0.110, 0.032, 0.015 at the side.
    exact = np.array([3.0, -1.0, 0.0])
    coarse, fine = (np.abs(kirsch(n) - exact) for n in ((6, 8, 1), (18, 24, 1)))
    assert (fine < 0.2 * coarse).all()
    assert (fine < [0.003, 0.018, 0.0002]).all()


def lame(divisions):
    """Errors of a thick tube of radii 1 and 2 in plane strain under an inner pressure 1."""
    young, nu = 1000.0, 0.3
    mesh = mapped(divisions, quarter_ring(2.0))
    supports = (Support("y_min", "y"), Support("y_max", "x"))
    supports += (Support("z_min", "z"), Support("z_max", "z"))
    problem = Problem(mesh, isotropic(young, nu), supports, {"in": (Pressure("x_min", 1.0),)})
    field = solve(problem)["in"]
    corner = np.arange(len(mesh.points)) < np.prod([n + 1 for n in divisions])
    r = np.hypot(mesh.points[:, 0], mesh.points[:, 1])
    across = np.stack([-mesh.points[:, 1], mesh.points[:, 0], 0 * r], axis=1) / r[:, None]
    radial = np.einsum("ij,ij->i", field.displacement[:, :2], mesh.points[:, :2]) / r
    hoop = np.einsum("ni,nij,nj->n", across, field.nodal, across)
    # u = (1 + nu) / E / (b^2 - a^2) (a^2 (1 - 2 nu) r + a^2 b^2 / r); s = (1 + b^2 / r^2) / 3
    u = (1 + nu) / young / 3.0 * ((1 - 2 * nu) * r + 4.0 / r)
    s = (1.0 + 4.0 / r**2) / 3.0
    return np.array([np.abs(radial / u - 1.0)[corner].max(), np.abs(hoop / s - 1.0)[corner].max()])


def test_lame_tube():
    coarse, fine = lame((4, 8, 1)), lame((8, 16, 1))
    assert (fine < 0.65 * coarse).all()
    assert (fine < [0.002, 0.03]).all()


@pytest.mark.parametrize(("poisson", "band"), [(0.0, 0.001), (0.3, 0.01)])
def test_cantilever(poisson, band):
    # P L^3 / 3 E I + P L / (k G A) with Cowper's (1966) k = 10 (1 + nu) / (12 + 11 nu). A clamped
    # end that cannot contract stiffens the beam by 0.8 % where nu is 0.3.
    length, side, young = 100.0, 10.0, 1000.0
    mesh = box_mesh((length, side, side), (40, 4, 4)).quadratic()
    loads = {"tip": (Force("x_max", (0.0, 0.0, -1.0)),)}
    problem = Problem(mesh, isotropic(young, poisson), (Support("x_min"),), loads)
    tip = -solve(problem)["tip"].displacement[at(mesh, [length, 0.5 * side, 0.5 * side]), 2]
    k = 10 * (1 + poisson) / (12 + 11 * poisson)
    inertia, shear = side**4 / 12, young / (2 + 2 * poisson)
    exact = length**3 / (3 * young * inertia) + length / (k * shear * side**2)
    assert tip == pytest.approx(exact, rel=band)


@pytest.mark.skipif("CCFEM_CHEN2021" not in os.environ, reason="the authors' meshes are not here")
@pytest.mark.parametrize(("order", "largest"), [(1, 0.75734475524), (2, 0.78333604931)])
def test_loop_of_chen_2021(order, largest):
    # Regression of the specification; benchmarks/speed/elasticity.py solves it with scikit-fem too.
    from ccfem.body.files import read_mesh

    mesh = read_mesh(Path(os.environ["CCFEM_CHEN2021"]) / "Loop" / "Loop.tet")
    mesh = mesh if order == 1 else mesh.quadratic()
    z = mesh.points[:, 2]
    low, high = z.min(), z.max()
    free = np.repeat((z > low + 0.03 * (high - low))[:, None], 3, axis=1)
    pulled = z >= high - 0.03 * (high - low)
    forces = np.zeros(mesh.points.shape)
    forces[pulled, 0] = 100.0 / pulled.sum()
    field = solve_held(mesh, isotropic(3500.0, 0.35), free, np.zeros(forces.shape), forces)
    size = np.linalg.norm(field.displacement, axis=1).max()
    assert size == pytest.approx(largest, rel=1e-7)
    np.testing.assert_allclose(field.reactions.sum(axis=0), [-100.0, 0.0, 0.0], atol=1e-4)


@pytest.mark.parametrize("kind", [Force, Bearing])
def test_a_loaded_hole_moves_the_way_it_is_pushed(kind):
    # A pin in the hole of a quarter plate presses outward: by Clapeyron the loads do work.
    mesh = mapped((4, 6, 1), quarter_ring(4.0))
    supports = (Support("x_max"),)
    problem = Problem(mesh, isotropic(1e3, 0.3), supports, {"pin": (kind("x_min", (1, 1, 0)),)})
    field = solve(problem)["pin"]
    work = np.vdot(nodal_forces(mesh, problem.loads["pin"][0]), field.displacement)
    assert work == pytest.approx(2.0 * field.strain_energy, rel=1e-6)
    assert (field.displacement[nodes_of(mesh, "x_min"), :2].sum(axis=1) > 0.0).all()
