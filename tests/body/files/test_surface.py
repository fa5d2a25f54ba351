import zipfile

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.files import Surface, read_surface
from ccfem.body.isolated.process import ChildError
from ccfem.body.mesh.check import check_mesh
from ccfem.body.meshing import tetrahedralise


def box_surface(box):
    used, triangles = np.unique(box.boundary, return_inverse=True)
    return box.points[used], triangles.reshape(-1, 3)


def written(points, triangles, path):
    pyvista = pytest.importorskip("pyvista")
    pyvista.PolyData.from_regular_faces(np.array(points), triangles).save(path)
    return path


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply"])
def test_surfaces_read(box, tmp_path, suffix):
    points, triangles = box_surface(box)
    surface = read_surface(written(points, triangles, tmp_path / f"part{suffix}"), scale=10.0)
    assert surface.volume == pytest.approx(6000.0)
    assert len(surface.triangles) == len(triangles)
    assert len(surface.points) == len(points)


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def in_3mf(path, models):
    """Write an archive of models, of which the first is that to start from."""
    with zipfile.ZipFile(path, "w") as archive:
        first = next(iter(models))
        archive.writestr(
            "_rels/.rels",
            f'<Relationships><Relationship Id="r" Target="/{first}" '
            f'Type="{CORE}/3dmodel"/></Relationships>',
        )
        for name, (unit, objects, items) in models.items():
            archive.writestr(
                name,
                f'<?xml version="1.0"?><model unit="{unit}" xmlns="{CORE}" xmlns:p="{PRODUCTION}">'
                f"<resources>{objects}</resources><build>{items}</build></model>",
            )
    return path


def mesh_object(number, points, triangles):
    """Object of a 3MF file with a mesh."""
    rows = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in np.asarray(points).tolist())
    sides = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles.tolist())
    return (
        f'<object id="{number}" type="model"><mesh><vertices>{rows}</vertices>'
        f"<triangles>{sides}</triangles></mesh></object>"
    )


def test_a_3mf_file_is_what_it_builds(box, tmp_path):
    # Boxes of 3 x 2 x 1 inch: one turned by 90 degrees about z and moved by 5 inch along x, one
    # from another model of the archive by a component at twice its size, 10 inch up. Transforms
    # hold rows of a matrix that points are multiplied with from the left (Core Specification 3.3).
    points, triangles = box_surface(box)
    other = '<object id="7"><components><component objectid="3" p:path="/3D/other.model" '
    other += 'transform="2 0 0 0 2 0 0 0 2 0 0 10"/></components></object>'
    items = '<item objectid="1" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/><item objectid="7"/>'
    path = in_3mf(tmp_path / "plate.3mf", {
        "3D/3dmodel.model": ("inch", mesh_object(1, points, triangles) + other, items),
        "3D/other.model": ("inch", mesh_object(3, points, triangles), ""),
    })  # fmt: skip
    surface = read_surface(path)
    assert surface.volume == pytest.approx((6.0 + 48.0) * 25.4**3)
    low, high = surface.points.min(axis=0) / 25.4, surface.points.max(axis=0) / 25.4
    np.testing.assert_allclose([low, high], [[0.0, 0.0, 0.0], [6.0, 4.0, 12.0]], atol=1e-12)
    turned = surface.points[surface.points[:, 2] < 2.0 * 25.4] / 25.4
    np.testing.assert_allclose(turned.min(axis=0), [3.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(turned.max(axis=0), [5.0, 3.0, 1.0], atol=1e-12)


def test_3mf_files_that_cannot_be_read_are_one_line(box, tmp_path):
    points, triangles = box_surface(box)
    good = mesh_object(1, points, triangles)
    loop = '<object id="1"><components><component objectid="1"/></components></object>'
    for objects, item, said in (
        (good, "2", "object 2 is not there"),
        (good.replace('v1="', 'v1="99'), "1", "a triangle names a point that is not there"),
        (good.replace('x="0.0"', 'x="wide"'), "1", "could not convert string to float"),
        (loop, "1", "object 1 is not there, or a part of itself"),
        ('<object id="1"/>', "1", "it builds no object with triangles"),
    ):
        path = in_3mf(
            tmp_path / "a.3mf", {"3D/m.model": ("meter", objects, f'<item objectid="{item}"/>')}
        )
        with pytest.raises(InputError, match=f"not a surface that can be read: .*{said}") as caught:
            read_surface(path)
        assert "\n" not in str(caught.value)
    path.write_text("no archive")
    with pytest.raises(InputError, match="not a surface that can be read: File is not a zip file"):
        read_surface(path)


@pytest.mark.filterwarnings("error")
def test_a_point_beyond_all_measure_is_refused(box):
    points, triangles = box_surface(box)
    for far, message in ((1e308, "must lie within 1e.09 mm"), (np.inf, "must be finite")):
        with pytest.raises(InputError, match=message):
            Surface(np.where(points == points.max(), far, points), triangles)


def test_a_surface_round_nothing_is_refused(box):
    points, triangles = box_surface(box)
    both = np.concatenate([triangles, triangles[:, ::-1]])
    for flat, rows in ((points, both), (points * [1, 1, 0], triangles)):
        with pytest.raises(InputError, match="encloses no volume"):
            Surface(flat, rows)
    assert Surface(points * [1, 1, 1e-6], triangles).volume == pytest.approx(6e-6)


def test_inside_out_surface_is_turned(box):
    points, triangles = box_surface(box)
    assert Surface(points, triangles[:, ::-1]).volume == pytest.approx(6.0)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_an_open_surface_says_where(box, seed, missing):
    """The open edges are those of the missing triangles that no two of them share."""
    points, triangles = box_surface(box)
    random = np.random.default_rng(seed)
    gone = random.choice(len(triangles), missing, replace=False)
    edges: dict[frozenset[int], int] = {}
    for a, b, c in triangles[gone].tolist():
        for edge in ((a, b), (b, c), (c, a)):
            edges[frozenset(edge)] = edges.get(frozenset(edge), 0) + 1
    count = sum(value == 1 for value in edges.values())
    with pytest.raises(InputError, match=f"is open: {count} edges") as caught:
        Surface(points, np.delete(triangles, gone, axis=0))
    assert "mm: close the holes" in str(caught.value)


def test_an_open_file_is_one_line(box, tmp_path):
    points, triangles = box_surface(box)
    path = written(points, triangles[1:], tmp_path / "open.stl")
    with pytest.raises(InputError, match="is open: 3 edges") as caught:
        read_surface(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_turned_triangle_is_named(box):
    points, triangles = box_surface(box)
    triangles[4] = triangles[4][::-1]
    with pytest.raises(InputError, match="3 edges are traversed twice"):
        Surface(points, triangles)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.stl", "nothing here", "is not a surface"),
        ("a.stl", "", "is not a surface"),
        ("a.obj", "v 0 0 0\n", "is not a surface"),
        ("a.ply", "ply\nformat ascii 1.0\n", "is not a surface"),
        ("a.step", "", "must end in .3mf, .obj, .ply, .stl"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite|not a surface"),
    ],
)
def test_bad_surface_files(tmp_path, name, content, message, capfd):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        read_surface(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_missing_surface(tmp_path):
    with pytest.raises(InputError, match=r"surface file .* does not exist"):
        read_surface(tmp_path / "a.stl")


def test_a_closed_surface_is_filled(box, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    points, triangles = box_surface(box)
    mesh = tetrahedralise(Surface(points, triangles), 0.5)
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(6.0, rel=0.01)
    size = np.linalg.norm([3, 2, 1])
    assert np.abs(mesh.bounds - [[0, 0, 0], [3, 2, 1]]).max() < 1e-3 * size
    lengths = np.linalg.norm(
        np.diff(mesh.points[mesh.cells[:, mesh.edges]], axis=2).squeeze(), axis=2
    )
    assert 0.25 < np.median(lengths) < 0.75
    assert check_mesh(mesh)[1].findings == ()
    assert capfd.readouterr().out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("edge_length", [0.0, -1.0, 100.0, float("nan"), 1e-4])
def test_edge_length_has_to_suit(box, edge_length):
    points, triangles = box_surface(box)
    with pytest.raises(InputError, match="edge length"):
        tetrahedralise(Surface(points, triangles), edge_length)


def test_no_mesher_works_for_ever(box, monkeypatch):
    patience = {}

    def endless(function, seconds=None, **arguments):
        patience[function] = seconds
        raise ChildError(f"it takes more than {seconds:.0f} s")

    monkeypatch.setattr("ccfem.body.meshing.volume.find_spec", lambda name: name)
    monkeypatch.setattr("ccfem.body.meshing.volume.in_own_process", endless)
    with pytest.raises(InputError, match="meshing failed: it takes more than 300 s"):
        tetrahedralise(Surface(*box_surface(box)), 1.0)
    assert 30.0 < patience["gmsh_meshing:fill"] < 31.0 < patience["ftetwild:fill"] < 301.0
    points, triangles = box_surface(box)
    beside = points + np.ptp(points, axis=0) * [1, 1, 0]
    place = np.concatenate([points, beside])
    place, number = np.unique(np.round(place, 9), axis=0, return_inverse=True)
    both = number.reshape(-1)[np.concatenate([triangles, triangles + len(points)])]
    patience.clear()
    with pytest.raises(InputError, match="meshing failed"):
        tetrahedralise(Surface(place, both), 1.0)
    assert list(patience) == ["ftetwild:fill"]  # Gmsh is not for what touches itself


def test_a_mesh_that_lost_the_part_is_refused(box, monkeypatch):
    """fTetWild fills a needle of 80 x 0.1 x 0.1 mm with two cells at one end, or crashes."""
    points, triangles = box_surface(box)
    corner = np.concatenate([np.zeros((1, 3)), np.eye(3)])

    def one_cell(*_, **__):
        return {"points": corner, "cells": np.array([[0, 1, 2, 3]])}

    monkeypatch.setattr("ccfem.body.meshing.volume.in_own_process", one_cell)
    with pytest.raises(InputError, match=r"has 2.8% of its volume"):  # 1/6 of 6
        tetrahedralise(Surface(points, triangles), 0.5, "ftetwild")
