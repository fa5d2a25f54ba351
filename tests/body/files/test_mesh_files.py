import os
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista
from facet_sets import facets_as_set
from hypothesis import given, settings, strategies as st

from benchmarks.fuzz.mutants import bdf, medit, unv
from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh, whole_file, write_mesh
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import Plane, match_boundary
from ccfem.geometry.facets import are_among

MIDDLE = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]


def same(found: TetMesh, mesh: TetMesh, exact=True):
    close = np.array_equal if exact else np.allclose
    assert close(found.points, mesh.points)
    assert np.array_equal(found.cells, mesh.cells)
    assert found.patches.keys() == mesh.patches.keys()
    for name, facets in mesh.patches.items():
        assert facets_as_set(found.patches[name]) == facets_as_set(facets)


@pytest.mark.parametrize("suffix", [".tet", ".npz", ".vtu"])
@settings(max_examples=6, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([1, 2]),
    st.text("abcXYZ _-:.é/", min_size=1, max_size=8),
)
def test_round_trip(tmp_path_factory, build_box, suffix, seed, order, name):
    random = np.random.default_rng(seed)
    mesh = build_box((1, 2, 1))
    mesh = TetMesh(mesh.points + 0.1 * random.normal(size=mesh.points.shape), mesh.cells)
    mesh = mesh.quadratic() if order == 2 else mesh
    mesh = mesh.with_patches({name: mesh.boundary[random.choice(len(mesh.boundary), 3, False)]})
    path = tmp_path_factory.mktemp("round") / f"part{suffix}"
    if suffix == ".tet" and order == 2:
        with pytest.raises(InputError, match="linear tetrahedra only"):
            write_mesh(mesh, path)
        assert list(path.parent.iterdir()) == []
        return
    write_mesh(mesh, path)
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    found = read_mesh(path)
    if suffix == ".tet":
        mesh = TetMesh(mesh.points, mesh.cells)
    same(found, mesh)


@pytest.mark.parametrize("suffix", [".npz", ".vtu"])
def test_axes_of_round_patches_are_kept(box, tmp_path, suffix):
    """A rough wall does not show the axis that its rule states: a part that is written keeps it."""
    axis = np.array([0.0, 0.6, 0.8])
    mesh = box.with_patches({"bore: 1": box.boundary[:2]}, {"bore: 1": axis})
    write_mesh(mesh, tmp_path / f"part{suffix}")
    found = read_mesh(tmp_path / f"part{suffix}", scale=25.4)
    assert list(found.axes) == ["bore: 1"]
    np.testing.assert_array_equal(found.axes["bore: 1"], axis)


def test_scale_and_raw_reading(box, tmp_path):
    turned = TetMesh(box.points, box.cells[:, [1, 0, 2, 3]])
    path = tmp_path / "part.npz"
    write_mesh(turned, path)
    assert (read_mesh(path, check=False).volumes < 0).all()
    found = read_mesh(path, scale=1000.0)
    assert np.allclose(found.volumes, -turned.volumes * 1e9)


def test_equal_meshes_make_equal_archives(box, tmp_path):
    for name in ("one.npz", "two.npz"):
        write_mesh(box, tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


@pytest.mark.parametrize("order", [1, 2])
def test_other_programs_read_a_written_grid(tmp_path, box, order):
    mesh = (box if order == 1 else box.quadratic()).with_patches({"Fläche <1>": box.boundary[:5]})
    write_mesh(mesh, tmp_path / "part.vtu")
    theirs, ours = meshio.read(tmp_path / "part.vtu"), pyvista.read(tmp_path / "part.vtu")
    cells = ours.cells_dict[10 if order == 1 else 24]
    for points, nodes in ((theirs.points, theirs.cells[0].data), (ours.points, cells)):
        np.testing.assert_array_equal(points, mesh.points)
        np.testing.assert_array_equal(nodes, mesh.cells)
    for data in (theirs.field_data, ours.field_data):
        np.testing.assert_array_equal(data["patch:Fläche <1>"], box.boundary[:5])
    # Volume and facing of the cells, by VTK: quadratic ones need their nodes in its order.
    volumes = ours.compute_cell_sizes().cell_data["Volume"]
    np.testing.assert_allclose(volumes, mesh.volumes)
    wrong = box.with_patches({"a\x01": box.boundary[:5]})
    with pytest.raises(InputError, match="characters that a file of VTK cannot hold"):
        write_mesh(wrong, tmp_path / "wrong.vtu")
    assert os.listdir(tmp_path) == ["part.vtu"]


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("order", [1, 2])
def test_gmsh_files(tmp_path, version, binary, order):
    """Files that Gmsh itself writes: a group on two faces, one without a name, a name twice."""
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path / "part.msh"
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        volume = gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [volume], 7, "left end")
        gmsh.model.addPhysicalGroup(2, [1], 1, "left end")
        gmsh.model.addPhysicalGroup(2, [1, 2], 3, "both")
        gmsh.model.addPhysicalGroup(2, [2], 42)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
        gmsh.model.removePhysicalGroups([(3, 7)])
        gmsh.write(str(tmp_path / "hollow.msh"))
    finally:
        gmsh.finalize()
    mesh = read_mesh(path)
    assert mesh.order == order
    assert mesh.volumes.sum() == pytest.approx(2.0)
    if order == 2:
        middle = mesh.points[mesh.cells[:, MIDDLE]].mean(axis=2)
        assert np.allclose(mesh.points[mesh.cells[:, 4:]], middle)
        raw = read_mesh(path, check=False)
        assert np.allclose(raw.points[raw.cells[:, 4:]], raw.points[raw.cells[:, MIDDLE]].mean(2))
    left, right = Plane("x", "min")(mesh), Plane("x", "max")(mesh)
    assert facets_as_set(mesh.patches["left end"]) == facets_as_set(left)
    assert facets_as_set(mesh.patches["both"]) == facets_as_set(np.concatenate([left, right]))
    if version == 2.2:
        assert facets_as_set(mesh.patches["42"]) == facets_as_set(right)
    with pytest.raises(InputError, match=r"holds no tetrahedra; it has \d+ triangle.*Physical Vol"):
        read_mesh(tmp_path / "hollow.msh")


def test_gmsh_writes_abaqus(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path / "part.inp"
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        volume = gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [volume], 7, "solid")
        gmsh.model.addPhysicalGroup(2, [1], 1, "Left")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    raw = read_mesh(path, check=False)
    assert np.allclose(raw.points[raw.cells[:, 4:]], raw.points[raw.cells[:, MIDDLE]].mean(2))
    mesh = read_mesh(path)
    assert mesh.volumes.sum() == pytest.approx(2.0)
    assert facets_as_set(mesh.patches["Left"]) == facets_as_set(Plane("x", "min")(mesh))


def test_vtu_of_other_programs(tmp_path, box):
    """Triangles with a number in a cell array become patches; single precision is read."""
    left, right = box.patches["left"], box.patches["right"]
    grid = pyvista.UnstructuredGrid(
        {5: np.concatenate([left, right[:, ::-1]]), 10: box.cells}, box.points.astype(np.float32)
    )
    numbers = np.zeros(grid.n_cells, dtype=np.int32)
    numbers[np.flatnonzero(grid.celltypes == 5)] = np.repeat([1, 2], [len(left), len(right)])
    grid.cell_data["gmsh:physical"] = numbers
    grid.save(tmp_path / "part.vtu")
    mesh = read_mesh(tmp_path / "part.vtu")
    assert facets_as_set(mesh.patches["1"]) == facets_as_set(left)
    assert facets_as_set(mesh.patches["2"]) == facets_as_set(right)
    assert np.array_equal(match_boundary(mesh, right), mesh.patches["2"])


@pytest.mark.parametrize("order", [1, 2])
def test_lagrange_cells_of_low_order_are_the_usual_ones(tmp_path, box, order):
    """As DOLFINx writes them; VTK itself takes the nodes of both for the same places."""
    mesh = box if order == 1 else box.quadratic()
    left = mesh.patches["left"]
    grid = pyvista.UnstructuredGrid({69: left, 71: mesh.cells}, np.array(mesh.points))
    numbers = np.repeat([4, 0], [len(left), len(mesh.cells)])
    grid.cell_data["patch"] = numbers if grid.celltypes[0] == 69 else numbers[::-1]
    grid.save(tmp_path / "part.vtu")
    volumes = grid.compute_cell_sizes().cell_data["Volume"][grid.celltypes == 71]
    found = read_mesh(tmp_path / "part.vtu")
    assert np.array_equal(found.cells, mesh.cells)
    np.testing.assert_allclose(found.volumes, volumes)
    assert facets_as_set(found.patches["4"]) == facets_as_set(left)


@pytest.mark.parametrize("suffix", ["msh", "vtu"])
def test_cells_that_are_given_twice_keep_their_patches(tmp_path, box, suffix):
    left, path = box.patches["left"], tmp_path / f"part.{suffix}"
    cells = [("triangle", left), ("tetra", np.concatenate([box.cells, box.cells[::-1]]))]
    numbers = [np.full(len(nodes), 7) for _, nodes in cells]
    data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
    mesh = meshio.Mesh(box.points, cells, cell_data=data)
    mesh.write(path, **({"file_format": "gmsh22", "binary": False} if suffix == "msh" else {}))
    with pytest.warns(UserWarning, match=f"{len(box.cells)} cells repeated another: taken out"):
        found = read_mesh(path)
    assert facets_as_set(found.patches["7"]) == facets_as_set(left)
    assert np.array_equal(found.cells, box.cells)


def test_a_group_inside_the_part_is_named(tmp_path, box):
    between = box.facets[~are_among(box.facets, box.boundary)][:2]
    write_mesh(box.with_patches({"core": between}), tmp_path / "part.vtu")
    with pytest.warns(UserWarning, match="patches without a facet on the boundary: core"):
        assert len(read_mesh(tmp_path / "part.vtu").patches["core"]) == 0


GOOD_TET = "4 vertices\n1 tets\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n4 0 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.tet", "", "not a .tet mesh"),
        ("a.tet", "solid of something", "not a .tet mesh"),
        ("a.tet", GOOD_TET.replace("4 vertices", "5 vertices"), "19 numbers|in place of"),
        ("a.tet", GOOD_TET.replace("1 0 0", "1 0 x"), "not a .tet mesh"),
        ("a.tet", GOOD_TET.replace("1 0 0", "nan 0 0"), "NaN or infinity"),
        ("a.tet", GOOD_TET.replace("1 0 0", "1e308 0 0"), "within 1e.09 mm; 1 nodes lie farther"),
        ("a.tet", GOOD_TET.replace("4 0 1 2 3", "3 0 1 2 3"), "tetrahedron 0 does not read"),
        ("a.tet", GOOD_TET.replace("4 0 1 2 3", "4 0 1 2 4"), "name nodes 0 to 3"),
        ("a.tet", GOOD_TET.replace("0 0 1\n", "1 1 0\n"), "all 1 cells of the mesh are flat"),
        ("a.tet", "0 vertices\n0 tets\n", "holds no tetrahedra"),
        ("a.msh", "not a mesh at all", "must begin with .MeshFormat"),
        ("a.msh", "$MeshFormat\n9.9 0 8\n$EndMeshFormat\n", "not a Gmsh mesh that can be read"),
        ("a.msh", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 2", "not a Gmsh mesh"),
        ("a.msh", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "it holds no nodes"),
        ("a.vtu", "<xml/>", "not a VTK unstructured grid"),
        ("a.vtu", "<VTKFile type='UnstructuredGrid'><Unstr", "grid that can be read|no tetra"),
        ("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n", "UNSTRUCTURED_GRID"),
        ("a.vtk", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n", "no points"),
        ("a.unv", "something else", "holds no nodes .data set 2411."),
        ("a.unv", "    -1\n  2411\n 1\n 1.0 x 2.0\n    -1\n", "data set 2411 is not as universal"),
        ("a.bdf", "BEGIN BULK\nGRID,1,,0.,0.,x\nCTETRA,1,1,1,2,3,4\n", "not a mesh|no tetra"),
        ("a.nas", "SystemCall 'touch made';", "not a mesh that Gmsh can read|no tetra"),
        ("a.med", "\x89HDF", "not a mesh that Gmsh can read"),
        ("a.mesh", "MeshVersionFormatted 2\nDimension\n3\nEnd\n", "it holds no nodes"),
        ("a.inp", "something else", "no .NODE"),
        ("a.inp", "*NODE\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", "no .NODE with nodes"),
        ("a.npz", "PK nonsense", "not a mesh in a NumPy archive"),
        ("a.step", "ISO-10303", r"must end in \.bdf, \.inp, \.med, \.mesh, \.msh, \.nas, "),
        ("a.stl", "solid a", "is a surface"),
        ("none/a.tet", None, "does not exist"),
    ],
)
def test_bad_files_are_one_line(tmp_path, name, content, message, capfd):
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    if path.suffix in (".bdf", ".nas", ".med", ".mesh"):
        pytest.importorskip("gmsh")
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("name", "order", "named"),
    [
        *(("box.unv", 1, True), ("box.UNV", 2, True), ("box.bdf", 1, False)),
        *(("box.nas", 1, False), ("box.mesh", 1, False)),
    ],
)
def test_meshes_of_other_programs(tmp_path, name, order, named):
    # Written as their specifications say; groups without a name are called by their number.
    if not named:
        pytest.importorskip("gmsh")
    box = box_mesh((3.0, 2.0, 1.0), (2, 2, 1))
    box = box if order == 1 else box.quadratic()
    path = tmp_path / name
    writers = {".unv": unv, ".bdf": bdf, ".nas": bdf, ".mesh": medit}
    path.write_text(writers[path.suffix.lower()](box))
    names = dict(zip(box.patches, (box.patches if named else "123456"), strict=True))
    patches = {names[patch]: facets for patch, facets in box.patches.items()}
    same(read_mesh(path, check=False), TetMesh(box.points, box.cells, patches))


def test_groups_of_nodes_in_a_universal_file(tmp_path):
    # Two triangles of x_min, once as elements and once by their four nodes (members of kind 7).
    box, path = box_mesh((3.0, 2.0, 1.0), (2, 1, 1)), tmp_path / "box.unv"
    nodes = np.unique(box.patch("x_min")) + 1
    rows = [f"{7:10d}{node:10d}{0:10d}{0:10d}" for node in nodes]
    group = [f"{9:10d}" + 6 * f"{0:10d}" + f"{len(rows):10d}", "corners"]
    group += ["".join(rows[i : i + 2]) for i in range(0, len(rows), 2)]
    path.write_text(unv(box) + "\n".join(["    -1", "  2477", *group, "    -1"]) + "\n")
    mesh = read_mesh(path)
    assert facets_as_set(mesh.patch("corners")) == facets_as_set(box.patch("x_min"))
    assert facets_as_set(mesh.patch("x_min")) == facets_as_set(box.patch("x_min"))


def test_a_mesh_of_salome(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    path = tmp_path / "box.med"
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0.0, 0.0, 0.0, 6.0, 3.0, 2.0)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [1], name="body")
        gmsh.model.addPhysicalGroup(2, [1], name="held")  # at x = 0
        gmsh.model.mesh.generate(3)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    mesh = read_mesh(path)
    assert mesh.volumes.sum() == pytest.approx(36.0)
    assert set(mesh.patches) == {"held"}
    corners = mesh.points[mesh.patch("held")]
    assert not corners[:, :, 0].any()
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(sides, axis=1).sum() == pytest.approx(6.0)


def test_good_tet_reads(tmp_path):
    path = tmp_path / "a.tet"
    path.write_text(GOOD_TET.replace("\n", "\r\n"))
    assert read_mesh(path).volumes == pytest.approx([1 / 6])


def test_folder_and_scale(tmp_path):
    with pytest.raises(InputError, match="is a folder"):
        read_mesh(tmp_path)
    path = tmp_path / "a.tet"
    path.write_text(GOOD_TET)
    for scale in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="mesh scale"):
            read_mesh(path, scale=scale)


def test_pickled_archives_are_not_opened(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, points=np.array([{}], dtype=object), cells=np.zeros((1, 4), int))
    with pytest.raises(InputError, match="not a mesh in a NumPy archive"):
        read_mesh(path)
    np.savez(path, points=np.zeros((4, 3)))
    with pytest.raises(InputError, match="must hold the arrays points and cells"):
        read_mesh(path)
    np.savez(path, points=np.array([["a"] * 3] * 4), cells=np.zeros((1, 4), int))
    with pytest.raises(InputError, match="must be numbers"):
        read_mesh(path)


def test_writing_whole_or_not_at_all(tmp_path, box):
    path = tmp_path / "note.txt"
    path.write_text("before")

    def stop_half_way():
        with whole_file(path) as temporary:
            temporary.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        stop_half_way()
    assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["note.txt"]
    with pytest.raises(InputError, match="there is no folder"):
        write_mesh(box, tmp_path / "none" / "a.vtu")
    with pytest.raises(InputError, match="name must end in"):
        write_mesh(box, tmp_path / "a.stl")
    (tmp_path / "b.npz").mkdir()
    with pytest.raises(InputError, match="cannot write"):
        write_mesh(box, tmp_path / "b.npz")
    bad = TetMesh(np.full((4, 3), np.nan), [[0, 1, 2, 3]])
    with pytest.raises(InputError, match="NaN"):
        write_mesh(bad, tmp_path / "c.npz")


@pytest.mark.skipif("CCFEM_CHEN2021" not in os.environ, reason="the authors' data is not here")
def test_the_published_meshes_read():
    """Sizes by Chen et al. 2021, Table 1 (Loop: 32,473 cells, 140 mm) and the files' headers."""
    folder = Path(os.environ["CCFEM_CHEN2021"])
    loop = read_mesh(folder / "Loop" / "Loop.tet")
    assert (len(loop.points), len(loop.cells)) == (6677, 32473)
    assert np.ptp(loop.bounds, axis=0) == pytest.approx([100, 10, 140])
    assert (loop.volumes > 0).all()
    bar = read_mesh(folder / "bar" / "Bar.tet")
    assert (len(bar.points), len(bar.cells)) == (4182, 14722)
