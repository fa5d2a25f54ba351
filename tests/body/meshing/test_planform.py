import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.check import check_mesh
from ccfem.body.meshing import extrude, triangulate
from ccfem.body.meshing.meshed_body import kept


def smallest_angles(points, triangles):
    """Smallest angle of each triangle, degrees, by the law of cosines."""
    corner = points[triangles]
    a, b, c = (
        np.linalg.norm(corner[:, i] - corner[:, j], axis=1) for i, j in ((1, 2), (0, 2), (0, 1))
    )
    angles = [
        np.degrees(np.arccos(np.clip((y**2 + z**2 - x**2) / (2 * y * z), -1, 1)))
        for x, y, z in ((a, b, c), (b, c, a), (c, a, b))
    ]
    return np.min(angles, axis=0)


def sides_of(triangles):
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(sides, axis=0, return_counts=True)


def shapes():
    disc = shapely.Point(0, 0).buffer(10, quad_segs=32)
    return {
        "square": shapely.box(0, 0, 20, 20),
        "disc": disc,
        "washer": disc.difference(shapely.Point(1, 2).buffer(4, quad_segs=32)),
        "l-shape": shapely.Polygon([(0, 0), (30, 0), (30, 8), (8, 8), (8, 25), (0, 25)]),
        "two holes": shapely.box(0, 0, 40, 16)
        .difference(shapely.Point(10, 8).buffer(3, quad_segs=32))
        .difference(shapely.Point(30, 8).buffer(5, quad_segs=32)),
        "triangle": shapely.Polygon([(0, 0), (20, 0), (10, 17)]),
    }


@pytest.mark.parametrize("size", [0.9, 1.5, 2.1])
@pytest.mark.parametrize("shape", list(shapes()))
def test_even_triangles_that_fill_the_shape(shape, size):
    polygon = shapes()[shape]
    points, triangles = triangulate(polygon, size)
    assert smallest_angles(points, triangles).min() > 20.0
    edges, counts = sides_of(triangles)
    assert counts.max() == 2
    ring = np.unique(edges[counts == 1])
    on_outline = shapely.distance(polygon.boundary, shapely.points(points[ring]))
    assert on_outline.max() < 1e-9
    corner = points[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert area.min() > 0.0
    # Chords of at most a 24th of a turn cut off at most 1.2 % of a disc; straight sides nothing.
    assert area.sum() == pytest.approx(polygon.area, rel=0.012)
    # Euler: points - edges + triangles = 1 - holes.
    assert len(points) - len(edges) + len(triangles) == 1 - len(polygon.interiors)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    assert lengths.max() < 1.8 * size


def test_corners_are_points_and_straight_shapes_are_exact():
    polygon = shapes()["l-shape"]
    points, triangles = triangulate(polygon, 1.7)
    for x in np.asarray(polygon.exterior.coords):
        assert (points == x).all(axis=1).any()
    corner = points[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    assert 0.5 * np.abs(np.cross(np.c_[u, 0 * u[:, 0]], np.c_[v, 0 * v[:, 0]])[:, 2]).sum() == (
        pytest.approx(polygon.area, rel=1e-12)
    )


def test_holes_are_resolved():
    """24 segments round a hole where a quarter of the size allows it, 12 at the least."""
    for radius, size, least in ((6.0, 2.5, 24), (3.0, 2.5, 24), (1.0, 2.5, 10)):
        plate = shapely.box(-20, -20, 20, 20)
        polygon = plate.difference(shapely.Point(0, 0).buffer(radius, quad_segs=32))
        points, triangles = triangulate(polygon, size)
        edges, counts = sides_of(triangles)
        rim = np.hypot(*points[edges[counts == 1]].mean(axis=1).T) < radius + 0.1
        assert rim.sum() >= least
        assert smallest_angles(points, triangles).min() > 20.0


def test_same_every_time():
    one, two = (triangulate(shapes()["two holes"], 1.5) for _ in range(2))
    assert np.array_equal(one[0], two[0])
    assert np.array_equal(one[1], two[1])


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(5, 14),
    st.floats(0.6, 4.0),
)
def test_any_star_shape_is_filled(seed, corners, size):
    """Random star-shaped outlines, thin and sharp ones too: no overlap, no gap."""
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * np.pi, corners))
    gaps = np.diff(np.append(angle, angle[0] + 2 * np.pi))
    if gaps.max() > 2.5 or gaps.min() < 0.15:
        return
    radius = random.uniform(4, 12, corners)
    polygon = shapely.Polygon(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1))
    points, triangles = triangulate(polygon, size)
    corner = points[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert area.min() > 0.0
    edges, counts = sides_of(triangles)
    assert counts.max() == 2
    lost = shapely.Polygon(polygon.exterior).area - area.sum()
    assert abs(lost) < 0.02 * polygon.area + 0.1
    assert len(points) - len(edges) + len(triangles) == 1


def test_points_to_keep_are_points_of_the_mesh():
    polygon = shapely.box(0, 0, 30, 12).difference(shapely.Point(9, 6).buffer(3.0, quad_segs=32))
    ring = polygon.interiors[0]
    keep = np.array([[7.3, 0.0], [12.9, 0.0], [30.0, 5.1], ring.interpolate(2.2).coords[0]])
    passed_over = np.array([[15.0, 6.0], [0.2, 12.0]])
    points, triangles = triangulate(polygon, 1.6, np.concatenate([keep, passed_over]))
    for point in keep:
        assert np.abs(points - point).max(axis=1).min() < 1e-12
    for point in passed_over:
        assert np.linalg.norm(points - point, axis=1).min() > 0.1
    corner = points[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(polygon.area, rel=2e-3)


@pytest.mark.parametrize("layers", [None, 1, 3])
def test_extruded_prisms(layers):
    polygon = shapes()["two holes"]
    mesh = extrude(polygon, 5.0, 1.6, layers)
    plane, triangles = triangulate(polygon, 1.6)
    count = layers or 3
    assert len(mesh.cells) == 3 * count * len(triangles)
    assert len(mesh.points) == (count + 1) * len(plane)
    assert mesh.volumes.min() > 0.0
    corner = plane[triangles]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()
    assert mesh.volumes.sum() == pytest.approx(5.0 * area)
    # Conforming: the boundary is exactly bottom, top and walls.
    edges, counts = sides_of(triangles)
    rim = edges[counts == 1]
    wall = 5.0 * np.linalg.norm(plane[rim[:, 0]] - plane[rim[:, 1]], axis=1).sum()
    assert mesh.facet_areas(mesh.boundary)[0].sum() == pytest.approx(2 * area + wall)
    assert len(mesh.boundary) == 2 * len(triangles) + 2 * count * len(rim)
    assert check_mesh(mesh)[1].findings == ()


def test_diagonals_favour_no_direction():
    """As many diagonals of the prisms rise along x as against it, within chance."""
    mesh = extrude(shapely.box(0, 0, 30, 30), 6.0, 1.0)
    edges = np.unique(np.sort(mesh.cells[:, mesh.edges].reshape(-1, 2), axis=1), axis=0)
    step = mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]
    step = step[np.abs(step[:, 2]) > 1e-9]
    step = step[np.hypot(step[:, 0], step[:, 1]) > 1e-9]
    step = step * np.sign(step[:, [2]])
    for column in (0, 1):
        along = step[np.abs(step[:, column]) > 1e-9, column]
        assert (along > 0).mean() == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(len(along)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: triangulate(shapely.Polygon(), 1.0), "one polygon with an area"),
        (lambda: triangulate(shapely.MultiPolygon(), 1.0), "one polygon with an area"),
        (lambda: triangulate("square", 1.0), "one polygon with an area"),
        (
            lambda: triangulate(shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]), 1.0),
            "not a valid",
        ),
        (lambda: triangulate(shapely.box(0, 0, 1, 1), 0.0), "edge length must be"),
        (lambda: triangulate(shapely.box(0, 0, 1, 1), float("nan")), "edge length must be"),
        (lambda: triangulate(shapely.box(0, 0, 1, 1), 1e-5), "choose a longer one"),
        (lambda: extrude(shapely.box(0, 0, 1, 1), 0.0, 0.5), "height must be"),
        (lambda: extrude(shapely.box(0, 0, 1, 1), 1.0, 0.5, layers=0), "at least 1"),
    ],
)
def test_bad_planforms(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_what_is_remembered_is_neither_shared_nor_mixed_up():
    square, ends = shapely.box(0, 0, 20, 20), np.array([[7.3, 0.0], [0.0, 12.1]])
    points, triangles = triangulate(square, 2.0)
    marked, _ = triangulate(square, 2.0, ends)
    assert all((marked == end).all(axis=1).any() for end in ends)
    assert not any((points == end).all(axis=1).any() for end in ends)
    again, corners = triangulate(square, 2.0)
    np.testing.assert_array_equal(again, points)
    again += 1.0
    corners[:] = 0
    for one, other in zip(triangulate(square, 2.0), (points, triangles), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_cache_removes_meshes_of_its_own_names_alone(tmp_path, monkeypatch):
    """Where a user names a folder with other files in it."""
    monkeypatch.setenv("CCFEM_CACHE", str(tmp_path))
    monkeypatch.setattr("ccfem.body.meshing.meshed_body._MOST", 2)
    mine = {f"wing{k}.npz" for k in range(4)}
    for name in mine:
        (tmp_path / name).write_bytes(b"mine")
    for k in range(4):
        kept(b"%d" % k, {}, lambda: (box_mesh((1.0, 1.0, 1.0), (1, 1, 1)), ()))
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= mine
    assert len(names) == len(mine) + 2
