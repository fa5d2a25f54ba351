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
        ("a.step", "", "must end in .obj, .ply, .stl"),
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
