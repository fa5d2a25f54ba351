"""Strength between layers: closed forms of a bar, what does not change it, what is said."""

from dataclasses import replace

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support, Traction
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic, named_material
from ccfem.judging.virtual_testing.failure_laws.interlayer import interlayer, layer_normals
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.slicing.slicers import Planar

SIGMA = 5.0
Z, S = 18.0, 14.0
MATERIAL = isotropic(2000.0, 0.0, tensile_strength=52.0, interlayer_tensile=Z, interlayer_shear=S)


@pytest.fixture(scope="module")
def bar():
    """Even tension along x, exact: held across at one corner facet only."""
    mesh = box_mesh((20.0, 4.0, 4.0), (12, 3, 3))
    mesh = mesh.with_patches({"corner": mesh.patch("x_min")[:1]})
    supports = (Support("x_min", "x"), Support("corner", "yz"))
    load = {"pull": (Force("x_max", (16.0 * SIGMA, 0.0, 0.0)),)}
    return solve(Problem(mesh, MATERIAL, supports, load, order=1))["pull"]


@pytest.fixture(scope="module")
def bent():
    """Cantilever, clamped."""
    problem = Problem(
        box_mesh((20.0, 6.0, 6.0), (13, 4, 4)),
        isotropic(2000.0, 0.3, tensile_strength=52.0, interlayer_tensile=Z, interlayer_shear=S),
        (Support("x_min"),),
        {"bend": (Force("x_max", (0.0, 0.0, 20.0)),)},
        order=1,
    )
    return solve(problem)["bend"]


def tilted(mesh, angle):
    """One flat layer whose normal is turned from x by an angle, degrees, towards y."""
    a = np.radians(angle)
    return Planar(count=1).cut(mesh, (np.cos(a), np.sin(a), 0.0))


def with_fibre(field):
    """Tested with fibre so thin that it does nothing."""
    paths = flat_paths([[[1.0, 2.0, 2.0], [19.0, 2.0, 2.0]]])
    return virtual_test(paths, field, Strand(rho=1e-9), span=())


@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0, 70.0])
def test_a_pulled_bar_opens_and_slides_as_its_layers_lie(bar, angle):
    found = interlayer(bar, tilted(bar.mesh, angle))
    cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    exact = SIGMA * np.hypot(cos**2 / Z, sin * cos / S)
    assert found.index == pytest.approx(exact, rel=1e-9)
    assert found.opening == pytest.approx(SIGMA * cos**2, rel=1e-9)
    assert found.sliding == pytest.approx(SIGMA * sin * cos, rel=1e-8, abs=1e-8)
    assert found.zone_indices == pytest.approx((exact,) * 3, rel=1e-9)
    assert found.note == ""


def test_equal_strengths_fail_at_z_over_the_cosine_or_in_the_matrix(bar):
    """Strengths by angle as in the specification, MPa: min(18 / cos a, 52)."""
    equal = replace(MATERIAL, interlayer_shear=None)
    problem = replace(bar.problem, material=equal)
    test = with_fibre(replace(bar, problem=problem))
    told = [18.0, 18.6, 20.8, 25.5, 36.0, 52.0, 52.0]
    for angle, strength in zip(range(0, 91, 15), told, strict=True):
        failure = first_failure(test, layers=tilted(bar.mesh, angle))
        assert failure.load / 16.0 == pytest.approx(strength, abs=0.06)
        assert failure.what == ("matrix" if angle > 60 else "interlayer")
        if failure.what == "interlayer":
            assert failure.load == failure.interlayer_load == failure.interlayer_zones[0]
            np.testing.assert_array_equal(failure.where, failure.interlayer_where)
    # Along the layers nothing opens and nothing slides.
    assert failure.interlayer_load == np.inf
    assert failure.interlayer_index == 0.0


def test_pressed_layers_hold(bar):
    pressed = replace(bar, stress=-bar.stress)
    assert interlayer(pressed, tilted(bar.mesh, 0.0)).index < 1e-12
    assert interlayer(pressed, tilted(bar.mesh, 0.0)).opening == pytest.approx(-SIGMA)
    # Pressed on a slope they slide all the same: no friction is counted on.
    assert interlayer(pressed, tilted(bar.mesh, 45.0)).index == pytest.approx(0.5 * SIGMA / S)


def test_the_tensor_is_averaged_over_the_ball(bent):
    """Beside brute force; the judged cells are those outside the zone."""
    mesh, radius = bent.mesh, 1.7
    centre = mesh.points[mesh.corners].mean(axis=1)
    up = np.array([0.0, 0.6, 0.8])
    indices = []
    for point in centre[(centre[:, 0] > 3.0) & (centre[:, 0] < 17.0)]:
        near = np.linalg.norm(centre - point, axis=1) <= radius
        mean = np.average(bent.stress[near], axis=0, weights=mesh.volumes[near])
        t_n = up @ mean @ up
        t_s = np.linalg.norm(mean @ up - t_n * up)
        indices.append(np.hypot(max(t_n, 0.0) / Z, t_s / S))
    found = interlayer(bent, Planar(count=1).cut(mesh, tuple(up)), radius=radius)
    assert found.index == pytest.approx(max(indices), rel=1e-12)
    assert found.zone_indices[0] < found.zone_indices[1] <= found.zone_indices[2]


def test_turning_the_part_and_scaling_the_load_change_nothing(bent):
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh, up = bent.mesh, np.array([0.6, 0.0, 0.8])
    turned = replace(mesh, points=mesh.points @ turn.T)
    load = {"bend": (Force("x_max", tuple(3.0 * turn @ [0.0, 0.0, 20.0])),)}
    problem = replace(bent.problem, mesh=turned, loads=load)
    once = interlayer(bent, Planar(count=1).cut(mesh, tuple(up)))
    again = interlayer(solve(problem)["bend"], Planar(count=1).cut(turned, tuple(-turn @ up)))
    assert again.index == pytest.approx(3.0 * once.index, rel=1e-9)
    np.testing.assert_allclose(again.where, turn @ once.where, atol=1e-9)


def test_curved_layers_that_are_flat_judge_as_planes_do(bent):
    up = (0.0, 0.6, 0.8)
    flat = Planar(count=5).cut(bent.mesh, up)
    curved = [replace(layer, flat=None) for layer in flat]
    # Triangles that look up and down: a normal has no sign.
    flipped = []
    for layer in curved:
        triangles = layer.triangles.copy()
        triangles[::2] = triangles[::2, ::-1]
        flipped.append(replace(layer, triangles=triangles))
    expected = interlayer(bent, flat)
    for stack in (curved, flipped, [*flat[:2], *curved[2:]]):
        normal = layer_normals(stack, bent.mesh.points)
        np.testing.assert_allclose(np.abs(normal @ np.array(up)), 1.0, atol=1e-12)
        assert interlayer(bent, stack).index == pytest.approx(expected.index, rel=1e-9)


def test_the_normal_of_a_curved_layer_is_that_of_its_nearest_triangles():
    """Layers on spheres about one point: normals are radial, to the size of the triangles."""
    mesh = box_mesh((4.0, 4.0, 2.0), (8, 8, 4))
    stack = []
    for layer in Planar(count=4).cut(mesh):
        x, y, z = layer.points.T
        bowl = np.stack([x, y, np.sqrt((z + 8.0) ** 2 - (x - 2.0) ** 2 - (y - 2.0) ** 2)], axis=1)
        stack.append(replace(layer, flat=None, points=bowl))
    middle = stack[1].points[stack[1].triangles].mean(axis=1)
    radial = middle - [2.0, 2.0, 0.0]
    cosine = np.abs(np.einsum("ki,ki->k", layer_normals(stack, middle), radial))
    angle = np.degrees(np.arccos(np.clip(cosine / np.linalg.norm(radial, axis=1), 0.0, 1.0)))
    assert angle.max() < 3.0


def test_linear_and_quadratic_cells_agree_within_five_per_cent():
    # A tapered bar that is pulled: stress changes smoothly along it.
    mesh = box_mesh((30.0, 8.0, 6.0), (20, 5, 4))
    narrow = mesh.points.copy()
    waist = 1.0 - 0.5 * np.sin(np.pi * mesh.points[:, 0] / 30.0)
    narrow[:, 1] = 4.0 + (mesh.points[:, 1] - 4.0) * waist
    material = isotropic(2000.0, 0.3, interlayer_tensile=Z, interlayer_shear=S)
    problem = Problem(
        replace(mesh, points=narrow),
        material,
        (Support("x_min"),),
        {"pull": (Traction("x_max", (1.0, 0.0, 0.0)),)},
    )
    indices = []
    for order in (1, 2):
        field = solve(replace(problem, order=order))["pull"]
        found = interlayer(field, Planar(count=1).cut(field.mesh, (1.0, 0.0, 0.0)))
        assert found.note == ""
        indices.append(found.index)
    assert indices[0] == pytest.approx(indices[1], rel=0.05)


def test_a_ball_smaller_than_the_cells_is_said(bar):
    found = interlayer(bar, tilted(bar.mesh, 0.0), radius=1.0)
    assert "averaged over 1 mm, less than the mean edge of the cells of" in found.note


def test_what_is_not_judged_leaves_the_rest_as_it_is(bar):
    test = with_fibre(bar)
    layers = tilted(bar.mesh, 0.0)
    without = vars(first_failure(test))
    unknown = replace(
        bar.problem, material=replace(MATERIAL, interlayer_tensile=None, interlayer_shear=None)
    )
    silent = vars(first_failure(with_fibre(replace(bar, problem=unknown)), layers=layers))
    note = silent.pop("note")
    assert note.startswith("bond between layers not judged: material 'isotropic' has no strength")
    assert without.pop("note") == "bond between layers not judged: no layers were given"
    judged = vars(first_failure(test, layers=layers))
    loads = judged.pop("loads")
    assert loads == {**without.pop("loads"), "interlayer": judged["interlayer_load"]}
    assert silent.pop("loads") == {name: loads[name] for name in ("fibre", "matrix")}
    for name, value in without.items():
        np.testing.assert_array_equal(silent[name], value, err_msg=name)
        if not name.startswith("interlayer") and name not in (
            "load",
            "what",
            "where",
            "opening",
            "sliding",
        ):
            np.testing.assert_array_equal(judged[name], value, err_msg=name)
    assert (without["what"], judged["what"]) == ("matrix", "interlayer")
    assert without["interlayer_load"] == np.inf


def test_bad_input_is_refused(bar):
    with pytest.raises(InputError, match="layers needs layers; got none"):
        interlayer(bar, [])
    with pytest.raises(InputError, match="interlayer_shear needs interlayer_tensile"):
        isotropic(2000.0, 0.3, interlayer_shear=3.0)
    with pytest.raises(InputError, match="interlayer_tensile must be above 0 MPa"):
        isotropic(2000.0, 0.3, interlayer_tensile=-3.0)
    tiny = box_mesh((3.0, 4.0, 4.0), (3, 3, 3))
    problem = replace(bar.problem, mesh=tiny.with_patches({"corner": tiny.patch("x_min")[:1]}))
    with pytest.raises(InputError, match="the bond between layers cannot be judged"):
        interlayer(solve(problem)["pull"], tilted(tiny, 0.0))


def test_materials_of_the_table_have_the_strengths_of_their_sources():
    strengths = {"pla": (18.0, 18.0), "pla_plus": (18.0, 14.43), "onyx": (13.0, 13.0)}
    for name, expected in strengths.items():
        material = named_material(name)
        assert (material.interlayer_tensile, material.interlayer_shear) == expected
        assert "between layers" in material.source
    for name in ("pa6", "nylon_w"):
        assert named_material(name).interlayer_tensile is None
