"""Layers cut at the levels of a field, against spheres and what topology demands."""

import numpy as np
import pytest
import shapely
from scipy.integrate import dblquad

from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.meshing import extrude
from ccfem.geometry.facets import border_edges
from ccfem.slicing.layers.level_surfaces import clean, level_surfaces

RADIUS = 40.0
CENTRE = np.array([0.0, 0.0, RADIUS])


def dome(mesh):
    """Distance from (0, 0, -40): its levels are spheres, 1 mm apart a unit."""
    return np.linalg.norm(mesh.points + CENTRE, axis=1)


@pytest.fixture(scope="module")
def plate():
    outline = shapely.box(-20.0, -15.0, 20.0, 15.0)
    hole = shapely.Point(4.0, 0.0).buffer(5.0, quad_segs=24)
    mesh = extrude(outline.difference(hole), 24.0, 2.0)
    return patches_from_rules(mesh, {"hole": Cylinder((4.0, 0.0, 0.0), "z", 5.0)})


@pytest.fixture(scope="module")
def found(plate):
    levels = RADIUS + np.array([14.0, 16.0, 18.0])
    return level_surfaces(plate, dome(plate), levels, 2.0, 0.7, 1.0)


def euler(layer):
    t = layer.triangles
    edges = np.unique(
        np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), 1), axis=0
    )
    return len(layer.points) - len(edges) + len(t)


def test_area_is_that_of_the_sphere(found):
    for layer, radius in zip(found.layers, RADIUS + np.array([14.0, 16.0, 18.0]), strict=True):

        def steepness(y, x, r=radius):
            return r / np.sqrt(r * r - x * x - y * y)

        whole, _ = dblquad(steepness, -20.0, 20.0, -15.0, 15.0)
        hole, _ = dblquad(
            lambda s, t, f=steepness: s * f(s * np.sin(t), 4.0 + s * np.cos(t)),
            0.0, 2.0 * np.pi, 0.0, 5.0,
        )  # fmt: skip
        assert layer.areas.sum() == pytest.approx(whole - hole, rel=3e-3)


def test_points_lie_on_the_sphere_and_interpolate_the_mesh(plate, found):
    for layer, radius in zip(found.layers, RADIUS + np.array([14.0, 16.0, 18.0]), strict=True):
        away = np.linalg.norm(layer.points + CENTRE, axis=1)
        # The field is linear in each cell: it sags by the edge length squared over 8 radii.
        np.testing.assert_allclose(away, radius, atol=3.5**2 / 8.0 / radius)
        np.testing.assert_allclose(layer.interpolate(dome(plate)), radius, atol=1e-9)
        np.testing.assert_allclose(layer.interpolate(plate.points), layer.points, atol=1e-9)


def test_normals_point_up_the_field_and_thickness_is_the_distance_of_levels(found):
    for layer in found.layers:
        up = layer.points + CENTRE
        up = up / np.linalg.norm(up, axis=1)[:, None]
        assert np.einsum("nd,nd->n", layer.point_normals, up).min() > np.cos(np.radians(12.0))
        np.testing.assert_allclose(layer.local_thickness, 2.0, rtol=0.02)
        assert layer.thickness == pytest.approx(2.0, rel=0.01)


def test_layer_with_a_hole_is_an_annulus_with_its_hole_on_the_patch(found):
    for layer in found.layers:
        assert euler(layer) == 0
        assert len(layer.loops) == 2
        assert layer.component.max() == 0
        on_hole = np.unique(layer.patches["hole"])
        inner = min(layer.loops, key=lambda loop: np.ptp(layer.points[loop], axis=0).max())
        np.testing.assert_array_equal(np.sort(inner), on_hole)
        away = np.hypot(layer.points[inner, 0] - 4.0, layer.points[inner, 1])
        # The mesh has chords of up to 2 mm there.
        np.testing.assert_allclose(away, 5.0, atol=2.0**2 / 8.0 / 5.0)
        # Material on the left: the hole runs clockwise seen from above.
        x, y = layer.points[inner, :2].T
        assert (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() < 0.0


def test_cleaning_drops_slivers_and_keeps_the_surface(plate):
    raw, clean_ = (
        level_surfaces(plate, dome(plate), np.array([RADIUS + 16.0]), 2.0, edge, 1.0).layers[0]
        for edge in (1e-9, 0.7)
    )

    def thin(layer):
        p = layer.points[layer.triangles]
        longest = ((p - np.roll(p, 1, axis=1)) ** 2).sum(axis=2).max(axis=1)
        return 2.0 * layer.areas / longest

    assert len(clean_.triangles) < 0.75 * len(raw.triangles)
    assert (thin(clean_) < 0.1).mean() < 0.2 * (thin(raw) < 0.1).mean()
    assert clean_.areas.sum() == pytest.approx(raw.areas.sum(), rel=2e-3)
    assert euler(clean_) == euler(raw)


def test_cleaning_a_plane_grid_keeps_its_border_and_area():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(0, 10, 41), np.linspace(0, 10, 41), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    inner = ((points[:, :2] > 0.01) & (points[:, :2] < 9.99)).all(axis=1)
    points[inner, :2] += rng.uniform(-0.1, 0.1, (inner.sum(), 2))
    quad = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    triangles = np.concatenate(
        [np.stack([quad, quad + 41, quad + 42], 1), np.stack([quad, quad + 42, quad + 1], 1)]
    )
    fixed = np.zeros(len(points), dtype=bool)
    new, cell = clean(points, triangles, np.arange(len(triangles)), fixed, 0.6, 1e-6)
    a, b, c = np.moveaxis(points[new], 1, 0)
    area = 0.5 * np.cross(b - a, c - a)[:, 2]
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(100.0)
    assert len(new) < 0.5 * len(triangles)
    assert set(cell) <= set(range(len(triangles)))
    border = border_edges(new, len(points))
    corners = {(0.0, 0.0), (0.0, 10.0), (10.0, 0.0), (10.0, 10.0)}
    assert corners <= {tuple(p) for p in points[border[:, 0], :2]}


def test_cleaning_moves_the_border_by_a_twentieth_of_the_shortest_edge():
    """Of a square of 2 mm cut in steps of an eighth, whose corners carry no patches."""
    box = box_mesh((2.0, 2.0, 1.0), (16, 16, 2))
    mesh = TetMesh(box.points, box.cells)
    (layer,) = level_surfaces(mesh, mesh.points[:, 2], np.array([0.3]), 1.0, 0.5, 1.0).layers
    assert len(layer.points) < 100
    section = shapely.union_all(shapely.polygons(layer.points[layer.triangles][..., :2]))
    corners = shapely.points([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])
    assert shapely.distance(section, corners).max() <= 0.05 * 0.5


@pytest.mark.parametrize("size", [0.01, 1.0, 100.0])
@pytest.mark.parametrize(("lift", "flips"), [(0.0, True), (0.7, True), (0.8, False)])
def test_thin_pairs_are_flipped_unless_that_folds_the_surface(lift, flips, size):
    """The side from (-1, 0, 0) to (1, 0, 0) has two opposite angles above a right angle.

    Flipped, the cosine of a triangle's normal and z is 1 / sqrt(1 + lift^2): .82 or .78; the least
    is .8. Nothing changes with the size or with the directions.
    """
    points = np.array([[-1, 0, 0], [1, 0, 0], [0, 0.3, lift], [0, -0.3, lift]], dtype=float)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    fixed = np.ones(4, dtype=bool)
    triangles = np.array([[0, 1, 2], [1, 0, 3]])
    new, cell = clean(size * points @ turn.T, triangles, np.array([7, 8]), fixed, 1e-9, 1e-9)
    expected = [{0, 2, 3}, {1, 2, 3}] if flips else [{0, 1, 2}, {0, 1, 3}]
    assert sorted(map(sorted, new)) == sorted(map(sorted, expected))
    assert set(cell) == {7, 8}


def test_pieces_bubbles_and_specks():
    mesh = box_mesh((20.0, 20.0, 20.0), (12, 12, 12))
    x, y, z = (mesh.points - 10.0).T
    # A ball in the middle, and a corner cut off: the ball is a bubble, the corner an open piece.
    ball = 5.0 - np.sqrt(x**2 + y**2 + z**2)
    corner = (x + y + z) - 24.0
    values = np.maximum(ball, corner)
    found = level_surfaces(mesh, values, np.array([0.0]), 1.0, 0.3, 0.0)
    assert (found.bubbles, found.specks) == (1, 0)
    (layer,) = found.layers
    # x + y + z = 24 cuts the corner (10, 10, 10) in a triangle with legs of 6 mm.
    assert layer.areas.sum() == pytest.approx(np.sqrt(3.0) / 2.0 * 36.0, rel=0.05)
    nothing = level_surfaces(mesh, values, np.array([0.0]), 1.0, 0.3, 1e4)
    assert (len(nothing.layers), nothing.bubbles, nothing.specks) == (0, 1, 1)
