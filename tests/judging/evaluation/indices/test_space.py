"""Indices in space, on layers for which they are known: a straight bar, and a helix."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import GivenStress
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar

MESH = box_mesh((60.0, 20.0, 2.0), (60, 20, 1))
RADIUS = 25.0


def stress_of(tensors):
    return GivenStress(MESH, tensors[MESH.cells].mean(axis=1), tensors, ("x_max", "x_min"))


def uniform(tensor):
    return stress_of(np.broadcast_to(np.array(tensor), (len(MESH.points), 3, 3)).copy())


def curved():
    """The layer at mid-height rolled up about y, 0.5 mm thick at one end and 1 mm at the other."""
    flat = Planar(heights=(1.0,)).cut(MESH)[0]
    x, y, _ = flat.points.T
    angle = (x - 30.0) / RADIUS
    points = np.column_stack([RADIUS * np.sin(angle), y, RADIUS * np.cos(angle)])
    return replace(flat, points=points, flat=None, local_thickness=0.5 + 0.5 * x / 60.0)


def helix(rise):
    """A curve on the cylinder that rises by so much a radian, and its normals."""
    angle = np.linspace(-1.0, 1.0, 400)
    normal = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
    line = RADIUS * normal
    line[:, 1] = 10.0 + rise * angle
    return line, normal


def hoop():
    """Tension of 5 MPa round the cylinder."""
    angle = (MESH.points[:, 0] - 30.0) / RADIUS
    along = np.column_stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)])
    return stress_of(5.0 * along[:, :, None] * along[:, None, :])


def test_a_helix_is_straight_in_the_surface_and_bends_in_space():
    rise, layer = 8.0, curved()
    line, normal = helix(rise)
    paths = Toolpaths.in_space([line], [normal], layer)
    total = evaluate(paths, [layer], hoop(), Machine()).total
    length = 2.0 * np.hypot(RADIUS, rise)
    assert total["fibre_length"] == pytest.approx(length, rel=1e-4)
    # cos^2(pitch) / R in space, nothing in the surface.
    assert total["space_curvature_95"] == pytest.approx(RADIUS / (RADIUS**2 + rise**2), rel=0.02)
    assert total["curvature_95"] < 0.005
    pitch = np.degrees(np.arctan2(rise, RADIUS))
    assert total["space_angle_mean"] == pytest.approx(pitch, abs=0.3)
    assert total["angle_mean"] == pytest.approx(pitch, abs=0.3)
    assert total["space_aligned_20"] == pytest.approx(1.0)
    assert total["space_aligned_10"] == 0.0
    assert total["outside_length"] == 0.0
    assert total["efficiency"] == pytest.approx(np.cos(np.radians(pitch)) ** 2, abs=0.01)


def test_thickness_and_coverage_of_a_curved_layer():
    layer = curved()
    line, normal = helix(0.0)
    lines = [line + np.array([0.0, shift, 0.0]) for shift in (-3.0, 3.0)]
    paths = Toolpaths.in_space(lines, [normal, normal], layer)
    total = evaluate(paths, [layer], hoop(), Machine(fibre_width=2.0)).total
    assert total["thickness_5"] == pytest.approx(0.525, abs=0.01)
    assert total["thickness_95"] == pytest.approx(0.975, abs=0.01)
    # Two strands 50 mm long and 2 mm wide with round ends, on 60 x 20 mm.
    assert total["coverage"] == pytest.approx((2.0 * 50.0 * 2.0 + 2.0 * np.pi) / 1200.0, rel=0.01)
    assert total["spacing_50"] == pytest.approx(6.0, abs=0.02)


def test_tension_across_the_layers_is_what_acts_along_their_normal():
    layer = Planar(heights=(1.0,)).cut(MESH)[0]
    line = [np.array([[5.0, 10.0], [55.0, 10.0]])]
    paths = Toolpaths.from_plane(line, layer)
    tensor = np.diag([3.0, 0.0, 4.0])
    total = evaluate(paths, [layer], uniform(tensor), Machine()).total
    assert total["across_tension"] == pytest.approx(1.0)
    assert total["space_angle_mean"] == pytest.approx(90.0)
    assert total["angle_mean"] == pytest.approx(0.0, abs=1e-6)
    total = evaluate(paths, [layer], uniform(np.diag([3.0, 0.0, 1.0])), Machine()).total
    assert total["across_tension"] == pytest.approx(1.0 / 3.0)
    assert total["space_angle_mean"] == pytest.approx(0.0, abs=1e-6)
    # A turned principal axis, 30 degrees out of the layer.
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    along = np.array([c, 0.0, s])
    total = evaluate(paths, [layer], uniform(2.0 * np.outer(along, along)), Machine()).total
    assert total["space_angle_mean"] == pytest.approx(30.0)
    assert total["across_tension"] == pytest.approx(s**2)


def test_layers_are_compared_with_flat_ones_and_the_best():
    """Tension of 4 along y and of 1 at 30 degrees to the layer's normal: known in closed form."""
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    one, other = np.array([s, 0.0, c]), np.array([c, 0.0, -s])
    tensor = np.diag([0.0, 4.0, 0.0]) + np.outer(one, one) - 2.0 * np.outer(other, other)
    layer = Planar(heights=(1.0,)).cut(MESH)[0]
    paths = Toolpaths.from_plane([np.array([[5.0, 10.0], [55.0, 10.0]])], layer)
    along = (0.0, 1.0, 0.0)
    total = evaluate(paths, [layer], uniform(tensor), Machine(), build=along).total
    assert total["across_tension"] == pytest.approx((c**2 - 2.0 * s**2) / 4.0)
    assert total["across_flat"] == pytest.approx(1.0)
    assert total["across_best"] == 0.0
    # The least principal stress, -2, is 60 degrees off the layer's normal and square to y.
    assert total["least_angle"] == pytest.approx(60.0)
    assert total["least_angle_flat"] == pytest.approx(90.0)
    assert total["least_angle_best"] == pytest.approx(0.0, abs=1e-5)
    pull = uniform(np.diag([3.0, 2.0, 1.0]))
    total = evaluate(paths, [layer], pull, Machine()).total
    assert total["across_flat"] == pytest.approx(1.0 / 3.0)
    assert total["across_best"] == pytest.approx(1.0 / 3.0)


def test_joints_linked_counts_the_patches_that_a_strand_comes_near():
    layer = Planar(heights=(1.0,)).cut(MESH)[0]
    whole = np.array([[5.0, 10.0], [55.0, 10.0]])
    half = np.array([[5.0, 5.0], [30.0, 5.0]])
    stress = uniform(np.diag([1.0, 0.0, 0.0]))
    machine = Machine(fibre_width=1.0)
    one = evaluate(Toolpaths.from_plane([whole], layer), [layer], stress, machine).total
    assert one["joints_linked"] == 2.0
    both = evaluate(Toolpaths.from_plane([whole, half], layer), [layer], stress, machine).total
    # By length: 50 mm link two patches, 25 mm one.
    assert both["joints_linked"] == pytest.approx((50.0 * 2 + 25.0 * 1) / 75.0)
