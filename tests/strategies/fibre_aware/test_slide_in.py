"""Strands that slide off the border, measured by shapely."""

import sys

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.patches import Cylinder, Plane, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.machine.machine import Machine
from ccfem.paths.planning.layer_plans import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.stream_paths import lines_to_slide_in, slid_in
from ccfem.strategies.stream_function import StreamFunction

MACHINE = Machine()
INSET, LENGTH = 0.5 * MACHINE.fibre_width, 60.0


@pytest.fixture(scope="module")
def eye():
    """A plate with a hole, 60 x 20 x 2 mm, pulled at one end."""
    outline = shapely.box(0.0, 0.0, 60.0, 20.0).difference(shapely.Point(26.0, 9.0).buffer(4.0))
    rules = {
        "left": Plane("x", "min"),
        "right": Plane("x", "max"),
        "hole": Cylinder((26, 9, 0), "z", 4),
    }
    mesh = patches_from_rules(extrude(outline, 2.0, 2.0), rules)
    loads = {"pull": (Force("right", (200.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("left"),), loads, order=1)
    return solve(problem)["pull"], Planar(count=2).cut(mesh)


def strings(paths, layer):
    """Paths as geometries in the plane of a layer."""
    index = np.repeat(np.arange(len(paths)), np.diff(paths.offsets))
    return shapely.linestrings(paths.points @ layer.plane.frame[:2].T, indices=index)


def at_depths(section, depths):
    """Straight strands, 50 mm long, along the lower edge of a box at some depths, in widths."""
    left, low, _, _ = shapely.bounds(section)
    along = left + np.linspace(5.0, 55.0, 51)
    width = MACHINE.fibre_width
    return [np.column_stack([along, np.full(51, low + one * width)]) for one in depths]


def depth(lines, section):
    """Least distance of lines inside a section from its border."""
    return shapely.distance(shapely.boundary(section), lines)


def test_a_pack_beside_the_edge_gives_way_by_what_its_first_strand_lacks(bent_beam):
    layer = bent_beam[1][0]
    section = layer.plane.polygon
    paths = Toolpaths.from_plane(at_depths(section, (0.42, 1.42, 2.42, 3.42, 12.0)), layer)
    found = strings(slid_in(paths, layer, MACHINE, 0.5), layer)
    np.testing.assert_allclose(depth(found, section)[:4], np.arange(0.5, 4.0), atol=0.02)
    assert shapely.get_coordinates(found[4])[:, 1].min() == pytest.approx(
        shapely.bounds(section)[1] + 12.0, abs=1e-6
    )
    np.testing.assert_allclose(shapely.distance(found[:3], found[1:4]), 1.0, atol=0.02)
    np.testing.assert_allclose(shapely.length(found), 50.0, atol=0.01)


def test_what_keeps_its_distance_stays(bent_beam):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane(at_depths(layer.plane.polygon, (0.51, 1.52)), layer)
    found = strings(slid_in(paths, layer, MACHINE, 0.5), layer)
    away = shapely.hausdorff_distance(found, strings(paths, layer))
    np.testing.assert_allclose(away, 0.0, atol=1e-6)


@pytest.mark.parametrize("inset", [0.0, 0.5])
def test_strands_slide_apart_away_from_the_border_too(bent_beam, inset):
    layer = bent_beam[1][0]
    paths = Toolpaths.from_plane(at_depths(layer.plane.polygon, (9.0, 9.95, 10.9)), layer)
    found = strings(slid_in(paths, layer, MACHINE, inset), layer)
    np.testing.assert_allclose(shapely.distance(found[:2], found[1:]), 1.0, atol=0.01)


def test_strands_go_round_a_hole_that_they_touch(eye):
    layer = eye[1][0]
    section = layer.plane.polygon
    (ring,) = section.interiors
    x, y = shapely.get_coordinates(shapely.centroid(ring))[0]
    top = shapely.bounds(ring)[3] - y
    along = np.linspace(-25.0, 25.0, 101)
    # An arc that comes as near as 0.4 widths to the hole, and two strands above it.
    lines = [
        np.column_stack([x + along, y + top + above - along**2 / 60.0]) for above in (0.4, 1.4, 2.4)
    ]
    found = strings(slid_in(Toolpaths.from_plane(lines, layer), layer, MACHINE, 0.5), layer)
    assert shapely.distance(found[0], ring) >= 0.49
    assert (shapely.distance(found[:2], found[1:]) >= 0.97).all()


def test_ends_are_cut_at_the_inset_and_grazing_strands_are_kept(bent_beam):
    section = bent_beam[1][0].plane.polygon
    left, low, _, high = shapely.bounds(section)
    across = np.array([[left + 20.0, low], [left + 20.0, high]])
    (kept,) = lines_to_slide_in([across], section, INSET)
    np.testing.assert_allclose(np.sort(kept[:, 1]), [low + INSET, high - INSET])
    graze, out = at_depths(section, (0.45, 0.35))
    np.testing.assert_array_equal(lines_to_slide_in([graze], section, INSET)[0], graze)
    assert not lines_to_slide_in([out], section, INSET)


def test_strands_and_links_of_a_plan_keep_half_a_width_off_the_border(eye, monkeypatch):
    monkeypatch.setattr(sys.modules[StreamFunction.__module__], "plain_plans", lambda *_: [])
    stress, layers = eye
    paths = plan(StreamFunction(evaluations=20, phases=2), layers, stress, MACHINE)
    near = total = 0.0
    for layer in layers:
        laid = strings(paths.on_layer(layer.index), layer)
        room = shapely.buffer(layer.plane.polygon, -0.98 * INSET)
        total += shapely.length(laid).sum()
        near += shapely.length(shapely.difference(laid, room)).sum()
    assert total > 10.0 * LENGTH
    assert near < 0.003 * total


def test_what_neighbours_push_over_the_border_lies_on_it(bent_beam):
    layer = bent_beam[1][0]
    section = layer.plane.polygon
    lines = at_depths(section, np.linspace(0.01, 23.99, 26))  # two more than there is room for
    found = strings(slid_in(Toolpaths.from_plane(lines, layer), layer, MACHINE, 0.0), layer)
    assert shapely.covers(shapely.buffer(section, 1e-9), found).all()


def test_an_inset_that_leaves_no_room_leaves_no_paths(eye):
    stress, layers = eye
    assert not len(plan(StreamFunction(evaluations=1, inset=50.0), layers, stress, MACHINE))


def circle_through(a, b, c):
    """Radius of the circle through three points, by its sides and its area."""
    sides = [np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (c, a))]
    (x, y), (u, v) = b - a, c - a
    return np.prod(sides) / max(2.0 * abs(x * v - y * u), 1e-9)


@pytest.mark.parametrize("turn", [0.9, -0.9])
def test_gentle_bends_become_wider(bent_beam, turn):
    """A bend of 3 mm between straight legs, and a neighbour that has to give way."""
    layer = bent_beam[1][0]
    angle = np.linspace(0.0, turn, 19)
    sign = np.sign(turn)
    arc = np.column_stack([3.0 * np.sin(angle) * sign, 3.0 * sign * (1.0 - np.cos(angle))])
    leg = np.array([np.cos(turn), np.sin(turn)])
    line = np.array([[-20.0, 0.0], *arc, arc[-1] + 20.0 * leg]) + np.array(
        [28.0, 12.0 - 8.0 * sign]
    )
    paths = Toolpaths.from_plane([line], layer)

    def tightest(found):
        even = shapely.segmentize(strings(found, layer), 0.05)[0]
        at = np.arange(4.0, even.length - 4.0, 0.25)
        p, q, r = (
            shapely.get_coordinates(shapely.line_interpolate_point(even, at + off))
            for off in (-1.0, 0.0, 1.0)
        )
        return min(circle_through(*three) for three in zip(p, q, r, strict=True))

    assert tightest(paths) < 3.2
    assert tightest(slid_in(paths, layer, MACHINE, 0.5)) < 3.3
    found = slid_in(paths, layer, MACHINE, 0.5, radius=1.15 * MACHINE.minimum_radius)
    assert tightest(found) > MACHINE.minimum_radius
    away = shapely.hausdorff_distance(strings(found, layer), strings(paths, layer))
    assert away[0] < 0.5


def test_corners_stay(bent_beam):
    layer = bent_beam[1][0]
    line = np.array([[10.0, 8.0], [40.0, 8.0], [40.0, 10.0], [10.0, 10.0]])
    paths = Toolpaths.from_plane([line], layer)
    found = slid_in(paths, layer, MACHINE, 0.5, radius=4.0)
    away = shapely.hausdorff_distance(strings(found, layer), strings(paths, layer))
    assert away[0] < 0.02
