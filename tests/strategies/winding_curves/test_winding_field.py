"""The field that winds, on a ring where it is known; curves that join holes; bends."""

from itertools import pairwise

import numpy as np
import pytest
import shapely

from ccfem.body.meshing import triangulate
from ccfem.geometry.facets import connected
from ccfem.geometry.isocontours import isocontours
from ccfem.paths.fields.layer_elements import Surface
from ccfem.strategies.winding import (
    PaperWeights,
    annulus_field,
    evened,
    gradient_jumps,
    limit_bends,
    paper_field,
    steep,
)
from ccfem.strategies.winding_curves.joining_curves import join
from ccfem.strategies.winding_curves.triangle_mesh import TriangleMesh

INNER, OUTER = 5.0, 20.0


def in_space(plane, bend=40.0):
    """Points of a plane rolled up: what is measured along it stays."""
    angle = plane[:, 0] / bend
    return np.column_stack([bend * np.sin(angle), plane[:, 1], bend * np.cos(angle)])


@pytest.fixture(scope="module")
def ring():
    disc = shapely.Point(0.0, 0.0)
    outline = disc.buffer(OUTER, quad_segs=48).difference(disc.buffer(INNER, quad_segs=24))
    plane, triangles = triangulate(outline, 0.8)
    radius = np.linalg.norm(plane, axis=1)
    inner, outer = np.flatnonzero(radius < INNER + 0.01), np.flatnonzero(radius > OUTER - 0.01)
    fixed = np.concatenate([inner, outer])
    values = np.concatenate([np.zeros(len(inner)), np.ones(len(outer))])
    return Surface(in_space(plane), triangles), radius, fixed, values


def test_without_tension_the_field_is_the_logarithm(ring):
    surface, radius, fixed, values = ring
    none = np.zeros((len(surface.triangles), 3, 3))
    found = annulus_field(surface, none, 1.0, 0.0, fixed, values)
    np.testing.assert_allclose(found, np.log(radius / INNER) / np.log(OUTER / INNER), atol=0.01)


def test_evened_levels_of_a_ring_are_equally_far_apart(ring):
    surface, radius, fixed, values = ring
    none = np.zeros((len(surface.triangles), 3, 3))
    field = evened(surface, annulus_field(surface, none, 1.0, 0.0, fixed, values))
    np.testing.assert_allclose(field, (radius - INNER) / (OUTER - INNER), atol=0.015)
    for share in (0.2, 0.8):
        assert steep(surface, field, share) == pytest.approx(1.0 / (OUTER - INNER), rel=0.06)
    lines = isocontours(surface.points, surface.triangles, field, 0.125, 0.25)
    assert lines.level.tolist() == [0, 1, 2, 3]


def test_tension_round_the_ring_leaves_the_field_as_it_is_and_tension_across_does_not(ring):
    """In a ring the gradient is radial: what counts is the tension along it."""
    surface, radius, fixed, values = ring
    middle = surface.points[surface.triangles].mean(axis=1)
    plane = np.column_stack([40.0 * np.arctan2(middle[:, 0], middle[:, 2]), middle[:, 1]])
    radial = plane / np.linalg.norm(plane, axis=1)[:, None]
    angle = plane[:, 0] / 40.0
    first = np.column_stack([np.cos(angle), np.zeros_like(angle), -np.sin(angle)])
    second = np.array([0.0, 1.0, 0.0])
    out = radial[:, :1] * first + radial[:, 1:] * second
    along = -radial[:, 1:] * first + radial[:, :1] * second
    log = np.log(radius / INNER) / np.log(OUTER / INNER)
    hoop = annulus_field(
        surface, 50.0 * along[:, :, None] * along[:, None, :], 1.0, 0.0, fixed, values
    )
    np.testing.assert_allclose(hoop, log, atol=0.02)
    # k(r) = 1 + r^2 / 25 along the radius: (r k s')' = 0, s ~ ln(r) - ln(1 + r^2 / 25) / 2.
    size = np.linalg.norm(plane, axis=1) ** 2 / 25.0
    tension = size[:, None, None] * out[:, :, None] * out[:, None, :]
    found = annulus_field(surface, tension, 1.0, 0.0, fixed, values)
    integral = np.log(radius) - 0.5 * np.log(1.0 + radius**2 / 25.0)
    low = np.log(INNER) - 0.5 * np.log(2.0)
    high = np.log(OUTER) - 0.5 * np.log(17.0)
    np.testing.assert_allclose(found, (integral - low) / (high - low), atol=0.02)


def test_a_linear_field_has_no_jumps_and_a_crease_has_its_own(ring):
    surface = ring[0]
    plane = np.column_stack(
        [40.0 * np.arctan2(surface.points[:, 0], surface.points[:, 2]), surface.points[:, 1]]
    )
    flat = Surface(np.column_stack([plane, np.zeros(len(plane))]), surface.triangles)
    jumps = gradient_jumps(flat)
    linear = plane @ [0.3, -1.2]
    assert abs(linear @ jumps @ linear) < 1e-9
    points = np.array([[0.0, 0, 0], [0, 2, 0], [3, 1, 0], [-3, 1, 0]])
    pair = Surface(points, np.array([[0, 2, 1], [0, 1, 3]]))
    # |x|: the slope changes by 2 across an edge 2 mm long between middles 2 mm apart.
    crease = np.abs(points[:, 0])
    assert crease @ gradient_jumps(pair) @ crease == pytest.approx(2.0 / 2.0 * 2.0**2)


def plate_with_holes(centres):
    outline = shapely.box(0.0, 0.0, 70.0, 40.0)
    for x, y in centres:
        outline = outline.difference(shapely.Point(x, y).buffer(4.0, quad_segs=12))
    plane, triangles = triangulate(outline, 2.0)
    points = in_space(plane - [35.0, 0.0])
    loops = [
        np.flatnonzero(np.hypot(*(plane - centre).T) < 4.05)[
            np.argsort(np.arctan2(*(plane[np.hypot(*(plane - centre).T) < 4.05] - centre).T[::-1]))
        ]
        for centre in np.array(centres)
    ]
    x, y = plane.T
    rim = np.flatnonzero((x < 1e-9) | (x > 70 - 1e-9) | (y < 1e-9) | (y > 40 - 1e-9))
    turn = np.argsort(np.arctan2(y[rim] - 20.0, x[rim] - 35.0))
    return points, triangles, loops, rim[turn]


@pytest.mark.parametrize(
    ("centres", "curves"),
    [
        (((15.0, 20.0), (55.0, 20.0)), 1),
        (((12.0, 12.0), (58.0, 12.0), (35.0, 30.0)), 3),
        (((10.0, 10.0), (60.0, 10.0), (60.0, 30.0), (10.0, 30.0)), 3),
    ],
)
def test_holes_are_joined_by_a_tree_and_the_cut_layer_is_a_ring(centres, curves):
    points, triangles, loops, rim = plate_with_holes(centres)
    mesh = TriangleMesh(points, triangles, np.arange(len(triangles)))
    cut, found = join(mesh, loops, [rim], 4.0)
    assert len(found) == curves
    # The surface is the same, and each triangle knows the one that it is a part of.
    area = Surface(points, triangles).areas
    parts = Surface(cut.points, cut.triangles).areas
    assert parts.sum() == pytest.approx(area.sum(), rel=1e-12)
    np.testing.assert_allclose(np.bincount(cut.source, parts), area, rtol=1e-9)
    # Holes and curves hang together, and touch the border nowhere: what is left is a ring.
    edges = {tuple(sorted(e)) for c in found for e in pairwise(c.tolist())}
    known = np.sort(
        np.concatenate(
            [cut.triangles[:, [0, 1]], cut.triangles[:, [1, 2]], cut.triangles[:, [2, 0]]]
        ),
        axis=1,
    )
    assert edges <= {tuple(e) for e in known.tolist()}
    inner = np.unique(np.concatenate([*loops, *found]))
    assert not np.isin(rim, inner).any()
    sides = np.concatenate(
        [*(np.stack([k, np.roll(k, -1)], 1) for k in loops), np.array(sorted(edges))]
    )
    piece = connected(sides, len(cut.points))
    assert len(np.unique(piece[inner])) == 1
    # Euler: points minus edges of a tree of curves and rings is 1 less a ring a hole.
    assert len(inner) - len(np.unique(np.sort(sides, axis=1), axis=0)) == 1 - len(loops)


def test_curves_are_as_short_as_straight_lines_where_nothing_repels():
    points, triangles, loops, rim = plate_with_holes(((15.0, 20.0), (55.0, 20.0)))
    mesh = TriangleMesh(points, triangles, np.arange(len(triangles)))
    cut, (curve,) = join(mesh, loops, [rim], 0.0)
    length = np.linalg.norm(np.diff(cut.points[curve], axis=0), axis=1).sum()
    # On the surface rolled off, from hole to hole: 40 mm less two radii.
    assert length == pytest.approx(32.0, rel=0.01)


def test_bends_are_limited_and_gentle_curves_stay():
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = np.column_stack([20.0 * np.cos(turn), 20.0 * np.sin(turn), np.zeros(400)])
    circle[-1] = circle[0]
    np.testing.assert_allclose(np.linalg.norm(limit_bends(circle, 0.13), axis=1), 20.0, atol=0.02)
    # 1 / R (1 + e (n^2 - 1)) where the waves of height e R bend most: 0.175 1/mm.
    wavy = circle * (1.0 + 0.004 * np.cos(25.0 * turn))[:, None]
    wavy[-1] = wavy[0]
    found = limit_bends(wavy, 0.13)
    assert sharpest(wavy) == pytest.approx(0.05 * (1.0 + 0.004 * 624.0), rel=0.05)
    assert sharpest(found) < 0.15
    np.testing.assert_array_equal(found[0], found[-1])


def sharpest(curve):
    """Curvature, 1/mm, that 98 % of a curve stays below, by the circle through three points."""
    a, b, c = curve[:-2], curve[1:-1], curve[2:]
    sides = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]
    bend = 2.0 * np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.prod(sides, axis=0)
    return np.quantile(bend, 0.98)


def test_paper_field_is_the_distance_from_a_straight_cut(ring):
    """All its terms vanish there but that of the stress, which is along the cut."""
    plane, triangles = triangulate(shapely.box(0.0, 0.0, 30.0, 12.0), 1.0)
    surface = Surface(in_space(plane), triangles)
    inner = np.flatnonzero(plane[:, 0] < 1e-9)
    along = np.tile(np.diag([0.0, 1.0, 0.0]), (len(triangles), 1, 1))
    found = paper_field(surface, along, inner, PaperWeights())
    # Zero holds softly, against nothing.
    np.testing.assert_allclose(found, plane[:, 0], atol=0.01)
    across = np.zeros((len(triangles), 3, 3))
    bend = plane[triangles].mean(axis=1)[:, 0] / 40.0
    axis = np.stack([np.cos(bend), 0.0 * bend, -np.sin(bend)], axis=1)
    across = np.einsum("ti,tj->tij", axis, axis)
    flatter = paper_field(surface, across, inner, PaperWeights(stress=10.0))
    assert flatter.max() < 0.5 * found.max()


def test_paper_field_beside_a_hole_is_the_distance_from_it(ring):
    """Beside the hole, where it is told to have the gradient 1, it is the distance from it."""
    surface, radius, fixed, _ = ring
    inner = fixed[radius[fixed] < INNER + 0.01]
    none = np.zeros((len(surface.triangles), 3, 3))
    weak = paper_field(surface, none, inner, PaperWeights(compatible=1e-3))
    near = radius < INNER + 0.9
    np.testing.assert_allclose(weak[near], (radius - INNER)[near], atol=0.2)
