"""Supports of every kind, each beside its analytic solution."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, PointForce, Pressure, Problem, Support, Traction, solve
from ccfem.fem.elasticity.load_kinds import Displacement
from ccfem.fem.elasticity.support_kinds import (
    EdgeSupport,
    Foundation,
    Pin,
    PointSpring,
    PointSupport,
    RigidPatch,
    SlidingSupport,
    Spring,
)
from ccfem.fem.materials import isotropic

YOUNG = 100.0


def box(order, size=(8.0, 3.0, 2.0), divisions=(6, 3, 2)):
    mesh = box_mesh(size, divisions)
    return mesh if order == 1 else mesh.quadratic()


def part(mesh, supports, *loads, poisson=0.0):
    material = isotropic(YOUNG, poisson)
    return Problem(mesh, material, supports, {"case": loads}, order=mesh.order)


def at(mesh, axis, place):
    return np.isclose(mesh.points[:, axis], place)


@pytest.mark.parametrize("order", [1, 2])
def test_a_bar_on_a_spring_moves_by_both_compliances(order):
    mesh = box(order)
    across = (Support("y_min", "y"), Support("z_min", "z"))
    problem = part(mesh, (Spring("x_min", (5.0, 0, 0)), *across), Force("x_max", (3.0, 0, 0)))
    field = solve(problem)["case"]
    for x in (0.0, 8.0):
        moved = field.displacement[at(mesh, 0, x), 0]
        np.testing.assert_allclose(moved, 3.0 / 5.0 + 3.0 * x / (6.0 * YOUNG), rtol=1e-8)
    np.testing.assert_allclose(field.reactions.sum(axis=0), [-3.0, 0, 0], atol=1e-8)
    assert field.strain_energy == pytest.approx(0.5 * 3.0 * moved.mean())


def test_a_stiff_block_on_point_springs_moves_as_a_rigid_body():
    # Three vertical springs under corners, the load off the middle: a statics exercise.
    mesh = box(2)
    corners = ((0.0, 0.0, 0.0), (8.0, 0.0, 0.0), (0.0, 3.0, 0.0))
    springs = tuple(PointSpring(point, (0.0, 0.0, 2.0)) for point in corners)
    slides = (PointSupport((0, 0, 0), "xy"), PointSupport((8, 0, 0), "y"))
    load = PointForce((2.0, 1.5, 2.0), (0.0, 0.0, -4.0))
    problem = replace(part(mesh, (*springs, *slides), load), material=isotropic(1e7, 0.3))
    field = solve(problem)["case"]
    # Moments about the corner: F2 = 4 * 2 / 8, F3 = 4 * 1.5 / 3, F1 the rest.
    for point, force in zip(corners, (1.0, 1.0, 2.0), strict=True):
        node = np.linalg.norm(mesh.points - point, axis=1).argmin()
        assert field.displacement[node, 2] == pytest.approx(-force / 2.0, rel=1e-4)
        assert field.reactions[node, 2] == pytest.approx(force, rel=1e-4)


@pytest.mark.parametrize("order", [1, 2])
def test_a_block_on_a_bed_sinks_and_slides_as_its_layers_do(order):
    mesh = box(order)
    sides = (Support("x_min", "x"), Support("y_min", "y"))
    pressed = part(mesh, (Foundation("z_min", 3.0), *sides), Pressure("z_max", 0.6))
    sunk = solve(pressed)["case"].displacement[at(mesh, 2, 2.0), 2]
    np.testing.assert_allclose(sunk, -0.6 / 3.0 - 0.6 * 2.0 / YOUNG, rtol=1e-8)
    # Pure shear t: u = t / k + t z / G, with the shear on the ends that balances it.
    ends = [Traction("x_max", (0, 0, 0.6)), Traction("x_min", (0, 0, -0.6))]
    ends.append(Traction("z_max", (0.6, 0, 0)))
    bed = Foundation("z_min", 1e6, 3.0)
    sheared = solve(part(mesh, (bed, Support("y_min", "y")), *ends))["case"]
    slid = sheared.displacement[at(mesh, 2, 2.0), 0] - sheared.displacement[at(mesh, 2, 0.0), 0][0]
    np.testing.assert_allclose(slid, 0.6 * 2.0 / (0.5 * YOUNG), rtol=1e-3)
    assert sheared.displacement[at(mesh, 2, 0.0), 0].mean() == pytest.approx(0.2, rel=1e-3)


def test_a_long_beam_on_a_bed_sinks_as_hetenyi_found():
    # Beams on Elastic Foundation, 1946: under P, w = P b / (2 k), b = (k / 4 E I)^(1/4), k per
    # length; three decay lengths to each side stand for an infinite beam (e^-6 = 0.25 %).
    height, bed = 1.0, 0.05
    decay = (bed / (4.0 * YOUNG * height**3 / 12.0)) ** 0.25
    half = 6.0 / decay
    mesh = box(2, (half, 1.0, height), (60, 1, 2))
    supports = (Foundation("z_min", bed), Support("x_min", "x"), Support("y_min", "y"))
    edge = Traction("x_min", (0.0, 0.0, -0.5))  # half of P = 1, by symmetry
    sunk = solve(part(mesh, supports, edge))["case"].displacement[at(mesh, 0, 0.0), 2].mean()
    bent = decay / (2.0 * bed)
    # Timoshenko's shear adds b^2 E I / (k G A) of it.
    shear = decay**2 * YOUNG * height**2 / 12.0 / (5.0 / 6.0 * 0.5 * YOUNG)
    assert -sunk == pytest.approx(bent * (1.0 + shear), rel=0.01)


@pytest.mark.parametrize("order", [1, 2])
def test_oblique_planes_hold_a_turned_bar_as_straight_ones_a_straight(order):
    # Uniaxial stress, exact in both: the ends pulled apart, three planes that slide.
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = box(order)
    mesh = replace(mesh, points=mesh.points @ turn.T)
    names = ("x_min", "y_min", "z_min")
    for given in (True, False):
        slides = tuple(
            SlidingSupport(name, tuple(turn[:, k]) if given else None)
            for k, name in enumerate(names)
        )
        problem = part(mesh, slides, Traction("x_max", tuple(2.0 * turn[:, 0])), poisson=0.3)
        field = solve(problem)["case"]
        local = mesh.points @ turn
        exact = local * np.array([0.02, -0.006, -0.006]) @ turn.T
        np.testing.assert_allclose(field.displacement, exact, atol=1e-10)
        np.testing.assert_allclose(field.reactions.sum(axis=0), -12.0 * turn[:, 0], atol=1e-8)
    # The same by moving the far plane in its load case.
    moved = (*slides, SlidingSupport("x_max"))
    problem = part(mesh, moved, Displacement("x_max", tuple(0.16 * turn[:, 0])), poisson=0.3)
    np.testing.assert_allclose(solve(problem)["case"].displacement, exact, atol=1e-9)


def test_a_tube_slides_in_a_rigid_sleeve():
    # Lame in plane strain with u(b) = 0 and p inside: u = A r + B / r, B = -A b^2.
    inner, outer, nu = 1.0, 2.0, 0.3
    mesh = box_mesh((1.0, 1.0, 1.0), (8, 12, 1))
    r, s, t = mesh.points.T
    radius, angle = inner * (outer / inner) ** r, 0.5 * np.pi * s
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.2 * t], axis=1)
    mesh = replace(mesh, points=points).quadratic()
    walls = (Support("y_min", "y"), Support("y_max", "x"), Support("z_min", "z"))
    supports = (*walls, Support("z_max", "z"), SlidingSupport("x_max"))
    field = solve(part(mesh, supports, Pressure("x_min", 1.0), poisson=nu))["case"]
    mu, lam = YOUNG / (2 + 2 * nu), YOUNG * nu / ((1 + nu) * (1 - 2 * nu))
    # s_r = 2 (mu + lam) A - 2 mu B / r^2 = -1 at r = 1.
    a = -1.0 / (2.0 * (mu + lam) + 2.0 * mu * outer**2)
    rr = np.hypot(*mesh.points[:, :2].T)
    radial = np.einsum("ij,ij->i", field.displacement[:, :2], mesh.points[:, :2]) / rr
    inside = np.isclose(rr, inner)
    assert radial[inside].mean() == pytest.approx(a * (1.0 - outer**2), rel=0.005)


def beam(length=40.0, height=2.0):
    return box(2, (length, 1.0, height), (40, 1, 2))


def mid_load(mesh, length):
    """A line load of 1 N across the middle of the top."""
    return tuple(
        PointForce((0.5 * length, y, 2.0), (0.0, 0.0, -w))
        for y, w in ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6))
    )


def bending(length, height=2.0):
    """P L^3 / 48 E I + P L / (4 k G A), k = 5/6 at nu = 0."""
    area, inertia = height, height**3 / 12.0
    return length**3 / (48.0 * YOUNG * inertia) + length / (4.0 * 5 / 6 * 0.5 * YOUNG * area)


def sag(field, length):
    """Of the middle of the beam's axis."""
    mesh = field.mesh
    middle = at(mesh, 0, 0.5 * length) & at(mesh, 2, 1.0)
    return -field.displacement[middle, 2].mean()


def test_a_beam_on_two_edges_bends_as_a_simple_beam():
    mesh, length = beam(), 40.0
    supports = (
        EdgeSupport(("x_min", "z_min"), "xz"),
        EdgeSupport(("x_max", "z_min"), "z"),
        Support("y_min", "y"),
    )
    field = solve(part(mesh, supports, *mid_load(mesh, length)))["case"]
    assert sag(field, length) == pytest.approx(bending(length), rel=0.02)
    edge = at(mesh, 0, 0.0) & at(mesh, 2, 0.0)
    assert field.reactions[edge, 2].sum() == pytest.approx(0.5)
    assert not field.reactions[at(mesh, 0, 0.0) & ~at(mesh, 2, 0.0), 2].any()


def test_a_beam_on_two_pins_turns_freely():
    mesh, length = beam(), 40.0
    supports = (
        Pin("x_min", (0.0, 0.5, 1.0), (0.0, 3.0, 0.0)),
        Pin("x_max", (length, 0.5, 1.0), (0.0, 1.0, 0.0)),
    )
    field = solve(part(mesh, supports, *mid_load(mesh, length)))["case"]
    assert sag(field, length) == pytest.approx(bending(length), rel=0.01)
    # A pin that turns freely puts no moment about its axis on the part.
    start = at(mesh, 0, 0.0)
    arm = mesh.points[start] - [0.0, 0.5, 1.0]
    assert np.cross(arm, field.reactions[start]).sum(axis=0)[1] == pytest.approx(0.0, abs=1e-7)
    clamped = (RigidPatch("x_min"), RigidPatch("x_max"))
    stiff = solve(part(mesh, clamped, *mid_load(mesh, length)))["case"]
    shear = length / (4.0 * 5 / 6 * 0.5 * YOUNG * 2.0)
    exact = (bending(length) - shear) / 4.0 + shear
    assert sag(stiff, length) == pytest.approx(exact, rel=0.02)


def test_one_pin_alone_lets_the_part_turn():
    mesh = beam()
    problem = part(mesh, (Pin("x_min", (0, 0.5, 1), (0, 1, 0)),), *mid_load(mesh, 40.0))
    with pytest.raises(InputError, match=r"rotate about the axis through \(0, .*, 1\) along y"):
        solve(problem)
    loose = (Pin("x_min", (0, 0.5, 1), (0, 1, 0), slides=True), Support("x_max", "z"))
    with pytest.raises(InputError, match="free to move along y"):
        solve(replace(problem, supports=loose))


def disc_bar(order=2):
    """A round bar of radius 1 and length 6 along x."""
    mesh = box_mesh((6.0, 2.0, 2.0), (12, 8, 8), (0.0, -1.0, -1.0), alternating=True)
    x, y, z = mesh.points.T
    # Squares to circles, so that the section is filled evenly enough.
    largest = np.maximum(np.abs(y), np.abs(z))
    factor = largest / np.maximum(np.hypot(y, z), 1e-12)
    mesh = replace(mesh, points=np.stack([x, y * factor, z * factor], axis=1))
    return mesh.quadratic() if order == 2 else mesh


def test_a_round_bar_between_rigid_plates_twists_by_its_torque():
    # T = G J angle / L; a circle does not warp, so the plates hinder nothing.
    mesh = disc_bar()
    ends = (RigidPatch("x_min"), RigidPatch("x_max", angle=(2.0, 0.0, 0.0)))
    field = solve(part(mesh, ends, poisson=0.25))["case"]
    torque = YOUNG / 2.5 * (0.5 * np.pi) * np.radians(2.0) / 6.0
    start = at(mesh, 0, 0.0)
    moment = np.cross(mesh.points[start], field.reactions[start]).sum(axis=0)
    np.testing.assert_allclose(moment, [-torque, 0.0, 0.0], atol=0.001 * torque)
    assert field.reactions.sum(axis=0) == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("order", [1, 2])
def test_a_loose_rigid_plate_passes_a_moment_on(order):
    # An axial force off the axis bends the bar: the plate turns by M L / E I, moves by F L / E A.
    mesh = box(order, (12.0, 1.0, 2.0), (24, 2, 4))
    plate = RigidPatch("x_max", "", "")
    force = PointForce((12.0, 0.5, 2.0), (3.0, 0.0, 0.0))
    problem = part(mesh, (Support("x_min"), plate), force)
    field = solve(problem)["case"]
    end = at(mesh, 0, 12.0)
    u = field.displacement[end, 0]
    plane = np.column_stack([np.ones(end.sum()), mesh.points[end, 1:] - [0.5, 1.0]])
    (mean, _, slope), *_ = np.linalg.lstsq(plane, u, rcond=None)
    np.testing.assert_allclose(plane @ np.linalg.lstsq(plane, u, rcond=None)[0], u, atol=1e-10)
    assert mean == pytest.approx(3.0 * 12.0 / (2.0 * YOUNG), rel=1e-3)
    turned = 3.0 * 1.0 * 12.0 / (YOUNG * 8.0 / 12.0)
    assert slope == pytest.approx(turned, rel=0.002 if order == 2 else 0.2)
    np.testing.assert_allclose(field.reactions.sum(axis=0), [-3.0, 0, 0], atol=1e-7)


def test_a_rigid_plate_moves_as_a_load_case_says():
    mesh = box(2)
    plate = RigidPatch("x_max", value=(0.1, 0.0, 0.0))
    supports = (Support("x_min", "x"), Support("y_min", "y"), Support("z_min", "z"), plate)
    loads = {"own": (), "more": (Displacement("x_max", (0.2, 0.0, 0.0)),)}
    problem = replace(part(mesh, (Support("x_min"), plate)), loads=loads)
    fields = solve(problem)
    end = at(mesh, 0, 8.0)
    for name, moved in (("own", 0.1), ("more", 0.2)):
        np.testing.assert_allclose(fields[name].displacement[end, 0], moved, atol=1e-12)
        np.testing.assert_allclose(fields[name].stress[:, 0, 0], YOUNG * moved / 8.0, atol=1e-8)
    with pytest.raises(InputError, match="nodes that another support holds as well"):
        solve(replace(problem, supports=supports))


@pytest.mark.parametrize("backend", ["superlu", "amg", "two-level"])
def test_every_backend_solves_ties(backend):
    mesh = box(2, (16.0, 4.0, 4.0), (16, 4, 4))
    slope = SlidingSupport("z_min", (0.0, 0.6, 0.8))
    supports = (slope, Pin("x_min", (0.0, 2.0, 2.0), (0, 1, 0)), RigidPatch("x_max", "", ""))
    problem = part(mesh, supports, Force("x_max", (1.0, 2.0, -3.0)), poisson=0.3)
    with pytest.raises(InputError, match="another support holds as well"):
        solve(problem)
    slope, bed = SlidingSupport("x_min", (0.8, 0.6, 0.0)), Spring("z_min", (9.0, 9.0, 9.0))
    problem = replace(problem, supports=(slope, supports[2], bed))
    exact = solve(problem, "superlu", tolerance=1e-12)["case"].displacement
    field = solve(problem, backend)["case"]
    np.testing.assert_allclose(field.displacement, exact, atol=1e-6 * np.abs(exact).max())
    if backend != "superlu":
        assert field.record.iterations < 60


def test_supports_that_contradict_or_miss_are_refused():
    mesh = box(1)
    cases = [
        ((EdgeSupport(("x_min", "x_max")),), "'x_min' and 'x_max' do not meet"),
        ((PointSupport((400.0, 0.0, 0.0)),), "lies 392 mm from the nearest node"),
        (
            (SlidingSupport("x_min", (0.6, 0.8, 0.0), 0.1), Support("x_min")),
            "contradict each other at node",
        ),
        ((RigidPatch("x_min"), RigidPatch("y_min")), "shares nodes with another rigid patch"),
    ]
    for supports, message in cases:
        with pytest.raises(InputError, match=message):
            solve(part(mesh, supports, Force("x_max", (1.0, 0, 0))))
    with pytest.raises(InputError, match=r"point force at .* lies 490 mm from the nearest node"):
        solve(part(mesh, (Support("x_min"),), PointForce((498.0, 0, 0), (1.0, 0, 0))))
    for make, message in (
        (lambda: Spring("x_min", (0.0, 0.0, 0.0)), "at least 0 N/mm, not all zero"),
        (lambda: Foundation("x_min", -1.0), "at least 0 MPa/mm"),
        (lambda: SlidingSupport("x_min", (0.0, 0.0, 0.0)), "must have a finite length above 0"),
        (lambda: Pin("x_min", (0, 0, 0), (0, 0, 0)), "must have a finite length above 0"),
        (lambda: EdgeSupport(("x_min", "x_min")), "names of two patches that meet"),
        (lambda: RigidPatch("x_min", "xw"), "letters of 'xyz', or empty"),
    ):
        with pytest.raises(InputError, match=message):
            make()


def hinged_row(count):
    """Cubes in a row, each joined to the next along an edge, above and below in turn."""
    points, cells, start = [], [], 0
    for k in range(count):
        cube = box_mesh((1.0, 1.0, 1.0), (1, 1, 1), (float(k), 0.0, 0.0))
        points.append(cube.points)
        cells.append(cube.cells + start)
        start += len(cube.points)
    stacked = np.concatenate(points)
    key = stacked.copy()
    # A millimetre of shift keeps apart the edge that is not joined.
    joint = np.round(stacked[:, 0])
    for k in range(count):
        own = slice(8 * k, 8 * k + 8)
        left = (joint[own] == k) & (stacked[own, 2] != k % 2)
        key[own, 1] += np.where(left, 100.0 + k, 0.0)
    _, first, number = np.unique(key.round(6), axis=0, return_index=True, return_inverse=True)
    return TetMesh(stacked[first], number.reshape(-1)[np.concatenate(cells)])


@pytest.mark.parametrize("count", [5, 800])
def test_a_row_of_hinged_bodies_is_held_when_each_is(count):
    # 800 of them took a minute. The row hangs together at its edges, and folds unless every cube
    # is held: by its lower face in z, and once in x and y.
    mesh = hinged_row(count)
    x, _, z = mesh.points.T
    low = mesh.boundary[(z[mesh.boundary] == 0.0).all(axis=1)]
    left = mesh.boundary[(x[mesh.boundary] == 0.0).all(axis=1)]
    mesh = mesh.with_patches({"low": low, "left": left, "start": low[x[low].max(axis=1) <= 1.0]})
    load = PointForce((0.5, 0.0, 1.0), (0.0, 0.0, -1.0))
    held = (Support("low", "z"), Support("left", "xy"))
    if count == 5:
        assert solve(part(mesh, held, load))["case"].strain_energy > 0.0
    folding = part(mesh, (Support("start"),), load)
    from ccfem.fem.elasticity.supports import held as collect

    assert collect(part(mesh, held, load)).free.any()
    with pytest.raises(InputError, match="free to"):
        collect(folding)
