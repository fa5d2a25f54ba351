import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.paths.toolpaths import FIBRE, MATRIX, Toolpaths
from ccfem.printing.export.vtk import write_paths

pyvista = pytest.importorskip("pyvista")


def toolpaths():
    points = np.array([[0, 0, 1], [3, 4, 1], [3, 5, 1], [0, 0, 2], [1, 0, 2], [0, 1, 2], [0, 0, 2]])
    return Toolpaths(
        points=points,
        normals=np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        offsets=[0, 3, 7],
        layer=[0, 5],
        kind=[FIBRE, MATRIX],
        closed=[False, True],
        link=[False, True, False, False, False, True, False],
    )


def test_pyvista_reads_the_paths_back(tmp_path):
    paths = toolpaths()
    write_paths(paths, tmp_path / "paths.vtp", {"cost": np.array([1, 2])})
    data = pyvista.read(tmp_path / "paths.vtp")
    np.testing.assert_array_equal(data.points, paths.points)
    np.testing.assert_array_equal(data.lines, [3, 0, 1, 2, 4, 3, 4, 5, 6])
    np.testing.assert_array_equal(data.point_data["normals"], paths.normals)
    np.testing.assert_array_equal(data.point_data["link"], paths.link)
    np.testing.assert_array_equal(data.cell_data["layer"], [0, 5])
    np.testing.assert_array_equal(data.cell_data["kind"], [FIBRE, MATRIX])
    np.testing.assert_array_equal(data.cell_data["closed"], [0, 1])
    np.testing.assert_array_equal(data.cell_data["cost"], [1, 2])
    assert data.cell_data["length"] == pytest.approx([6.0, 2.0 + np.sqrt(2.0)])
    assert data.compute_cell_sizes()["Length"] == pytest.approx(paths.lengths)


def test_what_repeats_is_packed(tmp_path):
    count = 20_000
    points = np.column_stack([np.arange(count) % 100, np.zeros((count, 2))]).astype(float)
    write_paths(flat_paths([points]), tmp_path / "a.vtp")
    np.testing.assert_array_equal(pyvista.read(tmp_path / "a.vtp").points, points)
    # Three coordinates and three of the normal, 8 bytes each.
    assert (tmp_path / "a.vtp").stat().st_size < 0.1 * 48 * count


def test_no_paths(tmp_path):
    write_paths(Toolpaths.empty(), tmp_path / "none.vtp")
    assert pyvista.read(tmp_path / "none.vtp").n_cells == 0
    assert b'type="Int64" Name="connectivity"' in (tmp_path / "none.vtp").read_bytes()


def test_names_are_escaped(tmp_path):
    write_paths(toolpaths(), tmp_path / "a.vtp", {'x < "y" & z': np.array([3.0, 4.0])})
    data = pyvista.read(tmp_path / "a.vtp")
    np.testing.assert_array_equal(data.cell_data['x < "y" & z'], [3.0, 4.0])


def test_refused_data_leaves_no_file(tmp_path):
    with pytest.raises(InputError, match="one value per path, 2 in all; got 7"):
        write_paths(toolpaths(), tmp_path / "a.vtp", path_data={"cost": np.ones(7)})
    with pytest.raises(InputError, match="no folder"):
        write_paths(toolpaths(), tmp_path / "missing" / "a.vtp")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_half_way_leaves_the_old_file(tmp_path):
    target = tmp_path / "a.vtp"
    write_paths(toolpaths(), target)
    before = target.read_bytes()
    with pytest.raises(TypeError):
        write_paths(toolpaths(), target, {"cost": np.array([object()] * 2)})
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtp"]
