"""Waypoint files: round trip, the published frame, bad files."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.export.waypoints import pattern_of, read_waypoints, write_waypoints
from ccfem.slicing.layers import plane_frame
from ccfem.slicing.slicers.planar import Planar

FILE = """;Layer_CCF: 0
S
X-30.299 Y-5.69385 Z0.25
X-30.1803 Y-6.8864 Z0.25
E
;Layer_CCF: 1
;Layer_CCF: 2
S
X1 Y2 Z1.25
X3 Y2 Z1.25
X3 Y5 Z1.25
X1 Y2.0004 Z1.25
E
"""

ALONG_Y = plane_frame((0.0, 1.0, 0.0))


def write(folder, text):
    path = folder / "paths_raw.txt"
    path.write_text(text)
    return path


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_tool_coordinates_are_x_minus_z_y_of_a_mesh_built_along_y(tmp_path, newline):
    path = tmp_path / "paths_raw.txt"
    path.write_bytes(FILE.replace("\n", newline).encode())
    paths = read_waypoints(path, ALONG_Y)
    assert paths.layer.tolist() == [0, 2]
    assert paths.closed.tolist() == [False, True]
    first, ring = paths
    assert first == pytest.approx(np.array([[-30.299, 0.25, 5.69385], [-30.1803, 0.25, 6.8864]]))
    assert np.array_equal(ring[0], ring[-1])
    assert ring[2] == pytest.approx([3.0, 1.25, -5.0])
    assert (paths.normals == [0.0, 1.0, 0.0]).all()


def test_what_is_written_is_read_again(tmp_path):
    mesh = box_mesh((200.0, 10.0, 90.0), (4, 2, 3), (-100.0, 0.0, -45.0))
    layers = Planar(count=3).cut(mesh, (0.3, 1.0, -0.2))
    rng = np.random.default_rng(0)
    lines = [(rng.random((n, 2)) - 0.5) * [200.0, 90.0] for n in (2, 7, 30)]
    lines[2][-1] = lines[2][0]
    made = Toolpaths.concatenate(
        [Toolpaths.from_plane(lines[:2], layers[0]), Toolpaths.from_plane(lines[2:], layers[2])]
    )
    path = tmp_path / "paths_raw.txt"
    write_waypoints(path, made, layers)
    found = read_waypoints(path, layers[0].plane.frame)
    assert found.points == pytest.approx(made.points, abs=1e-4)
    for name in ("offsets", "layer", "closed", "kind"):
        assert np.array_equal(getattr(found, name), getattr(made, name))
    # A second round changes nothing any more.
    text = path.read_text()
    write_waypoints(path, found, layers)
    assert path.read_text() == text
    assert text.count(";Layer_CCF:") == 3
    assert pattern_of(path) == pattern_of(tmp_path) == ""
    write_waypoints(path, found, layers, "contour_zigzag")
    assert path.read_text() == f";Turns back by design: contour_zigzag\n{text}"
    assert pattern_of(path) == "contour_zigzag"
    assert np.array_equal(read_waypoints(path, layers[0].plane.frame).points, found.points)
    assert [p.name for p in tmp_path.iterdir()] == ["paths_raw.txt"]


def test_only_fibre_is_written(tmp_path):
    layers = Planar(count=1).cut(box_mesh((10.0, 10.0, 2.0), (1, 1, 1)))
    paths = Toolpaths.from_plane([np.eye(2), np.ones((2, 2)) * [[1], [2]]], layers[0])
    write_waypoints(tmp_path / "a.txt", replace(paths, kind=np.array([0, MATRIX])), layers)
    assert len(read_waypoints(tmp_path / "a.txt", layers[0].plane.frame)) == 1


def test_no_path_is_a_file_of_layers_only(tmp_path):
    layers = Planar(count=2).cut(box_mesh((10.0, 10.0, 2.0), (1, 1, 1)))
    write_waypoints(tmp_path / "a.txt", Toolpaths.empty(), layers)
    assert len(read_waypoints(tmp_path / "a.txt", layers[0].plane.frame)) == 0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (FILE.replace("Y-5.69385", "Ynan"), 3),
        (FILE.replace("Y-5.69385", "Y"), 3),
        (FILE.replace("Y-5.69385 ", ""), 3),
        (FILE.replace("X-30.299", "G1 X-30.299"), 3),
        (FILE.replace("X-30.1803 Y-6.8864 Z0.25\n", ""), 4),
        (FILE.replace("S\n", "", 1), 2),
        (FILE.replace(";Layer_CCF: 0\n", ""), 1),
        (FILE.replace(": 1", ": one"), 6),
        ("solid part\n", 1),
    ],
)
def test_bad_lines_are_named(tmp_path, text, line):
    with pytest.raises(InputError, match=rf"paths_raw\.txt, line {line}: expected ';Layer_CCF: i'"):
        read_waypoints(write(tmp_path, text), ALONG_Y)


def test_files_that_cannot_be_read_or_written(tmp_path):
    with pytest.raises(InputError, match="the last path has no 'E'"):
        read_waypoints(write(tmp_path, FILE[:-2]), ALONG_Y)
    with pytest.raises(InputError, match=r"waypoint file .* does not exist"):
        read_waypoints(tmp_path / "missing.txt", ALONG_Y)
    (tmp_path / "binary.txt").write_bytes(b"\xff\xfe\x00S")
    with pytest.raises(InputError, match="must be text in UTF-8"):
        read_waypoints(tmp_path / "binary.txt", ALONG_Y)
    layers = Planar(count=1).cut(box_mesh((10.0, 10.0, 2.0), (1, 1, 1)))
    with pytest.raises(InputError, match=r"cannot write .* there is no folder"):
        write_waypoints(tmp_path / "missing" / "a.txt", Toolpaths.empty(), layers)
    paths = replace(Toolpaths.from_plane([np.eye(2)], layers[0]), layer=np.array([4]))
    with pytest.raises(InputError, match="paths lie on layer 4"):
        write_waypoints(tmp_path / "a.txt", paths, layers)
    assert not (tmp_path / "a.txt").exists()
