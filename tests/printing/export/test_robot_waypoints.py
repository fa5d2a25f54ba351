"""Waypoints for robots: what is written comes back, on a layer that is not flat."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.robot_waypoints import (
    read_layer_waypoints,
    write_layer_waypoints,
    write_robot_waypoints,
)
from ccfem.slicing.slicers import Planar

RADIUS = 30.0


@pytest.fixture(scope="module")
def layer():
    """A layer rolled up, 0.4 mm thick at one end and 0.6 mm at the other."""
    flat = Planar(heights=(1.0,)).cut(box_mesh((60.0, 20.0, 2.0), (60, 20, 1)))[0]
    x, y, _ = flat.points.T
    angle = (x - 30.0) / RADIUS
    points = np.column_stack([RADIUS * np.sin(angle), y, RADIUS * np.cos(angle)])
    return replace(flat, points=points, flat=None, index=7, local_thickness=0.4 + 0.2 * x / 60.0)


@pytest.fixture(scope="module")
def paths(layer):
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    lines, normals = [], []
    for radius in (4.0, 8.0):
        angle, y = radius * np.cos(turn) / RADIUS, 10.0 + radius * np.sin(turn)
        normal = np.column_stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)])
        line = RADIUS * normal + np.column_stack([0.0 * y, y, 0.0 * y])
        line[-1] = line[0]
        lines.append(line)
        normals.append(normal)
    return Toolpaths.in_space(lines, normals, layer)


def test_the_published_format_comes_back(tmp_path, paths, layer):
    write_layer_waypoints(tmp_path / "7.txt", paths, 7)
    table = np.loadtxt(tmp_path / "7.txt")
    assert table.shape == (len(paths.points), 9)
    # As published: third last always 0, second last 1 in the first row only, last 2.
    assert (table[:, 6] == 0.0).all()
    assert table[:, 7].tolist() == [1.0] + [0.0] * (len(table) - 1)
    assert (table[:, 8] == 2.0).all()
    back = read_layer_waypoints(tmp_path / "7.txt", layer)
    assert len(back) == 2
    assert back.closed.all()
    np.testing.assert_allclose(back.lengths, paths.lengths, rtol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(back.normals, axis=1), 1.0)
    assert set(back.layer) == {7}


def test_the_table_has_the_height_of_the_layer_and_the_feed(tmp_path, paths, layer):
    write_robot_waypoints(tmp_path / "p.csv", paths, [layer], Machine(fibre_speed=4.0))
    with (tmp_path / "p.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(paths.points)
    assert {row["layer"] for row in rows} == {"7"}
    assert {row["path"] for row in rows} == {"0", "1"}
    assert {float(row["feed"]) for row in rows} == {4.0}
    angle = np.array([np.arcsin(float(row["x"]) / RADIUS) for row in rows])
    expected = 0.4 + 0.2 * (30.0 + RADIUS * angle) / 60.0
    np.testing.assert_allclose([float(row["height"]) for row in rows], expected, atol=2e-3)


def test_wrong_files_and_layers_are_one_line(tmp_path, paths, layer):
    with pytest.raises(InputError, match="layer 3 has no fibre"):
        write_layer_waypoints(tmp_path / "3.txt", paths, 3)
    with pytest.raises(InputError, match="paths lie on layer 7, which is not among"):
        write_robot_waypoints(tmp_path / "p.csv", paths, [], Machine())
    (tmp_path / "bad.txt").write_text("these are words\n")
    with pytest.raises(InputError, match="is no waypoint file"):
        read_layer_waypoints(tmp_path / "bad.txt", layer)
