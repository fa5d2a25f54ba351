"""Hexahedra, wedges and pyramids as tetrahedra: volumes, faces that agree, exact stress."""

from types import SimpleNamespace

import numpy as np
import pytest
import pyvista

from benchmarks.fuzz.mutants import frd
from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.files.cells import CELL_FACES, outside, tetrahedra, triangles_of
from ccfem.body.mesh.check import check_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity import Problem, Support, Traction, solve
from ccfem.fem.materials import isotropic
from ccfem.fem.stress_files import read_stress

SIDES = {
    8: np.array([[0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3], [1, 2, 3, 0, 5, 6, 7, 4, 4, 5, 6, 7]]).T,
    6: np.array([[0, 1, 2, 3, 4, 5, 0, 1, 2], [1, 2, 0, 4, 5, 3, 3, 4, 5]]).T,
}
"""Sides in the order of VTK's manual."""


def bricks(counts=(3, 2, 2), seed=0):
    """Nodes of a 3 x 2 x 2 mm box of hexahedra, inner ones moved and numbered at random."""
    chance = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1.0) for n in counts), indexing="ij"), axis=-1)
    inner = (slice(1, -1),) * 3
    grid[inner] += chance.uniform(-0.2, 0.2, grid[inner].shape)
    number = chance.permutation(grid[..., 0].size).reshape(grid.shape[:3])
    points = np.empty((number.size, 3))
    points[number.ravel()] = grid.reshape(-1, 3)
    corner = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1)]
    cells = [
        number[tuple(slice(d, number.shape[k] - 1 + d) for k, d in enumerate(at))].ravel()
        for at in [*corner, (0, 1, 1)]
    ]
    return points, np.stack(cells, axis=1)


def wedges(points, cells):
    return np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])


def quadratic(points, cells):
    """The same cells with nodes in the middle of their sides."""
    ends = np.sort(cells[:, SIDES[cells.shape[1]]].reshape(-1, 2), axis=1)
    sides, at = np.unique(ends, axis=0, return_inverse=True)
    middles = len(points) + at.reshape(len(cells), -1)
    return np.concatenate([points, points[sides].mean(axis=1)]), np.column_stack([cells, middles])


KINDS = {
    "hexahedron": bricks(),
    "hexahedron20": quadratic(*bricks()),
    "wedge": (bricks()[0], wedges(*bricks())),
    "wedge15": quadratic(bricks()[0], wedges(*bricks())),
}


@pytest.mark.parametrize("kind", KINDS)
def test_split_cells_fill_the_box_and_meet_face_to_face(kind):
    points, cells = KINDS[kind]
    split = tetrahedra(points, [(kind, cells)], "box")
    mesh = TetMesh(split.points, split.cells)
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(12.0)
    assert len(split.cells) == len(cells) * (6 if kind.startswith("hexa") else 3)
    assert not len(mesh.curved)  # straight cells make straight ones
    _, report = check_mesh(mesh)
    assert (report.hanging, report.components, report.turned) == (0, 1, 0)
    # Each cell keeps its volume; every facet of the outside is one of two of a face of a cell.
    facets = [
        triangles_of(cells[:, face]) for face in CELL_FACES[8 if kind.startswith("hexa") else 6]
    ]
    wanted = {frozenset(t) for t in np.concatenate(facets).tolist()}
    assert {frozenset(t) for t in outside(mesh).tolist()} <= wanted
    shares = np.bincount(split.parent, mesh.volumes)
    assert shares.sum() == pytest.approx(12.0)
    assert len(shares) == len(cells)


@pytest.mark.parametrize("kind", KINDS)
def test_a_uniform_stress_passes_split_cells_exactly(kind):
    points, cells = KINDS[kind]
    split = tetrahedra(points, [(kind, cells)], "box")
    mesh = TetMesh(split.points, split.cells)
    border = mesh.boundary
    for k, (axis, level) in enumerate(((0, 0.0), (1, 0.0), (2, 0.0), (0, 3.0))):
        on = np.isclose(mesh.points[border, axis], level).all(axis=1)
        mesh = mesh.with_patches({f"{k}": border[on]})
    supports = tuple(Support(f"{k}", "xyz"[k]) for k in range(3))
    loads = {"pull": (Traction("3", (2.0, 0.0, 0.0)),)}
    order = 1 if kind in ("hexahedron", "wedge") else 2
    field = solve(Problem(mesh, isotropic(1000.0, 0.3), supports, loads, order=order))["pull"]
    wanted = np.zeros((3, 3))
    wanted[0, 0] = 2.0
    np.testing.assert_allclose(field.stress, np.broadcast_to(wanted, field.stress.shape), atol=1e-9)
    # u = sigma / E (x, -nu y, -nu z).
    exact = mesh.points * [2e-3, -0.6e-3, -0.6e-3]
    np.testing.assert_allclose(field.displacement, exact, atol=1e-12)


def test_curved_sides_keep_the_volume_of_their_cell():
    # A quarter of a tube, radii 1 and 2, of two 20-node cells: middles of sides on the circles.
    angles = np.linspace(0.0, np.pi / 2, 3)
    points = np.array(
        [[r * np.cos(a), r * np.sin(a), z] for z in (0.0, 1.0) for r in (1.0, 2.0) for a in angles]
    )
    cells = np.array([[0, 3, 4, 1, 6, 9, 10, 7], [1, 4, 5, 2, 7, 10, 11, 8]])
    points, cells = quadratic(points, cells)
    before = np.hypot(*points[:, :2].T)
    on_arc = ~np.isclose((2.0 * before + 0.5) % 1.0, 0.5)
    points[:, :2] *= (np.where(on_arc, np.ceil(before), before) / before)[:, None]
    split = tetrahedra(points, [("hexahedron20", cells)], "tube")
    mesh = TetMesh(split.points, split.cells)
    # 3 pi / 4 between circles; arcs of 45 degrees as parabolas miss it by less than 1e-3.
    assert mesh.volumes.sum() == pytest.approx(0.75 * np.pi, rel=1e-3)
    assert mesh.flaw == ""


def test_pyramids_between_hexahedra_and_tetrahedra():
    # A cube as six pyramids over its middle, one of them halved into tetrahedra.
    cube = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    points = np.concatenate([cube, [[0.5, 0.5, 0.5]]]).astype(float)
    faces = np.array(CELL_FACES[8])
    pyramids = np.column_stack([faces[1:], np.full(5, 8)])
    halves = np.column_stack([triangles_of(faces[:1]), [8, 8]])
    split = tetrahedra(points, [("tetra", halves), ("pyramid", pyramids)], "cube")
    mesh = TetMesh(split.points, split.cells)
    assert mesh.volumes.sum() == pytest.approx(1.0)
    assert len(mesh.boundary) == 12
    assert split.said.startswith("5 pyramids are split into 10 tetrahedra")
    np.testing.assert_array_equal(split.parent, [0, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6])


def test_a_collapsed_hexahedron_is_a_wedge():
    points, cells = bricks((1, 1, 1))
    cells[:, [3, 7]] = cells[:, [2, 6]]
    split = tetrahedra(points, [("hexahedron", cells)], "wedge")
    mesh = TetMesh(split.points, split.cells)
    assert len(split.cells) == 3
    assert mesh.volumes.sum() == pytest.approx(0.5)


def test_cells_of_a_grid_with_quadrangles_as_patches(tmp_path):
    points, cells = bricks()
    quads = np.concatenate([cells[:, face] for face in CELL_FACES[8]])
    foot = quads[(points[quads, 0] == 0.0).all(axis=1)]
    grid = pyvista.UnstructuredGrid({12: cells, 9: foot}, points)
    grid.cell_data["patch"] = np.where(grid.celltypes == 9, 7, 0)
    grid.save(tmp_path / "box.vtu")
    with pytest.warns(UserWarning, match="12 hexahedra are split into 72 tetrahedra"):
        mesh = read_mesh(tmp_path / "box.vtu")
    assert mesh.volumes.sum() == pytest.approx(12.0)
    area, _ = mesh.facet_areas(mesh.patch("7"))
    assert area.sum() == pytest.approx(4.0)


def test_a_universal_file_of_quadratic_hexahedra_and_quadrangles(tmp_path):
    """Nodes go round the lower corners, up the sides, and round the upper corners."""
    points, cells = quadratic(*bricks())
    around = [0, 8, 1, 9, 2, 10, 3, 11, 16, 17, 18, 19, 4, 12, 5, 13, 6, 14, 7, 15]
    foot = cells[(points[cells[:, [0, 3, 7, 4]], 0] == 0.0).all(axis=1)]
    quads = foot[:, [0, 11, 3, 19, 7, 15, 4, 16]]
    lines = ["    -1", "  2411"]
    for k, (x, y, z) in enumerate(points.tolist(), 1):
        lines += [f"{k:10d}{1:10d}{1:10d}{11:10d}", f"{x:25.16E}{y:25.16E}{z:25.16E}"]
    lines += ["    -1", "    -1", "  2412"]
    rows = [(116, nodes) for nodes in cells[:, around].tolist()]
    rows += [(95, nodes) for nodes in quads.tolist()]
    for k, (kind, nodes) in enumerate(rows, 1):
        lines.append(f"{k:10d}{kind:10d}{1:10d}{1:10d}{7:10d}{len(nodes):10d}")
        row = "".join(f"{node + 1:10d}" for node in nodes)
        lines += [row[start : start + 80] for start in range(0, len(row), 80)]
    members = [f"{8:10d}{k:10d}{0:10d}{0:10d}" for k in range(len(cells) + 1, len(rows) + 1)]
    lines += ["    -1", "    -1", "  2467", f"{1:10d}" + 6 * f"{0:10d}" + f"{len(members):10d}"]
    lines += ["foot", *("".join(members[i : i + 2]) for i in range(0, len(members), 2)), "    -1"]
    (tmp_path / "box.unv").write_text("\n".join(lines) + "\n")
    with pytest.warns(UserWarning, match="12 hexahedra are split into 72 tetrahedra"):
        mesh = read_mesh(tmp_path / "box.unv")
    assert mesh.order == 2
    assert mesh.volumes.sum() == pytest.approx(12.0)
    assert not len(mesh.curved)
    area, _ = mesh.facet_areas(mesh.patch("foot"))
    assert area.sum() == pytest.approx(4.0)


def test_stress_on_hexahedra_goes_to_their_tetrahedra(tmp_path):
    points, cells = bricks()
    grid = pyvista.UnstructuredGrid({12: cells}, points)
    grid.save(tmp_path / "mesh.vtu")
    with pytest.warns(UserWarning, match="are split"):
        mesh = read_mesh(tmp_path / "mesh.vtu")
    # The file has its cells and nodes in another order.
    chance = np.random.default_rng(2)
    new, order = chance.permutation(len(points)), chance.permutation(len(cells))
    moved = np.empty_like(points)
    moved[new] = points
    again = pyvista.UnstructuredGrid({12: new[cells[order]]}, moved)
    again.cell_data["stress"] = np.zeros((len(cells), 9))
    again.cell_data["stress"][:, 0] = order
    again.point_data["stress"] = np.column_stack([moved[:, 0], np.zeros((len(points), 8))])
    again.save(tmp_path / "result.vtu")
    given = read_stress(tmp_path / "result.vtu", mesh, "MPa")
    np.testing.assert_allclose(given.stress[:, 0, 0], np.repeat(np.arange(len(cells)), 6))
    np.testing.assert_allclose(given.nodal[:, 0, 0], mesh.points[:, 0])
    # The same at the nodes from a file of CalculiX, in which its first type of elements is he8.
    table = np.column_stack([moved[:, 0], np.zeros((len(points), 5))])
    model = SimpleNamespace(points=moved, cells=new[cells[order]])
    (tmp_path / "result.frd").write_text(frd(model, table, kind=1))
    given = read_stress(tmp_path / "result.frd", mesh)
    np.testing.assert_allclose(given.nodal[:, 0, 0], mesh.points[:, 0], rtol=1e-5)


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ([("hexahedron", (1, 8)), ("tetra10", (1, 10))], "linear or with quadratic cells"),
        ([("hexahedron", (1, 6))], "a hexahedron has 8 nodes, and the file gives 6"),
        ([("polyhedron 7", (1, 8)), ("tetra", (1, 4))], "which are not split into tetrahedra"),
        ([("wedge", (2, 6))], "cells must name nodes 0 to 7"),
    ],
)
def test_cells_that_cannot_be_split(blocks, message):
    filled = [(kind, np.arange(np.prod(shape)).reshape(shape)) for kind, shape in blocks]
    with pytest.raises(InputError, match=message):
        tetrahedra(np.zeros((8, 3)), filled, "part.vtu")


def test_cells_of_27_nodes_in_a_deck(tmp_path):
    """Their centres of faces and of the cell are not needed: the volume is that of the cube."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    corners = np.concatenate([corners, corners + np.array([0, 0, 1])])
    sides = [[0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3], [1, 2, 3, 0, 5, 6, 7, 4, 4, 5, 6, 7]]
    faces = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    middles, centres = corners[sides].mean(axis=0), corners[faces].mean(axis=1)
    points = 2.0 * np.concatenate([corners, middles, corners.mean(axis=0)[None], centres])
    rows = "".join(f"{k}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(points.tolist(), 1))
    nodes = ", ".join(map(str, range(1, 28)))
    text = f"*NODE\n{rows}*ELEMENT, TYPE=C3D27\n1, {nodes}\n*SURFACE, NAME=top\n1, S2\n"
    (tmp_path / "cube.inp").write_text(text)
    with pytest.warns(UserWarning, match="split"):
        mesh = read_mesh(tmp_path / "cube.inp")
    assert mesh.order == 2
    assert mesh.volumes.sum() == pytest.approx(8.0)
    area, normal = mesh.facet_areas(mesh.patches["top"])
    assert area.sum() == pytest.approx(4.0)
    np.testing.assert_allclose(normal, np.tile([0.0, 0.0, 1.0], (len(normal), 1)), atol=1e-12)
