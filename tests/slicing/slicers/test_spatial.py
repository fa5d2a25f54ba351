"""Curved slicing: what it makes of parts whose layers are known, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Cylinder, Plane, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Force, GivenStress, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.slicing.guidance import joint_of
from ccfem.slicing.slicers import Planar, Spatial, create


def given(mesh, direction, used=(), loaded=()):
    """Uniaxial tension of 1 MPa along a direction in each cell."""
    unit = direction / np.linalg.norm(direction, axis=1)[:, None]
    stress = unit[:, :, None] * unit[:, None, :]
    return GivenStress(mesh, stress, np.zeros((len(mesh.points), 3, 3)), used, loaded)


@pytest.fixture(scope="module")
def bar():
    """120 x 24 x 24 mm with a hole along z near one end."""
    outline = shapely.box(0.0, 0.0, 120.0, 24.0)
    hole = shapely.Point(12.0, 12.0).buffer(4.0, quad_segs=12)
    mesh = extrude(outline.difference(hole), 24.0, 3.0)
    walls = {
        "left": Cylinder((12.0, 12.0, 0.0), "z", 4.0),
        "x_max": Plane("x", "max"),
    }
    return patches_from_rules(mesh, walls)


def twisted(mesh, turn):
    """Tension along helices about the axis of the bar, and the direction square to their layers."""
    x, y, z = (mesh.points[mesh.corners].mean(axis=1) - [0.0, 12.0, 12.0]).T
    return np.stack([np.ones_like(x), -turn * z, turn * y], axis=1)


def test_helical_tension_gives_layers_that_it_lies_in(bar):
    # 34 degrees of twist over the bar: planes are off by as much as the helix rises.
    stress = given(bar, twisted(bar, 0.005), ("left", "x_max"), ("x_max",))
    found = Spatial(thickness=1.0, lines="all", joint_weight=0.01).slice(stress)
    assert found.quality.angle_mean < 0.5
    assert found.quality.angle_95 < 1.5
    assert found.quality.folded == 0.0
    assert all(layer.flat is None for layer in found.layers)
    # Thickness: their number times the mean is the height that the field spans.
    volume = sum(layer.thickness * layer.areas.sum() for layer in found.layers)
    assert volume == pytest.approx(bar.volumes.sum(), rel=0.02)


def test_volume_of_the_layers_is_that_of_the_part(bar):
    stress = given(bar, twisted(bar, 0.003), ("left", "x_max"), ("x_max",))
    layers = Spatial(count=30, lines="all")(stress, (0.0, 0.0, 1.0), Machine())
    assert len(layers) == 30
    volume = sum(layer.thickness * layer.areas.sum() for layer in layers)
    assert volume == pytest.approx(bar.volumes.sum(), rel=0.01)
    assert [layer.index for layer in layers] == list(range(30))
    assert all((layer.point_normals[:, 2] > 0.0).all() for layer in layers)


def test_plate_comes_out_in_the_flat_layers_of_the_planar_slicer():
    mesh = box_mesh((60.0, 20.0, 4.0), (24, 8, 3))
    problem = Problem(
        mesh,
        isotropic(3500.0, 0.3),
        (Support("x_min"),),
        {"pull": (Force("x_max", (100.0, 0.0, 0.0)),)},
    )
    stress = solve(problem)["pull"]
    layers = Spatial(thickness=0.5)(stress, (0.0, 0.0, 1.0), Machine())
    flat = Planar(count=8).cut(mesh)
    assert len(layers) == len(flat)
    for layer, other in zip(layers, flat, strict=True):
        assert layer.flat is not None
        np.testing.assert_allclose(layer.flat.frame[2], [0.0, 0.0, 1.0], atol=1e-6)
        assert layer.flat.height == pytest.approx(other.flat.height, abs=1e-6)


def test_build_direction_counts_the_layers(bar):
    stress = given(bar, twisted(bar, 0.003), ("left", "x_max"), ("x_max",))
    up = Spatial(count=6, lines="all")(stress, (0.0, 0.0, 1.0), Machine())
    down = Spatial(count=6, lines="all")(stress, (0.0, 0.0, -1.0), Machine())
    for layer, other in zip(up, down[::-1], strict=True):
        assert layer.areas.sum() == pytest.approx(other.areas.sum(), rel=1e-3)
        assert layer.point_normals[:, 2].mean() > 0.5 > -0.5 > other.point_normals[:, 2].mean()


def test_same_twice_and_whatever_the_load(bar):
    tension = twisted(bar, 0.004)
    one = given(bar, tension, ("left", "x_max"), ("x_max",))
    twice = GivenStress(bar, 7.0 * one.stress, one.nodal, one.held_or_loaded, one.loaded)
    slicer = Spatial(count=5, lines="all")
    first, second, third = (slicer(s, (0.0, 0.0, 1.0), Machine()) for s in (one, one, twice))
    for a, b, c in zip(first, second, third, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.triangles, b.triangles)
        np.testing.assert_allclose(a.points, c.points, atol=1e-9)


def test_what_makes_no_sense_is_refused_in_one_line(bar):
    across = np.tile([0.0, 1.0, 0.0], (len(bar.cells), 1))
    stress = given(bar, across, ("left", "x_max"), ("x_max",))
    with pytest.raises(InputError, match="no stress line joins two of the 2 joints"):
        Spatial().slice(stress)
    with pytest.raises(InputError, match="names 'right', which is no joint; the joints are: left"):
        Spatial(directions={"right": [0, 0, 1]}).slice(stress)
    with pytest.raises(InputError, match="do not fit a part"):
        Spatial(thickness=80.0, lines="all").slice(stress)
    with pytest.raises(InputError, match="one of thickness and count; got both"):
        Spatial(thickness=1.0, count=3)
    with pytest.raises(InputError, match=r"spatial\.form must be one of 'axis', 'ring', 'literal'"):
        create("spatial", {"form": "axes"})
    with pytest.raises(InputError, match=r"spatial\.rings must be above 0"):
        Spatial(rings=0)
    nothing = GivenStress(bar, 0.0 * stress.stress, stress.nodal)
    with pytest.raises(InputError, match="the layers have nothing to follow"):
        Spatial(lines="all").slice(nothing)


def test_one_joint_alone_needs_other_lines(bar):
    along = np.tile([1.0, 0.0, 0.0], (len(bar.cells), 1))
    stress = given(bar, along, ("left",))
    with pytest.raises(InputError, match="joins two of the 1 joints"):
        Spatial().slice(stress)
    layers = Spatial(lines="touching", count=4)(stress, (0.0, 0.0, 1.0), Machine())
    assert len(layers) == 4
    assert all(layer.flat is not None for layer in layers)


def rough(mesh, by, seed=0):
    """Move the nodes on the wall of the bar's hole to and from its axis by up to `by`, mm."""
    wall = np.unique(mesh.patches["left"])
    arm = mesh.points[wall] * [1.0, 1.0, 0.0] - [12.0, 12.0, 0.0]
    shift = np.random.default_rng(seed).uniform(-by, by, len(wall))[:, None]
    points = mesh.points.copy()
    points[wall] += shift * arm / np.linalg.norm(arm, axis=1)[:, None]
    return replace(mesh, points=points)


def tilt(stress, weight, **options):
    """Mean angle, degrees, between the layers near the hole and its axis, z."""
    spatial = Spatial(thickness=1.0, lines="all", joint_weight=weight, **options)
    layers = spatial(stress, (0.0, 0.0, 1.0), Machine())
    points = np.concatenate([layer.points for layer in layers])
    normals = np.concatenate([layer.point_normals for layer in layers])
    near = np.hypot(*(points[:, :2] - 12.0).T) < 8.0
    return np.degrees(np.arccos(np.clip(np.abs(normals[near, 2]), 0.0, 1.0))).mean()


@pytest.mark.parametrize("states", [True, False])
def test_layers_near_a_rough_wall_follow_its_joint(bar, states):
    """By the axis of its rule; or of the nearest cylinder, where the rule states none."""
    mesh = rough(bar, 0.6)
    mesh = mesh if states else replace(mesh, axes={})
    assert mesh.flaw == ""
    assert ("left" in mesh.axes) == states
    tension = np.tile([1.0, 0.0, 0.2], (len(mesh.cells), 1))
    stress = given(mesh, tension, ("left", "x_max"), ("x_max",))
    found = [tilt(stress, weight) for weight in (0.01, 1.0, 20.0)]
    # Without the joint layers lie along the tension, 11.3 degrees off.
    assert found[0] == pytest.approx(np.degrees(np.arctan(0.2)), abs=1.0)
    assert found[0] > found[1] > found[2]
    assert found[2] < (1.0 if states else 3.0)
    assert Spatial().remarks(stress) == ()


def test_the_stated_axis_goes_before_that_of_the_wall(bar):
    """And stays with the mesh of quadratic cells; an axis that is asked for goes before both."""
    wall = Cylinder((12.0, 12.0, 0.0), (0.0, 0.1, 1.0), 5.0)
    mesh = patches_from_rules(bar, {"left": wall}).quadratic()
    stated = np.array([0.0, 0.1, 1.0]) / np.hypot(0.1, 1.0)
    np.testing.assert_allclose(joint_of(mesh, "left").direction, stated)
    asked = joint_of(mesh, "left", direction=[1.0, 0.0, 0.0])
    np.testing.assert_allclose(asked.direction, [1.0, 0.0, 0.0])


def test_a_wall_without_an_axis_is_said_to_have_none():
    """Three sides of a block: they go round a corner, not round an axis."""
    mesh = box_mesh((20.0, 20.0, 20.0), (4, 4, 4))
    sides = np.concatenate([mesh.patches[name] for name in ("x_min", "y_min", "z_min")])
    mesh = mesh.with_patches({"corner": sides})
    stress = given(mesh, np.ones((len(mesh.cells), 3)), ("corner", "x_max"), ("x_max",))
    (line,) = Spatial().remarks(stress)
    assert "joint 'corner' has no axis" in line
    assert Spatial(directions={"corner": [0, 0, 1]}).remarks(stress) == ()


def test_a_hole_of_voxels_has_its_axis():
    mesh = box_mesh((14.0, 14.0, 4.0), (14, 14, 4))
    voxel = np.floor(mesh.points[mesh.corners].mean(axis=1)) + 0.5
    mesh = TetMesh(mesh.points, mesh.cells[np.hypot(*(voxel[:, :2] - 7.0).T) > 4.0])
    wall = np.hypot(*(mesh.points[mesh.boundary].mean(axis=1)[:, :2] - 7.0).T) < 6.0
    wall &= np.abs(mesh.facet_areas(mesh.boundary)[1][:, 2]) < 0.1
    joint = joint_of(mesh.with_patches({"hole": mesh.boundary[wall]}), "hole")
    np.testing.assert_allclose(joint.direction, [0.0, 0.0, 1.0], atol=0.02)
    assert joint.radius == pytest.approx(4.0, abs=0.5)
