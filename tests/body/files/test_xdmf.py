"""XDMF meshes, as DOLFINx writes them: numbers in XML or HDF5, tags of facets, series."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.stress_files import read_stress

INCLUDE = '<xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />'


def item(values, number):
    values = np.asarray(values)
    shape, text = " ".join(map(str, values.shape)), " ".join(map(str, values.ravel().tolist()))
    return f'<DataItem Dimensions="{shape}" NumberType="{number}" Format="XML">{text}</DataItem>'


def topology(kind, cells):
    about = f'TopologyType="{kind}" NumberOfElements="{len(cells)}"'
    about += f' NodesPerElement="{cells.shape[1]}"'
    return f"<Topology {about}>{item(cells, 'Int')}</Topology>"


def document(*grids):
    return (
        '<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n'
        '<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude"><Domain>'
        f"{''.join(grids)}</Domain></Xdmf>\n"
    )


def grid(*parts, name="mesh", kind='GridType="Uniform"'):
    return f'<Grid Name="{name}" {kind}>{"".join(parts)}</Grid>'


@pytest.fixture(scope="module")
def mesh():
    return box_mesh((3.0, 2.0, 1.0), (3, 2, 1))


def body(mesh):
    points = f'<Geometry GeometryType="XYZ">{item(mesh.points, "Float")}</Geometry>'
    return grid(topology("Tetrahedron", mesh.cells), points)


def test_facets_with_tags_become_patches(mesh, tmp_path):
    facets = np.concatenate([mesh.patches["x_min"], mesh.patches["x_max"]])
    numbers = np.repeat([3, 12], [len(mesh.patches["x_min"]), len(mesh.patches["x_max"])])
    tags = f'<Attribute Name="f" AttributeType="Scalar" Center="Cell">{item(numbers, "Int")}'
    tags = grid(INCLUDE, topology("Triangle", facets), f"{tags}</Attribute>", name="tags")
    (tmp_path / "part.xdmf").write_text(document(body(mesh), tags))
    read = read_mesh(tmp_path / "part.xdmf")
    np.testing.assert_allclose(read.points, mesh.points)
    assert read.volumes.sum() == pytest.approx(6.0)
    assert sorted(read.patches) == ["12", "3"]
    for name, x in (("3", 0.0), ("12", 3.0)):
        area, _ = read.facet_areas(read.patch(name))
        assert area.sum() == pytest.approx(2.0)
        assert (read.points[read.patch(name), 0] == x).all()


def test_of_a_series_the_first_step_is_read(mesh, tmp_path):
    moved = body(mesh).replace(item(mesh.points, "Float"), item(mesh.points + 5.0, "Float"))
    series = grid(body(mesh), moved, kind='GridType="Collection" CollectionType="Temporal"')
    (tmp_path / "part.xdmf").write_text(document(series))
    np.testing.assert_allclose(read_mesh(tmp_path / "part.xdmf").points, mesh.points)


@pytest.mark.filterwarnings("ignore:UnstructuredGrid mesh is not valid")
def test_numbers_in_hdf5_are_read_beside_the_file(mesh, tmp_path, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    from vtkmodules.vtkIOXdmf2 import vtkXdmfWriter

    folder = tmp_path / "a folder"
    folder.mkdir()
    monkeypatch.chdir(folder)
    writer = vtkXdmfWriter()
    writer.SetFileName("part.xdmf")
    writer.SetHeavyDataFileName("part.h5")
    writer.SetLightDataLimit(1)
    writer.SetInputData(pyvista.UnstructuredGrid({10: mesh.cells}, mesh.points))
    assert writer.Write()
    assert "part.h5:" in (folder / "part.xdmf").read_text()
    monkeypatch.chdir(tmp_path)
    read = read_mesh(folder / "part.xdmf")
    np.testing.assert_allclose(read.points, mesh.points)
    np.testing.assert_array_equal(read.cells, mesh.cells)
    (folder / "part.h5").unlink()
    with pytest.raises(InputError, match="can be read"):
        read_mesh(folder / "part.xdmf")


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: "<Xdmf></Xdmf>",
        lambda text: text.replace("Tetrahedron", "Hexahedron"),
    ],
)
def test_spoiled_files_are_one_line(mesh, tmp_path, change):
    (tmp_path / "part.xdmf").write_text(change(document(body(mesh))))
    with pytest.raises(InputError, match=r"part\.xdmf") as caught:
        read_mesh(tmp_path / "part.xdmf")
    assert "\n" not in str(caught.value)


def test_stress_of_a_series_by_array_and_step(mesh, tmp_path):
    """As DOLFINx writes it: the mesh by itself, then a step after the other on it."""
    tensors = np.zeros((2, len(mesh.points), 3, 3))
    tensors[0, :, 0, 0] = mesh.points[:, 0]
    tensors[1] = 2.0 * tensors[0]
    topology_of = '<xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Topology)" />'

    def step(values):
        rows = item(values.reshape(-1, 9), "Float")
        field = f'<Attribute Name="sig" AttributeType="Tensor" Center="Node">{rows}</Attribute>'
        return grid(topology_of, INCLUDE, field)

    series = grid(*map(step, tensors), kind='GridType="Collection" CollectionType="Temporal"')
    path = tmp_path / "result.xdmf"
    path.write_text(document(body(mesh), series))
    with pytest.raises(InputError, match="has 2 steps: choose one with --stress-step"):
        read_stress(path, mesh, "Pa", array="sig")
    with pytest.raises(InputError, match="its series has 2 steps, and no step 3"):
        read_stress(path, mesh, "Pa", array="sig", step=3)
    with pytest.raises(InputError, match="no array 'tau'; there are: sig"):
        read_stress(path, mesh, "Pa", array="tau", step=1)
    given = read_stress(path, mesh, "Pa", array="sig", step=2)
    np.testing.assert_allclose(given.nodal[:, 0, 0], 2e-6 * mesh.points[:, 0])
    assert not given.nodal[:, 1:].any()
