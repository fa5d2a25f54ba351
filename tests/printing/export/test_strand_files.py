"""Strands on curved layers in the published formats: OBJ of lines, and rows of numbers."""

from itertools import pairwise

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.printing.export.path_table import read_paths

FRAME = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def obj(*strands):
    """Text of an OBJ file: each piece has points of its own, in any order and direction."""
    pieces = [(a, b) for strand in strands for a, b in pairwise(strand)]
    pieces = [piece[:: (-1) ** k] for k, piece in enumerate(pieces)][::-1]
    text = "".join(f"v {x} {y} {z}\n" for piece in pieces for x, y, z in piece)
    lines = "".join(f"l {2 * k + 1} {2 * k + 2}\n" for k in range(len(pieces)))
    return f"{text}{lines}" + "".join(f"#li {k}\n" for k in range(len(pieces)))


def test_lines_of_an_obj_are_chained_where_they_meet(tmp_path):
    bow = [(x, 0.1 * x * x, 1.0) for x in range(5)]
    ring = [(9.0, 9.0, 2.0), (12.0, 9.0, 2.0), (12.0, 13.0, 2.0), (9.0, 9.0, 2.0)]
    (tmp_path / "10_C8.obj").write_text(obj(bow))
    (tmp_path / "9_C7.obj").write_text(obj(ring, [(0, 0, 0), (0, 0, 3)]))
    paths = read_paths(tmp_path, FRAME)
    # Layers in the order of their numbers; the straight strand is an end, so it comes first.
    assert paths.layer.tolist() == [0, 0, 1]
    np.testing.assert_allclose(paths.lengths[:2], [3.0, 12.0])
    assert paths.closed.tolist() == [False, True, False]
    chain = np.array(list(paths)[2])
    wanted = np.array(bow)
    np.testing.assert_allclose(chain if chain[0, 0] == 0.0 else chain[::-1], wanted)


def test_where_three_lines_meet_strands_end(tmp_path):
    star = [[(0, 0, 0), (float(x), float(y), 0)] for x, y in ((2, 0), (0, 3), (-4, 0))]
    (tmp_path / "a.obj").write_text(obj(*star))
    assert sorted(read_paths(tmp_path / "a.obj", FRAME).lengths) == [2.0, 3.0, 4.0]


def test_rows_of_numbers_are_cut_at_jumps(tmp_path):
    row = "{} 1 2 0 0 1 0 0 2\n"
    places = [0.0, 0.7, 1.4, 40.0, 40.7, 90.0]
    (tmp_path / "20.txt").write_text("".join(row.format(x) for x in places))
    paths = read_paths(tmp_path / "20.txt", FRAME)
    np.testing.assert_allclose(paths.lengths, [1.4, 0.7])
    np.testing.assert_array_equal(paths.points[0], [0.0, 1.0, 2.0])
    turned = read_paths(tmp_path / "20.txt", FRAME, "tool")
    np.testing.assert_allclose(turned.points[0], np.array([0.0, 1.0, 2.0]) @ FRAME)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", "v 0 0 0\nv 1 0 0\n", "has no lines"),
        ("a.obj", "v 0 0 0\nl 1 2\n", "name points that it has not"),
        ("a.obj", "v 0 0\nl 1 2\n", "line 1: expected 'v x y z'"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nl 1 99999999999999999999\n", "name points that it has not"),
        ("a.obj", "v 0 0 0\nv nan 0 0\nl 1 2\n", "name points that it has not"),
        ("a.txt", "0 0 0\n1 0\n", "line 2: expected x, y and z"),
        ("a.txt", "0 0 0\n1 0 inf\n", "line 2: expected x, y and z"),
    ],
)
def test_what_does_not_read_is_one_line(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_paths(tmp_path / name, FRAME)
    assert "\n" not in str(caught.value)


def test_an_empty_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="holds no files of strands"):
        read_paths(tmp_path, FRAME)
    (tmp_path / "1.txt").write_text("\n")
    assert len(read_paths(tmp_path, FRAME)) == 0
