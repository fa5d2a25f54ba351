"""Smooth faces: of shapes whose faces are known."""

import re
from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.face_rules import Faces, Holes, about_patches, without_faces
from ccfem.body.mesh.patches import Box, Cylinder, Plane, patches_from_rules
from ccfem.body.mesh.smooth_faces import smooth_faces
from ccfem.body.meshing import extrude, with_faces_of

TURN = np.radians(37.0)
ROTATION = np.array(
    [[np.cos(TURN), -np.sin(TURN), 0.0], [np.sin(TURN), np.cos(TURN), 0.0], [0.0, 0.0, 1.0]]
) @ np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.5), -np.sin(0.5)], [0.0, np.sin(0.5), np.cos(0.5)]])
MIRROR = np.diag([-1.0, 1.0, 1.0])


def plan_of_plate() -> shapely.Polygon:
    """A plate of 60 x 30 mm with holes of radius 4, 4 and 6 mm."""
    outline = shapely.box(0.0, 0.0, 60.0, 30.0)
    for x, radius in ((10.0, 4.0), (30.0, 6.0), (50.0, 4.0)):
        outline = outline.difference(shapely.Point(x, 15.0).buffer(radius, 32))
    return outline


def slot() -> TetMesh:
    """A strip with round ends: its walls run into each other smoothly."""
    return extrude(shapely.LineString([(0.0, 0.0), (40.0, 0.0)]).buffer(8.0, 32), 5.0, 2.0)


def moved(mesh: TetMesh, turn: np.ndarray) -> TetMesh:
    points = mesh.points @ turn.T + [3.0, -2.0, 7.0]
    cells = mesh.cells if np.linalg.det(turn) > 0 else mesh.cells[:, [0, 2, 1, 3]]
    return TetMesh(points, cells)


@pytest.fixture(scope="module")
def plate():
    return extrude(plan_of_plate(), 5.0, 2.0)


def test_faces_of_a_box():
    mesh = box_mesh((30.0, 20.0, 10.0), (6, 4, 2))
    faces = smooth_faces(mesh.points, mesh.boundary)
    assert [face.kind for face in faces] == ["plane"] * 6
    np.testing.assert_allclose([face.area for face in faces], [600, 600, 300, 300, 200, 200])
    assert [face.along for face in faces] == ["-z", "z", "-y", "y", "-x", "x"]
    np.testing.assert_allclose(faces[1].centre, [15.0, 10.0, 10.0])
    rows = np.concatenate([face.facets for face in faces])
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(mesh.boundary)))


@pytest.mark.parametrize("seed", range(3))
def test_equal_faces_are_numbered_by_their_places(seed):
    """Of a cube with rounding errors, however its triangles are ordered; its mirror image alike."""
    mesh = box_mesh((20.0, 20.0, 20.0), (4, 3, 5))
    random = np.random.default_rng(seed)
    points = mesh.points + random.normal(0.0, 1e-7, mesh.points.shape)
    triangles = random.permutation(mesh.boundary)
    for turn, order in ((np.eye(3), [0, 1, 2]), (MIRROR, [0, 2, 1])):
        faces = smooth_faces(points @ turn, triangles[:, order])
        assert [face.along for face in faces] == ["-x", "-y", "-z", "z", "y", "x"]


@pytest.mark.filterwarnings("error")
def test_a_triangle_without_an_area_is_no_cylinder():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 1, 0]])
    faces = smooth_faces(points, np.array([[0, 1, 2], [0, 1, 3]]))
    assert sorted((face.kind, face.area) for face in faces) == [("other", 0.0), ("plane", 1.0)]


@pytest.mark.parametrize("turn", [np.eye(3), ROTATION, MIRROR])
def test_holes_are_found_wherever_the_part_lies(plate, turn):
    mesh = moved(plate, turn)
    walls = [f for f in smooth_faces(mesh.points, mesh.boundary) if f.kind == "cylinder"]
    assert all(wall.hollow and wall.turn == 360.0 for wall in walls)
    np.testing.assert_allclose(sorted(w.radius for w in walls), [4.0, 4.0, 6.0], rtol=1e-3)
    for wall in walls:
        assert abs(wall.direction @ turn[:, 2]) == pytest.approx(1.0, abs=1e-6)
    (middle,) = (wall for wall in walls if wall.radius > 5.0)
    expected = turn @ [30.0, 15.0, 2.5] + [3.0, -2.0, 7.0]
    np.testing.assert_allclose(middle.centre, expected, atol=1e-6)


def test_planes_that_run_into_rounds_are_faces_of_their_own():
    mesh = slot()
    faces = smooth_faces(mesh.points, mesh.boundary)
    assert sorted(face.kind for face in faces) == ["cylinder"] * 2 + ["plane"] * 4
    rounds = [face for face in faces if face.kind == "cylinder"]
    for face in rounds:
        assert not face.hollow
        assert face.radius == pytest.approx(8.0, rel=1e-3)
        assert face.turn == pytest.approx(180.0, abs=7.0)
        assert face.area == pytest.approx(np.pi * 8.0 * 5.0, rel=0.05)


def test_an_angle_that_separates_nothing_is_refused(plate):
    with pytest.raises(InputError, match="feature angle must be above 0 and below 180 degrees"):
        smooth_faces(plate.points, plate.boundary, 0.0)


def test_rules_take_faces_by_number_and_holes_by_radius(plate):
    faces = smooth_faces(plate.points, plate.boundary)
    walls = [k for k, face in enumerate(faces, 1) if face.kind == "cylinder"]
    by_number = Faces(tuple(walls))(plate)
    both = np.concatenate([Holes(4.0)(plate), Holes(6.0, axis="z")(plate)])
    assert len(by_number) == len(both)
    assert set(map(tuple, by_number.tolist())) == set(map(tuple, both.tolist()))
    area = plate.facet_areas(Holes(4.0)(plate))[0].sum()
    assert area == pytest.approx(2.0 * 2.0 * np.pi * 4.0 * 5.0, rel=0.01)
    with pytest.raises(InputError, match=r"no hole has radius 5 mm; there are: wall of a hole of"):
        Holes(5.0)(plate)
    with pytest.raises(InputError, match="no hole has radius 4 mm and axis x"):
        Holes(4.0, axis="x")(plate)
    with pytest.raises(InputError, match="the part has 9 faces; got number 10"):
        Faces(10)(plate)
    with pytest.raises(InputError, match="face numbers count from 1"):
        Faces(())


GUESSES = {
    "off centre": (
        Cylinder((10.0, 17.0, 0.0), "z", 4.0),
        r"takes \d+% of a wall of a hole of radius 4 mm.*put the cylinder there",
    ),
    "one hole of two": (
        Cylinder((10.0, 15.0, 0.0), "z", 4.0),
        "is one of 2 like walls; in no patch: wall of a hole of radius 4 mm, axis z through "
        r"\[50, 15, 2.5\]: take all by rule 'holes'",
    ),
    "box with side faces": (
        Box((55.0, -1.0, -1.0), (61.0, 31.0, 6.0)),
        "its box takes facets of 5 faces, with normals -z, z, -y, y, x: give the box a normal",
    ),
    "plane of a thin sheet": (
        Plane("z", 2.5, tolerance=2.6),
        "mm\\^2 that face one way and .* mm\\^2 that face the other: lessen the tolerance",
    ),
}


@pytest.mark.parametrize("what", GUESSES)
def test_wrong_guesses_are_pointed_out(plate, what):
    rule, expected = GUESSES[what]
    rules = {"pin": rule}
    line = about_patches(patches_from_rules(plate, rules), rules)[0]
    assert line.startswith("patch 'pin'")
    assert re.search(expected, line), line


def test_patches_as_meant_are_passed_over(plate):
    rules = {
        "bolts": Holes(4.0),
        "bore": Cylinder((30.0, 15.0, 0.0), "z", 6.0),
        "half": Cylinder((30.0, 15.0, 0.0), "z", 6.0, half="x"),
        "end": Box((55.0, -1.0, -1.0), (61.0, 31.0, 6.0), normal="x"),
        "foot": Plane("z", "min"),
    }
    assert about_patches(patches_from_rules(plate, rules), rules) == ()


def test_the_end_of_a_thin_sheet_is_its_outer_side():
    sheet = box_mesh((400.0, 300.0, 0.4), (8, 6, 1))
    for end, height in (("min", 0.0), ("max", 0.4)):
        facets = Plane("z", end)(sheet)
        assert sheet.facet_areas(facets)[0].sum() == pytest.approx(400.0 * 300.0)
        np.testing.assert_allclose(sheet.points[facets][:, :, 2], height)
    turned = replace(sheet, points=sheet.points @ ROTATION.T)
    facets = Plane(tuple(ROTATION[:, 2]), "max")(turned)
    assert turned.facet_areas(facets)[0].sum() == pytest.approx(400.0 * 300.0)


def test_a_mesh_takes_the_faces_of_its_surface(plate):
    """Whatever its own faces are: here a finer mesh of the same part, turned as the surface is."""
    coarse, fine = moved(plate, ROTATION), moved(extrude(plan_of_plate(), 5.0, 1.2), ROTATION)
    surface = Surface(coarse.points, coarse.boundary)
    mesh = with_faces_of(surface, fine)
    faces = smooth_faces(surface.points, surface.triangles)
    for number, face in enumerate(faces, 1):
        facets = Faces(number)(mesh)
        assert mesh.facet_areas(facets)[0].sum() == pytest.approx(face.area, rel=0.02)
    assert without_faces(mesh, ("face_3",)).patches.keys() == {"face_3"}
    with pytest.raises(InputError, match="the part has 9 faces; got number 10"):
        Faces((1, 10))(mesh)
    with pytest.raises(InputError, match="'face_2' has a name that is kept for the numbered"):
        patches_from_rules(mesh, {"face_2": Faces(3)})
    lost = replace(mesh, patches={n: f for n, f in mesh.patches.items() if n != "face_2"})
    np.testing.assert_array_equal(Faces(9)(lost), Faces(9)(mesh))
