"""What is drawn of a body covers it, in few triangles."""

import numpy as np
import pytest
import pyvista
import shapely

from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import numbered_faces
from ccfem.body.mesh.smooth_faces import smooth_faces
from ccfem.body.meshing import extrude
from ccfem.comparison.plot.symbols import borders, face_meshes


@pytest.fixture(scope="module")
def plate():
    """Faces of a plate 60 x 30 x 4 mm with a hole of radius 6 mm, its top of many triangles."""
    outline = shapely.box(0, 0, 60, 30).difference(shapely.Point(40, 15).buffer(6, quad_segs=16))
    return numbered_faces(extrude(outline, 4.0, 1.5))


def areas_and_normals(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    across = 0.5 * np.cross(b - a, c - a)
    return np.linalg.norm(across, axis=1).sum(), across.sum(axis=0)


def test_faces_are_drawn_whole_and_planes_by_few_triangles(plate):
    meshes = face_meshes(plate)
    assert [mesh.number for mesh in meshes] == list(plate.numbers)
    for mesh, face in zip(meshes, plate.faces, strict=True):
        area, outward = areas_and_normals(mesh.points, mesh.triangles)
        assert area == pytest.approx(face.area, rel=1e-6)
        if face.kind == "plane":
            np.testing.assert_allclose(outward, face.area * face.direction, atol=1e-6 * face.area)
    top = max(zip(plate.faces, meshes, strict=True), key=lambda pair: pair[0].area)[1]
    assert 5 * len(top.triangles) < len(plate.faces[0].facets)


def test_borders_are_the_edges_of_the_plate(plate):
    ends = borders(plate)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    circle = 2 * np.pi * 6
    assert length == pytest.approx(2 * (60 + 30) * 2 + 4 * 4 + 2 * circle, rel=1e-3)


def test_a_round_face_of_many_triangles_keeps_its_shape_in_fewer():
    sphere = pyvista.Sphere(radius=30.0, theta_resolution=120, phi_resolution=120).triangulate()
    points, triangles = np.asarray(sphere.points, float), sphere.regular_faces
    listing = BodyFaces(points, triangles, tuple(smooth_faces(points, triangles)))
    (mesh,) = face_meshes(listing)
    assert len(mesh.triangles) <= 10_000 < len(listing.triangles)
    area, outward = areas_and_normals(mesh.points, mesh.triangles)
    assert area == pytest.approx(4.0 * np.pi * 30.0**2, rel=2e-3)
    np.testing.assert_allclose(outward, 0.0, atol=1e-6 * area)
    middles = mesh.points[mesh.triangles].mean(axis=1)
    assert np.abs(np.linalg.norm(middles, axis=1) - 30.0).max() < 0.1
