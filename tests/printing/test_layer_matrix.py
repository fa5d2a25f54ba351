"""Matrix of curved layers: what it lays is the volume of the layers."""

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.machine import Machine
from ccfem.paths.toolpaths import MATRIX
from ccfem.printing.curved_stack import layer_matrix
from ccfem.printing.export.robot_waypoints import write_robot_waypoints
from ccfem.slicing.layers.level_surfaces import level_surfaces

MACHINE = Machine(matrix_width=0.8, matrix_speed=11.0)


@pytest.fixture(scope="module")
def layers():
    """Two levels of a field over 40 x 20 x 6 mm that bends, and is steeper at one end."""
    mesh = box_mesh((40.0, 20.0, 6.0), (20, 10, 6))
    x, _, z = mesh.points.T
    values = (z - 1.0 - 0.002 * (x - 20.0) ** 2) * (1.0 + 0.01 * x)
    return level_surfaces(mesh, values, np.array([1.0, 2.0]), 0.5, 0.6, 5.0).layers


def test_lines_fill_the_layers(layers):
    paths = layer_matrix(layers, MACHINE)
    assert set(paths.kind.tolist()) == {MATRIX}
    assert paths.closed.all()
    for layer in layers:
        mine = paths.on_layer(layer.index)
        away = nearest_on_triangles(layer.points, layer.triangles, mine.points).distance
        assert away.max() < 1e-6
        # Width times length is the area, but for the corners and the middle.
        covered = MACHINE.matrix_width * mine.lengths.sum()
        assert covered == pytest.approx(layer.areas.sum(), rel=0.03)


def test_volume_by_the_heights_of_the_waypoints_is_that_of_the_layers(layers, tmp_path):
    file = tmp_path / "matrix.csv"
    write_robot_waypoints(file, layer_matrix(layers, MACHINE), layers, MACHINE, MATRIX)
    table = np.loadtxt(file, delimiter=",", skiprows=1)
    same = (np.diff(table[:, 0]) == 0) & (np.diff(table[:, 1]) == 0)
    length = np.linalg.norm(np.diff(table[:, 2:5], axis=0), axis=1)[same]
    height = (0.5 * (table[1:, 8] + table[:-1, 8]))[same]
    volume = MACHINE.matrix_width * (length * height).sum()
    expected = sum(
        layer.areas @ layer.local_thickness[layer.triangles].mean(axis=1) for layer in layers
    )
    assert volume == pytest.approx(expected, rel=0.03)
    assert height.max() > 1.2 * height.min()
    assert (table[:, 9] == 11.0).all()


def test_no_layers_have_no_matrix():
    assert len(layer_matrix((), MACHINE)) == 0
