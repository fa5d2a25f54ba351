import io

import numpy as np
import pytest
from PIL import Image

from ccfem.elasticity.problem import Problem, Support
from ccfem.elasticity.stress_field import SolveRecord, StressField
from ccfem.errors import InputError
from ccfem.layers.slicing.planar import Planar
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh
from ccfem.plot.part3d import part_picture, paths_polydata, surface_polydata
from ccfem.toolpaths import Toolpaths

MESH = box_mesh((20.0, 10.0, 4.0), (4, 2, 2))
LINES = [
    np.array([[1.0, 1.0], [9.0, 1.0], [9.0, 5.0]]),
    np.array([[2.0, 8.0], [15.0, 8.0]]),
]
PATHS = Toolpaths.concatenate(
    Toolpaths.from_plane(LINES, layer) for layer in Planar(count=2).cut(MESH)
)


def stress_field(value=5.0):
    nodal = np.zeros((len(MESH.points), 3, 3))
    nodal[:, 0, 0] = value
    cell = np.zeros((len(MESH.cells), 3, 3))
    nothing = np.zeros((len(MESH.points), 3))
    problem = Problem(MESH, isotropic(1000.0, 0.3), (Support("x_min"),))
    record = SolveRecord("none", 0, 0.0, 0.0, 0.0, 0)
    return StressField(problem, "pull", nothing, cell, nodal, nothing, 0.0, record)


def test_paths_keep_their_points_lengths_and_layers():
    values = np.arange(len(PATHS.points), dtype=float)
    data = paths_polydata(PATHS, values)
    assert data.n_cells == 4
    np.testing.assert_array_equal(data.points, PATHS.points)
    np.testing.assert_array_equal(data.point_data["values"], values)
    np.testing.assert_array_equal(data.cell_data["layer"], [0, 0, 1, 1])
    for k, path in enumerate(PATHS):
        np.testing.assert_allclose(data.get_cell(k).points, path)
    assert data.compute_cell_sizes()["Length"] == pytest.approx(PATHS.lengths)


def test_no_paths():
    assert paths_polydata(Toolpaths.empty()).n_cells == 0


def test_surface_has_the_area_of_the_box():
    data = surface_polydata(MESH)
    assert data.area == pytest.approx(2.0 * (200.0 + 80.0 + 40.0))
    assert data.volume == pytest.approx(800.0)
    assert data.n_open_edges == 0


def test_surface_carries_the_tension():
    assert surface_polydata(MESH, stress_field().nodal).point_data["tension"] == pytest.approx(5.0)
    pushed = surface_polydata(MESH, stress_field(-5.0).nodal)
    np.testing.assert_array_equal(pushed.point_data["tension"], 0.0)


def test_part_is_rendered():
    try:
        bare = part_picture(stress_field(), Toolpaths.empty(), size=(200, 150))
    except InputError as refused:
        pytest.skip(str(refused))
    with_paths = part_picture(stress_field(), PATHS, size=(200, 150))
    images = [np.asarray(Image.open(io.BytesIO(b))).astype(int) for b in (bare, with_paths)]
    assert images[0].shape == (150, 200, 3)
    dark = [(image.max(axis=2) < 120).sum() for image in images]
    assert dark[1] > dark[0] + 20
