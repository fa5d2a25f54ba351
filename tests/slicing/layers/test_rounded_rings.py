"""Sections follow the true wall of what is round: against circles, ellipses and rings."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.affinity

from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.meshing import extrude
from ccfem.geometry.shapes import corners_only
from ccfem.paths.fields.chart import flat_view
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.slicers import Planar

ANGLE = np.radians(37.0)
TURN = np.array(
    [[np.cos(ANGLE), -np.sin(ANGLE), 0.0], [np.sin(ANGLE), np.cos(ANGLE), 0.0], [0.0, 0.0, 1.0]]
)
PLACES = {"as it is": np.eye(3), "turned": TURN, "mirrored": TURN @ np.diag([1.0, -1.0, 1.0])}


def plate(radius: float, edge: float) -> TetMesh:
    """A plate of 40 x 40 x 4 mm with a hole of this radius about (20, 18)."""
    hole = shapely.Point(20.0, 18.0).buffer(radius, quad_segs=32)
    return extrude(shapely.box(0, 0, 40, 40).difference(hole), 4.0, edge)


def placed(mesh: TetMesh, turn: np.ndarray) -> TetMesh:
    """The mesh turned or mirrored; its walls are to be told from its boundary."""
    cells = mesh.cells if np.linalg.det(turn) > 0.0 else mesh.cells[:, [1, 0, 2, 3]]
    return TetMesh(mesh.points @ turn.T, cells)


def largest_pin(mesh: TetMesh, centre: np.ndarray) -> list[float]:
    """Diameter of the largest pin that fits the hole of each section, mm."""
    planes = [layer.plane for layer in Planar(count=3).cut(mesh)]
    at = [shapely.Point(plane.project(centre)) for plane in planes]
    assert all(plane.polygon.is_valid and len(plane.polygon.interiors) == 1 for plane in planes)
    pairs = zip(at, planes, strict=True)
    return [2.0 * point.distance(plane.polygon.interiors[0]) for point, plane in pairs]


@pytest.mark.parametrize(("radius", "edge"), [(6.0, 3.0), (3.0, 2.0), (6.0, 9.0), (0.5, 3.0)])
def test_a_hole_has_its_diameter_at_any_edge_length(radius, edge):
    """12 mm by 3 mm took a pin of 11.89, and 6 mm by 2 mm one of 5.95; a small one was a square."""
    pins = largest_pin(plate(radius, edge), np.array([20.0, 18.0, 0.0]))
    np.testing.assert_allclose(pins, 2.0 * radius, atol=0.012)


@pytest.mark.parametrize("turn", PLACES.values(), ids=PLACES)
def test_a_hole_is_round_in_a_mesh_that_nothing_is_known_of(turn):
    mesh = placed(plate(6.0, 3.0), turn)
    np.testing.assert_allclose(largest_pin(mesh, turn @ [20.0, 18.0, 0.0]), 12.0, atol=0.012)


@pytest.mark.parametrize("tilt", [0.0, 20.0])
def test_sections_of_a_ring_have_its_area_and_its_moment_of_inertia(tilt):
    """Of a tube cut at an angle: an ellipse longer by 1 / cos of it."""
    inner, outer = 4.0, 8.0
    ring = shapely.Point(0, 0).buffer(outer, 32).difference(shapely.Point(0, 0).buffer(inner, 32))
    mesh = extrude(ring, 24.0, 3.0)
    build = (0.0, float(np.sin(np.radians(tilt))), float(np.cos(np.radians(tilt))))
    height = 12.0 * build[2]
    (layer,) = Planar(heights=(height,)).cut(mesh, build)
    section, chords = layer.plane.polygon, shapely.Polygon()
    for loop in sorted(layer.loops, key=len, reverse=True):
        chords = chords.symmetric_difference(shapely.Polygon(layer.plane.points[loop]))
    longer = 1.0 / build[2]
    area = np.pi * (outer**2 - inner**2) * longer
    inertia = 0.25 * np.pi * (outer**4 - inner**4) * longer  # about the long axis

    def second(polygon):
        centre = np.array(polygon.centroid.coords[0])
        shifted = shapely.transform(polygon, lambda points: points - centre)
        total = 0.0
        for sign, ring_ in ((1.0, shifted.exterior), (-1.0, shifted.interiors[0])):
            (x, y), (a, b) = np.array(ring_.coords)[:-1].T, np.array(ring_.coords)[1:].T
            cross = x * b - a * y
            moments = [(cross * (u**2 + u * v + v**2)).sum() / 12.0 for u, v in ((x, a), (y, b))]
            total += sign * min(np.abs(moments))
        return total

    assert section.area == pytest.approx(area, rel=1e-3)
    assert second(section) == pytest.approx(inertia, rel=2e-3)
    # The chords of the mesh miss both by a percent and two.
    assert chords.area < 0.992 * area
    assert second(chords) < 0.98 * inertia


def test_equal_layers_stay_equal():
    sections = [corners_only(layer.plane.polygon) for layer in Planar(count=4).cut(plate(6.0, 3.0))]
    assert all(section.equals_exact(sections[0], 0.0) for section in sections)


def test_rounded_corners_run_into_straight_sides():
    outline = shapely.box(0, 0, 30, 20).buffer(-5.0).buffer(5.0, quad_segs=24)
    (layer,) = Planar(count=1).cut(extrude(outline, 3.0, 4.0))
    area = 30.0 * 20.0 - (4.0 - np.pi) * 25.0
    assert layer.plane.polygon.area == pytest.approx(area, rel=2e-4)
    assert layer.plane.polygon.bounds == pytest.approx((0, 0, 30, 20), abs=1e-6)


def test_balls_and_cones_are_cut_in_circles():
    mesh = box_mesh((2.0, 2.0, 2.0), (6, 6, 6), (-1.0, -1.0, -1.0))
    length = np.maximum(np.linalg.norm(mesh.points, axis=1), 1e-9)
    factor = 5.0 * np.abs(mesh.points).max(axis=1) / length
    ball = TetMesh(mesh.points * factor[:, None], mesh.cells)
    tapered = plate(6.0, 3.0)
    points = tapered.points.copy()
    arm = points[:, :2] - [20.0, 18.0]
    away = np.linalg.norm(arm, axis=1)
    grown = np.maximum(1.0 - (away - 6.0) / 8.0, 0.0) * 0.5 * points[:, 2] / away
    points[:, :2] += arm * grown[:, None]
    for mesh, heights, at, radius in (
        (ball, (-3.0, 0.2, 2.0), (0.0, 0.0), lambda z: np.sqrt(25.0 - z**2)),
        (TetMesh(points, tapered.cells), (0.5, 2.3), (20.0, 18.0), lambda z: 6.0 + 0.5 * z),
    ):
        for layer in Planar(heights=heights).cut(mesh):
            (ring,) = [r for r in layer.plane.rings if np.ptp(r[:, 0]) < 30.0]
            away = np.linalg.norm(ring - at, axis=1)
            np.testing.assert_allclose(away, radius(layer.plane.height), atol=1e-3)


def test_what_is_not_round_keeps_its_corners():
    """An octagonal hole of one facet a side, and an oval one."""
    octagon = shapely.Point(20.0, 18.0).buffer(6.0, quad_segs=2)
    mesh = extrude(shapely.box(0, 0, 40, 40).difference(octagon), 4.0, 5.0)
    for known in (mesh, replace(mesh, walls=None)):
        (layer,) = Planar(count=1).cut(known)
        hole = shapely.Polygon(layer.plane.polygon.interiors[0])
        assert hole.area == pytest.approx(octagon.area, rel=1e-9)
    oval = shapely.affinity.scale(shapely.Point(20.0, 18.0).buffer(6.0, quad_segs=32), 1.015, 0.985)
    mesh = extrude(shapely.box(0, 0, 40, 40).difference(oval), 4.0, 2.0)
    for known in (mesh, replace(mesh, walls=None)):
        (layer,) = Planar(count=1).cut(known)
        hole = shapely.Polygon(layer.plane.polygon.interiors[0])
        assert np.diff(hole.bounds[::2])[0] == pytest.approx(2.0 * 6.09, abs=0.02)
        assert np.diff(hole.bounds[1::2])[0] == pytest.approx(2.0 * 5.91, abs=0.02)


CURVES = {
    "flat": (lambda x, y: 0.0 * x, 1.0),
    "aslant": (lambda x, y: 0.2 * (x - 20.0), np.sqrt(1.04)),  # an ellipse: longer by 1 / cos
    "bent": (lambda x, y: 0.004 * (y - 18.0) ** 2, None),
}


@pytest.mark.parametrize(("fall", "longer"), CURVES.values(), ids=CURVES)
@pytest.mark.parametrize("edge", [2.0, 3.0])
def test_curved_layers_follow_the_wall_in_their_charts(fall, longer, edge):
    """Of a ring: a bent layer has the area of its surface over the ring."""
    inner, outer, middle = 4.0, 14.0, shapely.Point(20, 18)
    ring = middle.buffer(outer, 32).difference(middle.buffer(inner, 32))
    mesh = extrude(ring, 8.0, edge)
    x, y, z = mesh.points.T
    (layer,) = level_surfaces(mesh, z + fall(x, y), np.array([4.0]), 1.0, 0.5, 1.0).layers
    assert layer.flat is None
    section = flat_view(layer).plane.polygon
    area = np.pi * (outer**2 - inner**2) * (longer or 1.0)
    if longer is None:
        side = np.linspace(-outer, outer, 1001)
        place = np.stack(np.meshgrid(side, side), axis=-1)
        radius = np.linalg.norm(place, axis=-1)
        here = (radius > inner) & (radius < outer)
        slope = 0.008 * place[..., 1]
        area = np.sqrt(1.0 + slope**2)[here].sum() * (side[1] - side[0]) ** 2
    assert section.is_valid
    assert section.area == pytest.approx(area, rel=1e-3)
    chords = shapely.Polygon(flat_view(layer).plane.points[layer.loops[0]]).area
    chords -= sum(shapely.Polygon(flat_view(layer).plane.points[k]).area for k in layer.loops[1:])
    assert abs(abs(chords) / area - 1.0) > 2.0 * abs(section.area / area - 1.0)
    if longer == 1.0:
        pin = 2.0 * shapely.Point(section.interiors[0].centroid).distance(section.interiors[0])
        assert pin == pytest.approx(2.0 * inner, abs=0.012)
