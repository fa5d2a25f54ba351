"""Laws of strategies on curved layers, and of the slicer that makes them.

The part is a link with two holes, bent about y; its layer is cut from the bent mesh.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.planning import plan
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.slicers import Spatial
from ccfem.strategies import create, named

MACHINE = Machine()
WIDE = Machine(fibre_width=1.6)
"""Of strategies that take long to plan: where fibre is wide there are fewer strands."""
RADIUS = 40.0
CURVED = [name for name in sorted(named()) if not getattr(named()[name], "flat_layers_only", False)]
QUICK = {
    "pruned": {"of": "concentric"},
    "stream_function": {"evaluations": 5, "phases": 1, "inset": 0.6},  # no plain plans instead
}
OFF = {"pruned": 0.006, "stream_function": 0.006}
"""Distance from the layer, mm, of strategies that plan the whole part: they step once more, in
space, within 0.005 fibre widths of chords of half a millimetre, which lie R - sqrt(R^2 - 0.25^2) =
0.001 mm inside. Others step in the chart."""
FREE = ["concentric", "offset", "streamline", "winding"]
"""Strategies that have no direction of their own: a chart may lie in its plane in any way. Ends of
`isocurve` move by up to 0.8 mm where the same chart lies turned by so much, and one of `stripes` by
0.24 mm; they are left out."""


def machine_of(name):
    return WIDE if name in ("stream_function", "stripes") else MACHINE


def turn():
    """A rotation about no axis of the mesh."""
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(0.7) * k + (1.0 - np.cos(0.7)) * k @ k


@cache
def part(load=1.0, turned=False):
    """Stress and one layer of the link, pulled at one hole, and where the layer was cut."""
    outline = shapely.box(0.0, 0.0, 80.0, 30.0)
    for x in (18.0, 60.0):
        outline = outline.difference(shapely.Point(x, 14.0).buffer(5.0, quad_segs=12))
    rules = {
        "held": Cylinder((18.0, 14.0, 0.0), "z", 5.0),
        "pulled": Cylinder((60.0, 14.0, 0.0), "z", 5.0),
    }
    mesh = patches_from_rules(extrude(outline, 4.0, 3.0), rules)
    height = mesh.points[:, 2]
    angle = (mesh.points[:, 0] - 40.0) / RADIUS
    out = RADIUS + height - 2.0
    bent = np.column_stack([out * np.sin(angle), mesh.points[:, 1], out * np.cos(angle)])
    rotation = turn() if turned else np.eye(3)
    found = level_surfaces(replace(mesh, points=bent), height, np.array([2.2]), 0.5, 0.6, 5.0)
    # The same triangles, turned: cleaning collapses edges in an order that rounding decides.
    layers = tuple(replace(layer, points=layer.points @ rotation.T) for layer in found.layers)
    # Bent, the bores lean; and its cells are straight, for which the bounds below were measured.
    mesh = replace(mesh, points=bent @ rotation.T, axes={}, walls=())
    pull = load * rotation @ [300.0, 60.0, -150.0]
    loads = {"pull": (Force("pulled", tuple(pull)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("held"),), loads)
    return solve(problem, tolerance=1e-11)["pull"], layers


@cache
def paths_of(name):
    stress, layers = part()
    return plan(create(name, QUICK.get(name)), layers, stress, machine_of(name))


@pytest.mark.parametrize("name", CURVED)
def test_fibre_lies_on_the_layer_and_is_long_enough(name):
    (layer,), paths = part()[1], paths_of(name)
    assert len(paths) > 0
    found = nearest_on_triangles(layer.points, layer.triangles, paths.points)
    assert found.distance.max() < OFF.get(name, 5e-3)
    np.testing.assert_allclose(np.linalg.norm(paths.normals, axis=1), 1.0)
    assert paths.lengths.min() >= 0.97 * MACHINE.minimum_length
    # From the axis of the bend, as far as the layer is: chords of edges 5 mm long, as the diagonals
    # of the mesh are, lie up to 5^2 / (8 R) = 0.08 mm inside.
    away = np.hypot(paths.points[:, 0], paths.points[:, 2])
    np.testing.assert_allclose(away, RADIUS + 0.2, atol=0.08)


@pytest.mark.parametrize("name", CURVED)
def test_evaluator_accepts_the_paths(name):
    stress, layers = part()
    paths = paths_of(name)
    total = evaluate(paths, layers, stress, machine_of(name)).total
    assert total["fibre_length"] == pytest.approx(paths.lengths.sum())
    assert total["paths"] == len(paths)
    assert total["crossings"] == 0
    assert total["outside_length"] < 0.01 * paths.lengths.sum()


@pytest.mark.parametrize("name", CURVED)
def test_neither_the_load_nor_another_run_changes_the_paths(name):
    """A load of a power of two scales all that is computed without rounding."""
    stress, layers = part(load=2.0**-10)
    again = plan(create(name, QUICK.get(name)), layers, stress, machine_of(name))
    np.testing.assert_array_equal(again.offsets, paths_of(name).offsets)
    np.testing.assert_array_equal(again.points, paths_of(name).points)


@pytest.mark.parametrize("name", FREE)
def test_paths_turn_with_the_part(name):
    stress, layers = part(turned=True)
    turned = plan(create(name), layers, stress, MACHINE)
    paths = paths_of(name)
    assert len(turned) == len(paths)
    assert turned.lengths.sum() == pytest.approx(paths.lengths.sum(), rel=2e-3)
    lines = [shapely.LineString(line) for line in plane_of(paths, part()[1][0])]
    back = replace(turned, points=turned.points @ turn())
    together = shapely.union_all(lines)
    for line in plane_of(back, part()[1][0]):
        away = shapely.distance(shapely.points(line[::5]), together)
        assert away.max() < 0.05


def plane_of(paths, layer):
    """Paths in the chart of a layer."""
    flat = chart_of(layer).flattened(paths)
    return [line[:, :2] for line in flat]


@pytest.mark.parametrize(("joints", "farthest"), [(0.0, 0.2), (1.0, 0.5)])
def test_curved_slicing_turns_with_the_part(joints, farthest):
    """Same number of layers, each where it was; between bores that lean against each other, mostly.

    The bores of the bent link lean by 30 degrees to either side: layers square to both are steep.
    """
    stress, _ = part()
    other, _ = part(turned=True)
    slicer = Spatial(thickness=1.0, joint_weight=joints)
    build = np.array([0.0, 0.0, 1.0])
    first = slicer(stress, tuple(build), MACHINE)
    second = slicer(other, tuple(turn() @ build), MACHINE)
    assert len(first) == len(second) >= 3
    for one, two in zip(first, second, strict=True):
        # The first and the last layer, of 70 mm^2, end at a slope: a cell more or less is 1 mm^2.
        assert two.areas.sum() == pytest.approx(one.areas.sum(), rel=0.01, abs=1.0)
        back = two.points @ turn()
        away = nearest_on_triangles(one.points, one.triangles, back).distance
        # Rounding decides in which order cleaning collapses edges, and on which side of a corner a
        # stress line passes: within a fifth of the thickness, and mostly half of that.
        assert np.quantile(away, 0.5) < 0.1
        assert np.quantile(away, 0.99) < farthest
        assert np.einsum("d,td,t->", build, one.normals, one.areas) > 0.0
