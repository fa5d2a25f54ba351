"""Paths of other programs: tables and waypoints, in the frame of the mesh or of the tool."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.printing.export.path_table import read_path_table, read_paths
from ccfem.slicing.layers import plane_frame

UP = np.array([0.0, 0.0, 1.0])
TABLE = """x,y,z,path,layer
0,1,2,7,0
10,1,2,7,0
0,5,2,3,0
4,5,2,3,0
4,9,2,3,0
0,5,2,3,0
0,1,3,9,1
6,1,3,9,1
"""


@pytest.fixture
def written(tmp_path):
    def write(text, name="paths.csv"):
        file = tmp_path / name
        file.write_text(text)
        return file

    return write


def test_a_table_is_read_point_by_point(written):
    paths = read_path_table(written(TABLE), np.eye(3), UP)
    assert [path.tolist() for path in paths] == [
        [[0, 1, 2], [10, 1, 2]],
        [[0, 5, 2], [4, 5, 2], [4, 9, 2], [0, 5, 2]],
        [[0, 1, 3], [6, 1, 3]],
    ]
    assert paths.layer.tolist() == [0, 0, 1]
    assert paths.closed.tolist() == [False, True, False]
    np.testing.assert_array_equal(paths.normals, np.tile(UP, (8, 1)))


def test_columns_come_in_any_order_and_others_are_left(written):
    text = "layer,speed,z,y,x,path\n0,5,2,1,0,7\n0,5,2,1,10,7\n\n"
    paths = read_path_table(written(text), np.eye(3), UP)
    assert paths.points.tolist() == [[0, 1, 2], [10, 1, 2]]


def test_the_frame_is_named(written):
    """A part built along y: the tool's X, Y, Z are x, -z, y of the mesh."""
    frame, file = plane_frame((0.0, 1.0, 0.0)), written(TABLE)
    np.testing.assert_allclose(read_paths(file, frame).points[1], [10.0, 1.0, 2.0])
    tool = read_paths(file, frame, "tool")
    np.testing.assert_allclose(tool.points[1], [10.0, 2.0, -1.0])
    np.testing.assert_allclose(tool.normals[0], [0.0, 1.0, 0.0])
    waypoints = written(";Layer_CCF: 0\nS\nX0 Y1 Z2\nX10 Y1 Z2\nE\n", "way.txt")
    np.testing.assert_allclose(read_paths(waypoints, frame).points[1], [10.0, 2.0, -1.0])
    np.testing.assert_allclose(read_paths(waypoints, frame, "mesh").points[1], [10.0, 1.0, 2.0])
    with pytest.raises(InputError, match="'mesh' or 'tool'; got 'bed'"):
        read_paths(file, frame, "bed")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x,y,z,layer\n0,0,0,0\n", "path not there"),
        ("x,y,z,path,layer\n0,0,zero,1,0\n", r"line 2: expected numbers .*; got '0,0,zero,1,0'"),
        ("x,y,z,path,layer\n0,0,0,1.5,0\n", "the last two whole"),
        ("x,y,z,path,layer\n0,0,nan,1,0\n", "line 2"),
        ("x,y,z,path,layer\n0,0,0,1e300,0\n", "line 2"),
        ("x,y,z,path,layer\n0,0\n", "line 2"),
        ("x,y,z,path,layer\n0,0,0,1,0\n", "path 1 has one point"),
        ("x,y,z,path,layer\n0,0,0,1,0\n1,0,0,1,1\n", "a path lies on one layer"),
        (TABLE + "0,1,2,7,0\n9,1,2,7,0\n", "those of a path are apart"),
    ],
)
def test_a_bad_table_is_one_line(written, text, said):
    with pytest.raises(InputError, match=said) as found:
        read_path_table(written(text), np.eye(3), UP)
    assert "\n" not in str(found.value)


def test_points_beyond_any_printer_are_refused(written):
    table = written("x,y,z,path,layer\n0,0,0,1,0\n1e30,0,0,1,0\n")
    with pytest.raises(InputError, match=r"within 100000 mm; got a coordinate of 1e\+30 mm"):
        read_paths(table, np.eye(3))
    waypoints = written(";Layer_CCF: 0\nS\nX0 Y1e9 Z2\nX10 Y1 Z2\nE\n", "way.txt")
    with pytest.raises(InputError, match=r"got a coordinate of 1e\+09 mm"):
        read_paths(waypoints, np.eye(3))


def test_paths_without_length_are_refused(written):
    table = written(TABLE + "3,4,3,11,1\n3,4,3,11,1\n")
    with pytest.raises(InputError, match=r"1 of 4 paths have no length, the first at \(3, 4, 3\)"):
        read_paths(table, np.eye(3))


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        read_paths(tmp_path / "nothing.csv", np.eye(3))
