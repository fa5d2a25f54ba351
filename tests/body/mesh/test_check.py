import numpy as np
import pytest
from facet_sets import facets_as_set
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.check import check_mesh

INSIDE_OUT = {1: [1, 0, 2, 3], 2: [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]}
"""Corners 0 and 1 swapped, with the mid-side nodes of edges 01, 12, 02, 03, 13, 23 that follow."""


def midsides_are_right(mesh):
    ends = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]
    return np.allclose(mesh.points[mesh.cells[:, 4:]], mesh.points[mesh.cells[:, ends]].mean(2))


def test_a_sound_mesh_comes_back_itself(box):
    for mesh in (box, box.quadratic()):
        mended, report = check_mesh(mesh)
        assert mended is mesh
        assert report.findings == ()
        assert (report.nodes, report.cells) == (len(mesh.points), len(mesh.cells))
        assert report.components == 1


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2]))
def test_shuffled_moved_and_turned_cells_are_mended(build_box, seed, order):
    """Renumbering, moving and turning cells inside out leaves volumes, boundary and patches."""
    random = np.random.default_rng(seed)
    mesh = build_box((2, 2, 1))
    mesh = mesh.quadratic() if order == 2 else mesh
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    points = mesh.points @ turn.T + random.normal(size=3)
    nodes, cells = random.permutation(len(points)), random.permutation(len(mesh.cells))
    number = np.argsort(nodes)
    new_cells = number[mesh.cells][cells]
    turned = random.random(len(new_cells)) < 0.4
    new_cells[turned] = new_cells[turned][:, INSIDE_OUT[order]]
    patches = {
        name: random.permuted(number[facets], axis=1) for name, facets in mesh.patches.items()
    }
    mended, report = check_mesh(TetMesh(points[nodes], new_cells, patches))
    assert report.turned == turned.sum()
    assert np.allclose(mended.volumes, mesh.volumes[cells])
    assert facets_as_set(nodes[mended.boundary]) == facets_as_set(mesh.boundary)
    for name, facets in mesh.patches.items():
        assert facets_as_set(nodes[mended.patches[name]]) == facets_as_set(facets)
    assert order == 1 or midsides_are_right(mended)
    # The outward boundary of a closed body holds its volume (divergence theorem).
    area, normal = mended.facet_areas(mended.boundary)
    centre = mended.points[mended.boundary].mean(axis=1)
    assert np.einsum("i,ij,ij->", area, normal, centre) / 3 == pytest.approx(6.0)


def test_flat_repeated_and_unused_are_taken_out(box):
    n = len(box.points)
    points = np.concatenate([[[9.0, 9, 9], [np.nan, 0, 0]], box.points])
    flat = box.boundary[:3]
    flat = np.column_stack([flat, flat[:, 0]])
    cells = np.concatenate([box.cells, box.cells[5:7], flat]) + 2
    cells[-5] = cells[-5][[1, 0, 3, 2]]
    patches = {name: facets + 2 for name, facets in box.patches.items()}
    mended, report = check_mesh(TetMesh(points, cells, patches))
    assert (report.flat, report.repeated, report.unused) == (3, 2, 2)
    assert (report.nodes, report.cells) == (n, len(box.cells))
    assert len(report.findings) == 3
    assert np.array_equal(mended.points, box.points)
    assert np.array_equal(mended.cells, box.cells)
    assert facets_as_set(mended.patches["left"]) == facets_as_set(box.patches["left"])


def test_patch_moves_under_a_flat_cell_on_the_boundary():
    """A flat cell of four nodes in the plane x = 0 covers two facets that carry the load."""
    points = np.array([[0.0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [-1, 0.5, 0.5]])
    solid = [[4, 0, 1, 2], [4, 0, 2, 3]]
    flat = [[0, 1, 2, 3]]
    upper = np.array([[0, 1, 3], [1, 2, 3]])
    mended, report = check_mesh(TetMesh(points, solid + flat, {"load": upper}))
    assert report.flat == 1
    assert report.dropped == 0
    assert facets_as_set(mended.patches["load"]) == {frozenset({0, 1, 2}), frozenset({0, 2, 3})}


def test_thin_but_solid_cells_stay():
    """One micrometre thick and 1 mm wide is thin, not flat."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1e-3]])
    _, report = check_mesh(TetMesh(points, [[0, 1, 2, 3]]))
    assert report.flat == 0


def test_pieces_and_coincident_nodes(box):
    n = len(box.points)
    beside = box.points + np.array([3.0, 0, 0])
    mesh = TetMesh(np.concatenate([box.points, beside]), np.concatenate([box.cells, box.cells + n]))
    left, report = check_mesh(mesh)
    on_joint = int((box.points[:, 0] == 0).sum())
    assert (report.components, report.coincident, report.merged) == (2, on_joint, False)
    assert left is mesh
    assert any("2 separate pieces" in line for line in report.findings)
    joined, report = check_mesh(mesh, merge=True)
    assert (report.components, report.coincident, report.merged) == (1, on_joint, True)
    assert len(joined.points) == 2 * n - on_joint
    assert joined.volumes.sum() == pytest.approx(12.0)
    assert joined.facet_areas(joined.boundary)[0].sum() == pytest.approx(2 * (12 + 6 + 2))


def test_merging_keeps_patches(box):
    n = len(box.points)
    mesh = TetMesh(
        np.concatenate([box.points, box.points + np.array([3.0, 0, 0])]),
        np.concatenate([box.cells, box.cells + n]),
        {"end": box.patches["right"] + n, "joint": box.patches["right"]},
    )
    joined, report = check_mesh(mesh, merge=True)
    assert len(joined.patches["end"]) == len(box.patches["right"])
    assert (joined.points[joined.patches["end"]][..., 0] == 6.0).all()
    assert len(joined.patches["joint"]) == 0
    assert report.dropped == len(box.patches["right"])


def test_curved_sides_stay_unless_they_fold_a_cell(box):
    quadratic = box.quadratic()
    points = np.array(quadratic.points)
    points[-3:] += 0.01
    mended, report = check_mesh(TetMesh(points, quadratic.cells, quadratic.patches))
    assert report.moved == 0
    np.testing.assert_array_equal(mended.points, points)
    # Pulled beyond a quarter of its edge, a middle folds the cells there.
    node = quadratic.cells[0, 4]
    start, end = quadratic.points[quadratic.cells[0, :2]]
    points = np.array(quadratic.points)
    points[node] += 0.4 * (end - start)
    mended, report = check_mesh(TetMesh(points, quadratic.cells, quadratic.patches))
    length = 0.4 * np.linalg.norm(end - start)
    assert (report.moved, report.farthest) == (1, pytest.approx(length))
    assert any(f"by up to {length:.3g} mm" in line for line in report.findings)
    np.testing.assert_allclose(mended.points, quadratic.points, atol=1e-12)


def two_blocks(divisions):
    """Two cubes that touch at x = 10, the second divided as given, the first in 2 x 2 x 2."""
    one = box_mesh((10.0, 10.0, 10.0), (2, 2, 2))
    other = box_mesh((10.0, 10.0, 10.0), divisions, (10.0, 0.0, 0.0))
    cells = np.concatenate([one.cells, other.cells + len(one.points)])
    return TetMesh(np.concatenate([one.points, other.points]), cells)


def test_pieces_that_do_not_match_are_not_joined():
    # Of the 16 nodes of the second cube 4 lie on corners of the first, whose 9 nodes hang there.
    mesh = two_blocks((3, 3, 3))
    _, report = check_mesh(mesh)
    assert report.hanging == 16 - 4 + 9 - 4
    assert any("17 nodes hang on a facet of another cell" in line for line in report.findings)
    with pytest.raises(InputError, match="the pieces cannot be joined: 17 nodes hang"):
        check_mesh(mesh, merge=True)
    assert check_mesh(two_blocks((2, 2, 2)), merge=True)[1].hanging == 0


def test_a_node_in_the_middle_of_a_facet_or_a_side_hangs():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    for touching, hangs in (([0.2, 0.3], 1), ([0.5, 0.5], 1), ([0.6, 0.5], 0)):
        other = np.array([[*touching, 0.0], [0, 0, -2], [1, 0, -2], [0, 1, -2]])
        cells = [[0, 1, 2, 3], [4, 5, 6, 7]]
        _, report = check_mesh(TetMesh(np.concatenate([corner, other]), cells))
        assert report.hanging == hangs


def test_what_nothing_can_follow_from(box):
    points = np.array(box.points)
    points[4, 1] = np.nan
    with pytest.raises(InputError, match="1 nodes have NaN or infinity, the first is node 4"):
        check_mesh(TetMesh(points, box.cells))
    with pytest.raises(InputError, match="all 72 cells of the mesh are flat"):
        check_mesh(TetMesh(box.points * [1, 1, 0], box.cells))
    third = np.concatenate([box.points, [[0.3, 0.3, -1.0], [0.3, 0.3, -2.0]]])
    n = len(box.points)
    facet = box.boundary[(box.points[box.boundary][..., 2] == 0).all(axis=1)][0]
    extra = [[*facet[::-1], n], [*facet[::-1], n + 1]]
    with pytest.raises(InputError, match="1 faces of the mesh belong to more than two cells"):
        check_mesh(TetMesh(third, np.concatenate([box.cells, extra])))
    with pytest.raises(InputError, match="patch 'a' must hold facets"):
        check_mesh(TetMesh(box.points, box.cells, {"a": np.array([[0, 1, 999]])}))


def test_cells_on_one_side_of_a_face_overlap():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 1.0], [0.3, 0.3, 2.0]])
    mesh = TetMesh(points, [[0, 1, 2, 3], [0, 1, 2, 4]])
    with pytest.raises(InputError, match=r"1 faces .* to two on one side of them"):
        check_mesh(mesh)
    assert "cells of the mesh overlap or come twice" in mesh.flaw


def test_aspects_of_known_tetrahedra():
    """Height of the regular one sqrt(2/3) edges; of the corner of a cube 1 / sqrt(3)."""
    regular = [[0, 0, 0], [1, 0, 0], [0.5, 0.75**0.5, 0], [0.5, 12**-0.5, (2 / 3) ** 0.5]]
    corner = [[5, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1]]
    mesh = TetMesh(np.array([*regular, *corner]), np.arange(8).reshape(2, 4))
    np.testing.assert_allclose(mesh.aspects, [1.5**0.5, 6**0.5], rtol=1e-12)
    flat = TetMesh(np.array(regular) * [1, 1, 0], np.arange(4)[None])
    assert flat.aspects[0] == np.inf


@pytest.mark.parametrize(("height", "said"), [(3.0, False), (0.3, False), (0.003, True)])
def test_a_part_with_its_height_in_metres_is_pointed_out(height, said):
    _, report = check_mesh(box_mesh((30.0, 10.0, height), (15, 5, 1)))
    assert any("check that all lengths are in mm" in line for line in report.findings) == said
