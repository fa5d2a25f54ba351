"""The guidance field against fields that are known, and its energy against sums written out."""

import itertools

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import cell_gradients
from ccfem.slicing.guidance import Joint, Weights, field_quality, guidance_field, joint_of
from ccfem.slicing.guidance.energies import alignment_energy, gradient_energy, smoothness_energy
from ccfem.slicing.guidance.scalar_guidance import equal_value_energy, slabs

WEIGHTS = Weights(stress=1.0, smoothness=0.01, joints=1.0, length=3.0)


def centres(mesh):
    return mesh.points[mesh.corners].mean(axis=1)


def angles(field, wanted):
    unit = wanted / np.linalg.norm(wanted, axis=1)[:, None]
    cosine = np.einsum("ed,ed->e", field.gradient, unit) / np.linalg.norm(field.gradient, axis=1)
    return np.degrees(np.arccos(np.clip(np.abs(cosine), 0.0, 1.0)))


def smoothness(mesh):
    n = len(mesh.points)
    return smoothness_energy(
        mesh.points, cell_gradients(mesh), mesh.corners, mesh.faces, mesh.across, n
    )


def test_energies_of_a_linear_field_are_those_of_its_gradient(plate):
    vector = np.array([0.3, -1.2, 0.7])
    values, n = plate.points @ vector, len(plate.points)
    gradients, cells = cell_gradients(plate), plate.corners
    rng = np.random.default_rng(0)
    tau, weight = rng.normal(size=(len(cells), 3)), rng.random(len(cells))
    along = alignment_energy(gradients, cells, tau, weight, n)
    assert values @ along @ values == pytest.approx((weight * (tau @ vector) ** 2).sum())
    whole = gradient_energy(gradients, cells, plate.volumes, n)
    assert values @ whole @ values == pytest.approx(plate.volumes.sum() * vector @ vector)
    assert abs(values @ smoothness(plate) @ values) < 1e-10 * plate.volumes.sum()


def test_smoothness_is_the_jump_of_the_gradient_over_every_face(plate):
    values = np.sin(0.2 * plate.points[:, 0]) * plate.points[:, 1] + plate.points[:, 2] ** 2
    g = np.einsum("eid,ei->ed", cell_gradients(plate), values[plate.corners])
    middle, total = centres(plate), 0.0
    for a, b in plate.neighbours:
        shared = np.intersect1d(plate.corners[a], plate.corners[b])
        p, q, r = plate.points[shared]
        area = 0.5 * np.linalg.norm(np.cross(q - p, r - p))
        total += area / np.linalg.norm(middle[a] - middle[b]) * ((g[a] - g[b]) ** 2).sum()
    assert values @ smoothness(plate) @ values == pytest.approx(total, rel=1e-9)


def test_smoothness_hardly_depends_on_the_mesh():
    found = []
    for cells in (8, 16):
        mesh = box_mesh((20.0, 20.0, 20.0), (cells,) * 3)
        values = 0.05 * mesh.points[:, 0] ** 2
        found.append(values @ smoothness(mesh) @ values)
    # Faces at the border have no partner: their share falls with the edge length.
    assert found[1] == pytest.approx(found[0], rel=0.15)


def test_joint_is_the_whole_wall_of_a_hole_that_a_patch_covers_in_part(plate):
    whole, half = joint_of(plate, "right"), joint_of(plate, "half")
    np.testing.assert_array_equal(half.wall, whole.wall)
    np.testing.assert_allclose(half.direction, [0.0, 0.0, 1.0], atol=1e-9)
    assert half.radius == pytest.approx(5.0, rel=1e-3)
    away = np.hypot(*(plate.points[whole.wall, :2] - [45.0, 15.0]).T)
    # Some nodes lie on the chords of the outline's 64 segments.
    np.testing.assert_allclose(away, 5.0, atol=0.007)
    on_wall = np.abs(np.hypot(*(plate.points[:, :2] - [45.0, 15.0]).T) - 5.0) < 0.01
    np.testing.assert_array_equal(whole.wall, np.flatnonzero(on_wall))


def test_region_of_a_joint_grows_by_edges(plate):
    distance = np.hypot(*(plate.points[:, :2] - [15.0, 15.0]).T) - 5.0
    reach = [distance[plate.corners[joint_of(plate, "left", r).region]].max() for r in (1, 2, 4)]
    assert reach[0] < reach[1] < reach[2]
    assert reach[2] < 4 * 3.5


def test_joint_without_a_cylinder_has_no_direction_but_takes_one(plate):
    plane = plate.with_patches(
        {"end": plate.boundary[(plate.points[plate.boundary, 0] == 0).all(1)]}
    )
    assert joint_of(plane, "end").direction is None
    np.testing.assert_allclose(joint_of(plane, "end", direction=[0, 0, 2]).direction, [0, 0, 1])
    with pytest.raises(InputError, match="must be three numbers"):
        joint_of(plane, "end", direction=[0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="no patch named 'ends'; there are: end, half"):
        joint_of(plane, "ends")


def test_plate_pulled_along_itself_gets_planes_across_its_bolts(plate):
    m = len(plate.cells)
    along = np.tile([1.0, 0.0, 0.0], (m, 1))
    joints = [joint_of(plate, "left"), joint_of(plate, "right")]
    field = guidance_field(plate, along, np.ones(m), joints, WEIGHTS)
    height = plate.points[:, 2]
    np.testing.assert_allclose(field.values - field.values[0], height - height[0], atol=1e-6)
    quality = field_quality(field, along, np.ones(m), 0.5, 0.5)
    assert quality.thickness_5 == pytest.approx(0.5) == pytest.approx(quality.thickness_95)
    assert quality.angle_95 < 1e-6
    assert quality.thickness_outside == quality.folded == 0.0


def test_field_finds_curved_layers_that_the_stress_lies_in(plate, square_to):
    # Layers of G = z + x y / 80: a saddle, whose gradient turns by up to 37 degrees.
    x, y, _ = centres(plate).T
    exact = np.stack([y / 80.0, x / 80.0, np.ones_like(x)], axis=1)
    tau = square_to(exact)
    field = guidance_field(plate, tau, np.ones(len(tau)), [], Weights(1.0, 1e-4, 1.0, 3.0))
    assert np.degrees(np.arccos(1.0 / np.linalg.norm(exact, axis=1))).max() > 35.0
    assert angles(field, exact).mean() < 1.0
    assert np.quantile(angles(field, exact), 0.95) < 2.5


def test_turning_the_part_turns_the_field(plate, square_to):
    x, y, _ = centres(plate).T
    tau = square_to(np.stack([y / 80.0, x / 80.0, np.ones_like(x)], axis=1))
    a, b = np.radians([35.0, 20.0])
    turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]]) @ (
        np.array([[1.0, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    )
    turned = type(plate)(plate.points @ turn.T, plate.cells, plate.patches)
    one, other = (
        guidance_field(mesh, t, np.ones(len(t)), [joint_of(mesh, "left")], WEIGHTS, build=up)
        for mesh, t, up in (
            (plate, tau, np.array([0.0, 0.0, 1.0])),
            (turned, tau @ turn.T, turn[:, 2]),
        )
    )
    np.testing.assert_allclose(one.values, other.values, atol=1e-6 * np.ptp(one.values))


def test_signs_have_the_energy_that_a_solve_of_their_own_gives(plate):
    rng = np.random.default_rng(5)
    m, n = len(plate.cells), len(plate.points)
    tau = rng.normal(size=(m, 3)) * [1.0, 1.0, 0.2]
    tau /= np.linalg.norm(tau, axis=1)[:, None]
    omega = rng.random(m)
    left, right = joint_of(plate, "left"), joint_of(plate, "right")
    tilted = Joint("right", right.wall, right.region, np.array([0.6, 0.0, 0.8]), 5.0)
    joints = [left, tilted]
    gradients = cell_gradients(plate)
    base = alignment_energy(gradients, plate.corners, tau, plate.volumes * omega, n)
    base = base + 0.01 * 3.0**2 * smoothness(plate)

    def energy(signs, values):
        g = np.einsum("eid,ei->ed", gradients, values[plate.corners])
        total = values @ base @ values
        for s, joint in zip(signs, joints, strict=True):
            v = plate.volumes[joint.region]
            total += (v * ((g[joint.region] - s * joint.direction) ** 2).sum(axis=1)).sum()
        return total

    best = guidance_field(plate, tau, omega, joints, WEIGHTS)
    constant = sum(plate.volumes[joint.region].sum() for joint in joints)
    for signs in itertools.product((1, -1), repeat=2):
        own = guidance_field(plate, tau, omega, joints, WEIGHTS, signs=signs)
        # The field is scaled to a mean gradient of 1: undo it by the best factor.
        (known,) = own.energies.values()
        factors = np.array([0.2, 0.85, 1.5])  # the energy is quadratic in it
        tried = [energy(own.signs, factor * own.values) for factor in factors]
        a, b, c = np.polyfit(factors, tried, 2)
        assert a > 0.0
        assert 0.2 < -0.5 * b / a < 1.5
        assert c - 0.25 * b**2 / a == pytest.approx(known + constant, rel=1e-4)
    lowest = min(best.energies, key=best.energies.__getitem__)
    assert best.signs in (lowest, tuple(-s for s in lowest))
    assert len(best.energies) == 2


def test_mean_form_of_the_joints_equals_the_sum_written_out(plate):
    nodes = np.unique(plate.corners[joint_of(plate, "left").region])
    group, number = slabs(plate.points, nodes, np.array([0.0, 0.0, 1.0]), 2.0)
    assert number == len(np.unique(group)) == 4  # layers of nodes, 2.67 mm apart
    n = len(plate.points)
    matrix = equal_value_energy(nodes, group, 7.0, n, n + number)
    values = np.random.default_rng(2).normal(size=n)
    means = np.bincount(group, values[nodes]) / np.bincount(group)
    exact = 7.0 / len(nodes) * ((values[nodes] - means[group]) ** 2).sum()
    whole = np.concatenate([values, means])
    assert whole @ matrix @ whole == pytest.approx(exact)


def test_heavy_rings_have_one_value_in_each_slab(plate, square_to):
    x, y, _ = centres(plate).T
    tau = square_to(np.stack([y / 80.0, x / 80.0, np.ones_like(x)], axis=1))
    joints = [joint_of(plate, "left")]
    spread = []
    for weight in (1e-3, 1e3):
        weights = Weights(1.0, 0.01, weight, 3.0)
        field = guidance_field(plate, tau, np.ones(len(tau)), joints, weights, "ring", slab=1.0)
        nodes = np.unique(plate.corners[joints[0].region])
        group, _ = slabs(plate.points, nodes, joints[0].direction, 1.0)
        means = np.bincount(group, field.values[nodes]) / np.bincount(group)
        spread.append(np.std(field.values[nodes] - means[group]))
    assert spread[1] < 0.05 * spread[0]


def test_literal_joint_makes_thick_layers_where_an_axis_makes_even_ones(plate, square_to):
    # Equal value on a whole ring round a bolt leaves no gradient there.
    x, y, _ = centres(plate).T
    tau = square_to(np.stack([y / 80.0, x / 80.0, np.ones_like(x)], axis=1))
    joints, share = [joint_of(plate, "left"), joint_of(plate, "right")], []
    for form in ("axis", "literal"):
        weights = Weights(1.0, 0.01, 0.1, 3.0)
        field = guidance_field(plate, tau, np.ones(len(tau)), joints, weights, form)
        quality = field_quality(field, tau, np.ones(len(tau)), 0.5, 0.5)
        share.append(quality.thickness_95 / quality.thickness_5)
    assert share[0] < 1.3 < share[1]


def test_layers_near_holes_stand_square_to_their_axes(plate, square_to):
    """Stress across a gradient that leans over: without the term the layers at the wall do, too.

    Their thickness hardly changes, as the term leaves the size of the gradient alone.
    """
    x, y, _ = centres(plate).T
    tau = square_to(np.stack([y / 80.0, x / 80.0, np.ones_like(x)], axis=1))
    joints = [joint_of(plate, "left"), joint_of(plate, "right")]
    wall, size = [], []
    away = np.abs(np.hypot(*(centres(plate)[:, :2] - [15.0, 15.0]).T) - 5.0)
    for holes in (0.0, 30.0):
        weights = Weights(1.0, 0.01, 0.1, 3.0, holes=holes, reach=2.0)
        field = guidance_field(plate, tau, np.ones(len(tau)), joints, weights)
        off = angles(field, np.broadcast_to([0.0, 0.0, 1.0], tau.shape))
        wall.append(np.average(off[away < 2.0], weights=plate.volumes[away < 2.0]))
        size.append(np.linalg.norm(field.gradient[away < 2.0], axis=1).mean())
    assert wall[1] < 3.0 < 6.0 < wall[0]
    assert size[1] == pytest.approx(size[0], rel=0.1)


def test_nothing_to_follow_is_refused(plate):
    m = len(plate.cells)
    with pytest.raises(InputError, match="nothing to follow"):
        guidance_field(plate, np.zeros((m, 3)), np.ones(m), [], WEIGHTS)
    joint = joint_of(plate, "left")
    with pytest.raises(InputError, match="signs must be 1 numbers"):
        guidance_field(plate, np.ones((m, 3)), np.ones(m), [joint], WEIGHTS, signs=(1, 1))


def test_many_joints_are_flipped_in_turn():
    from ccfem.slicing.guidance.scalar_guidance import _best_signs, _energies

    rng = np.random.default_rng(8)
    factor = rng.normal(size=(13, 13))
    product = factor @ factor.T
    found = _best_signs(_energies(product, None), np.zeros(len(product)))
    every = itertools.product((1, -1), repeat=12)
    exact = min(-float(np.array((1, *s)) @ product @ np.array((1, *s))) for s in every)
    s = np.array(found, dtype=float)
    assert -float(s @ product @ s) <= 0.9 * exact
