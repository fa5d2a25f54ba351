"""Faces by place: on bodies whose faces are known, whatever their mesh and their numbers."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.face_places import BodyFaces, _distances
from ccfem.body.mesh.face_rules import Faces, OnBody, numbered_faces
from ccfem.body.mesh.patches import patches_from_rules
from ccfem.body.mesh.smooth_faces import smooth_faces
from ccfem.body.meshing import extrude, with_faces_of
from ccfem.cases.inspection import faces
from ccfem.cases.part_file import read_part


def plate(edge: float, holes: int = 12) -> TetMesh:
    """A plate of 80 x 60 x 6 mm with holes of radius 4, 20 mm apart."""
    outline = shapely.box(0.0, 0.0, 80.0, 60.0)
    for k in range(holes):
        centre = shapely.Point(10.0 + 20.0 * (k % 4), 10.0 + 20.0 * (k // 4))
        outline = outline.difference(centre.buffer(4.0, 16))
    return extrude(outline, 6.0, edge)


@pytest.fixture(scope="module")
def coarse():
    return plate(6.0)


def numbering(mesh: TetMesh) -> BodyFaces:
    return BodyFaces(mesh.points, mesh.boundary, smooth_faces(mesh.points, mesh.boundary))


def test_distances_are_those_of_another_program():
    pyvista = pytest.importorskip("pyvista")
    random = np.random.default_rng(0)
    points, triangles = random.normal(size=(30, 3)), random.permutation(30).reshape(-1, 3)
    for place in random.normal(size=(20, 3)):
        found = _distances(place, points, triangles)
        for k, triangle in enumerate(triangles):
            alone = pyvista.PolyData.from_regular_faces(points, triangle[None])
            _, nearest = alone.find_closest_cell(place, return_closest_point=True)
            assert found[k] == pytest.approx(np.linalg.norm(nearest - place), abs=1e-5)


def keys_of(body: BodyFaces, number: int) -> dict:
    """What `BodyFaces.number_at` takes of the place of a face."""
    place = {"radius": np.nan, **body.place(number)}
    return {key: np.array(value) if key != "radius" else value for key, value in place.items()}


@pytest.mark.parametrize(("edge", "holes"), [(3.0, 12), (6.0, 10)])
def test_places_hold_on_another_mesh_and_another_body(coarse, edge, holes):
    """On a finer mesh, and one of a plate with two holes less, whose numbers are others."""
    body, other = numbering(coarse), numbering(plate(edge, holes))
    gone = [[50.0, 50.0, 3.0], [70.0, 50.0, 3.0]] if holes == 10 else []
    for number, face in zip(body.numbers, body.faces, strict=True):
        if np.round(face.centre).tolist() in gone:
            with pytest.raises(InputError, match=r"no round wall .* is within .*; nearest: face"):
                other.number_at(**keys_of(body, number))
        else:
            there = other.face(other.number_at(**keys_of(body, number)))
            assert there.kind == face.kind
            np.testing.assert_allclose(there.centre, face.centre, atol=0.5)


def test_the_rule_takes_the_facets_at_a_place(coarse):
    hole = Faces(at=(34.0, 30.0, 3.0), axis="z", radius=4.0)
    facets = patches_from_rules(coarse, {"hole": hole}).patches["hole"]
    np.testing.assert_allclose(
        np.hypot(*(coarse.points[facets][..., :2] - [30.0, 30.0]).reshape(-1, 2).T), 4.0, rtol=0.01
    )
    area = coarse.facet_areas(facets)[0].sum()
    assert area == pytest.approx(2.0 * np.pi * 4.0 * 6.0, rel=0.02)
    # Two ends at once; the normal tells the upper from the lower side of a thin sheet.
    ends = Faces(at=((0.0, 30.0, 3.0), (80.0, 30.0, 3.0)))
    assert coarse.facet_areas(ends(coarse))[0].sum() == pytest.approx(2.0 * 60.0 * 6.0)
    sheet = box_mesh((40.0, 30.0, 0.05), (4, 3, 1))
    for normal, level in (("z", 0.05), ("-z", 0.0)):
        facets = Faces(at=(20.0, 15.0, 0.025), normal=normal)(sheet)
        np.testing.assert_allclose(sheet.points[facets][..., 2], level)


REFUSED = {
    "moved": (
        {"at": (40.0, 40.0, 9.0), "normal": "z"},
        r"no face with normal z is within 0\.501 mm of \[40, 40, 9\]; nearest: face \d, 3 mm off, "
        "a plane of",
    ),
    "of another kind": (
        {"at": (40.0, 40.0, 6.0), "normal": "x"},
        "no face with normal x is within .*; nearest: face",
    ),
    "of another radius": (
        {"at": (34.0, 30.0, 3.0), "axis": "z", "radius": 5.0},
        "no round wall of radius 5 mm and axis z is within .* a wall of a hole of radius 4",
    ),
    "on an edge": (
        {"at": (80.0, 30.0, 6.0)},
        "lies between several: face .*; face .*: move it into one of them",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_place_without_its_face_is_one_line(coarse, what):
    keys, expected = REFUSED[what]
    with pytest.raises(InputError, match=expected) as caught:
        Faces(**keys)(coarse)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, "needs the place of a face .* got neither"),
        ({"number": 1, "at": (0, 0, 0)}, "got both"),
        ({"number": 1, "normal": "z"}, "normal of a face goes with at"),
        ({"at": (0, 0, 0), "axis": "z"}, "normal, or axis and radius together"),
        ({"at": (0, 0, 0), "axis": "z", "radius": 1.0, "normal": "x"}, "normal, or axis and"),
        ({"at": (0, 0, 0), "axis": "z", "radius": -1.0}, "radius must be above 0 mm"),
        ({"at": ()}, "at must be a point, or several"),
    ],
)
def test_halves_of_a_place_are_refused(keys, expected):
    with pytest.raises(InputError, match=expected):
        Faces(**keys)


def test_a_face_smaller_than_the_cells_is_named(coarse):
    """It counts on the body, so that the numbers after it stay; no facet of the mesh is its."""
    mesh = with_faces_of(Surface(coarse.points, coarse.boundary), coarse)
    body = numbering(coarse)
    lost = replace(mesh, patches={n: f for n, f in mesh.patches.items() if n != "face_4"})
    with pytest.raises(InputError, match=r"face 4, a plane of 480 .* is smaller than the cells"):
        OnBody(Faces((1, 4)), body)(lost)
    np.testing.assert_array_equal(OnBody(Faces(11), body)(lost), Faces(11)(coarse))
    assert numbered_faces(lost).numbers == (1, 2, 3, *range(5, 19))
    with pytest.raises(InputError, match="the part has 18 faces; got number 19"):
        OnBody(Faces(19), body)(lost)


def test_a_mesh_lists_the_faces_of_its_body(coarse, tmp_path):
    """In their order, of which the names have another: face_10 comes before face_2."""
    mesh = with_faces_of(Surface(coarse.points, coarse.boundary), coarse)
    turned = {f"face_{19 - int(n[5:])}": f for n, f in mesh.patches.items()}
    write_mesh(replace(mesh, patches=turned), tmp_path / "plate.npz")
    listed, plain = faces(tmp_path / "plate.npz"), faces(write(coarse, tmp_path))
    assert listed.numbers == plain.numbers == tuple(range(1, 19))
    for number in listed.numbers:
        np.testing.assert_allclose(
            listed.face(number).centre, plain.face(19 - number).centre, atol=1e-9
        )
        facets = mesh.boundary[listed.face(number).facets]
        np.testing.assert_array_equal(facets, Faces(number)(replace(mesh, patches=turned)))


def write(mesh: TetMesh, folder):
    write_mesh(replace(mesh, patches={}), folder / "bare.npz")
    return folder / "bare.npz"


PART = """surface = "plate.stl"
edge_length = 4.0
material = "pla"
[patches.foot]
rule = "face"
at = [40, 40, 0]
normal = "-z"
[patches.bolt]
rule = "face"
at = [14, 10, 3]
axis = "z"
radius = 4.0
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "bolt"
vector = [0, 0, 1]
"""


def test_a_part_file_says_before_meshing_where_its_face_is_no_more(coarse, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    used, rows = np.unique(coarse.boundary, return_inverse=True)
    shell = pyvista.PolyData.from_regular_faces(coarse.points[used], rows.reshape(-1, 3))
    shell.save(tmp_path / "plate.stl")
    path = tmp_path / "part.toml"
    # The listing needs the body alone, and has its numbers.
    path.write_text(PART)
    listed = faces(path)
    assert [face.about for face in listed.faces] == [
        face.about for face in faces(tmp_path / "plate.stl").faces
    ]
    for old, new, expected in (
        ("[14, 10, 3]", "[14, 16, 3]", r"patch 'bolt': no round wall of radius 4 mm.*face \d+, "),
        ("radius = 4.0", "radius = 3.0", "patch 'bolt': no round wall of radius 3 mm"),
        ('"-z"', '"-z"\nangle = 20.0', "need one feature angle; got 20, 30 degrees"),
        ('at = [40, 40, 0]\nnormal = "-z"', "number = 19", "'foot': the part has 18 faces; got"),
        ("4.0\nmat", "400.0\nmat", "edge length must be above 0 and below 100"),
    ):
        assert old in PART
        path.write_text(PART.replace(old, new))
        with pytest.raises(InputError, match=expected) as caught:
            read_part(path)
        assert str(caught.value).startswith(str(path))
        assert len(caught.value.mistakes) == 1
