"""Strands: nothing lost, nothing counted twice, wherever the path runs."""

import itertools
import pickle
from dataclasses import replace

import numpy as np
import pytest
from flat_paths import flat_paths
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.judging.virtual_testing import strands as strands_of
from ccfem.judging.virtual_testing.strands import cut_strands, whole_strands
from ccfem.paths.toolpaths import MATRIX, Toolpaths


def kuhn(shape=(3, 2, 2), size=(3.0, 2.0, 2.0), jitter=0.0):
    """Box of cubes of six tetrahedra each; interior nodes moved at random by `jitter`."""
    axes = [np.linspace(0.0, s, n + 1) for s, n in zip(size, shape, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([n + 1 for n in shape])
    cells = []
    for corner in itertools.product(*map(range, shape)):
        for order in itertools.permutations(range(3)):
            at, cell = list(corner), [number[corner]]
            for axis in order:
                at[axis] += 1
                cell.append(number[tuple(at)])
            even = np.linalg.det(np.eye(3)[list(order)]) > 0
            cells.append(cell if even else [cell[0], cell[2], cell[1], cell[3]])
    inner = np.all((points > 1e-9) & (points < np.array(size) - 1e-9), axis=1)
    move = np.random.default_rng(3).uniform(-jitter, jitter, points.shape)
    return TetMesh(points + move * inner[:, None], np.array(cells))


MESH = kuhn(shape=(4, 3, 3), size=(4.0, 3.0, 3.0), jitter=0.15)
FACES = MESH.corners[:, TetMesh.faces].reshape(-1, 3)
FREE = st.tuples(st.floats(0.0, 4.0), st.floats(0.0, 3.0), st.floats(0.0, 3.0)).map(np.array)
NODE = st.integers(0, len(MESH.points) - 1).map(lambda k: MESH.points[k])
EDGE = st.integers(0, len(FACES) - 1).map(lambda k: MESH.points[FACES[k, :2]].mean(axis=0))
FACE = st.integers(0, len(FACES) - 1).map(lambda k: MESH.points[FACES[k]].mean(axis=0))
LINE = st.lists(st.one_of(FREE, NODE, EDGE, FACE), min_size=2, max_size=6).map(np.array)


def around(k):
    """Path over nodes and middles of one face: along its edges and across it."""
    a, b, c = MESH.points[FACES[k]]
    return np.array([a, b, 0.5 * (b + c), a, (a + b + c) / 3, c, a])


@settings(max_examples=150, deadline=None)
@given(
    st.one_of(LINE, st.integers(0, len(FACES) - 1).map(around)),
    st.sampled_from([0.0, 1e-15, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6]),
)
def test_length_is_conserved_wherever_the_path_runs(line, tilt):
    move = np.random.default_rng(len(line)).uniform(-tilt, tilt, line.shape)
    line = np.clip(line + move, 0.0, [4.0, 3.0, 3.0])
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    if length < 1e-6:
        return
    strands = cut_strands(flat_paths([line]), MESH)
    assert strands.total == pytest.approx(length, rel=1e-9)
    assert strands.outside <= 1e-9 * length
    assert (strands.length > 0.0).all()


def clipped(mesh, a, b):
    """Length of a segment in every cell by half-space clipping, one cell at a time."""
    result = np.zeros(len(mesh.cells))
    for cell, corners in enumerate(mesh.points[mesh.corners]):
        matrix = np.vstack([corners.T, np.ones(4)])
        start, end = np.linalg.solve(matrix, np.array([[*a, 1.0], [*b, 1.0]]).T).T
        low, high = 0.0, 1.0
        for u, v in zip(start, end, strict=True):
            if v > u:
                low = max(low, -u / (v - u))
            elif u > v:
                high = min(high, u / (u - v))
            elif u < 0.0:
                high = -1.0
        result[cell] = max(high - low, 0.0) * np.linalg.norm(np.subtract(b, a))
    return result


def test_pieces_are_those_of_clipping_each_cell():
    generator = np.random.default_rng(0)
    for _ in range(10):
        a, b = generator.uniform(0.0, 3.0, (2, 3))
        strands = cut_strands(flat_paths([np.array([a, b])]), MESH)
        found = np.bincount(strands.cell, strands.length, len(MESH.cells))
        np.testing.assert_allclose(found, clipped(MESH, a, b), atol=1e-12)


@pytest.mark.parametrize("reach", [0.1, 0.5, 3.0])
def test_pieces_of_long_lines_are_those_of_clipping_each_step(reach):
    """Steps that end in cells and on faces, of less than a cell and of several."""
    generator = np.random.default_rng(1)
    line, corners = [np.array([2.0, 1.5, 1.5])], MESH.points[FACES]
    for k in range(120):
        ahead = line[-1] + reach * generator.uniform(-1.0, 1.0, 3)
        ahead = np.clip(ahead, [0.1, 0.12, 0.17], [3.9, 2.92, 2.81])
        near = corners[np.linalg.norm(corners.mean(axis=1) - ahead, axis=1).argmin()]
        line.append(generator.dirichlet(3.0 * np.ones(3)) @ near if k % 2 else ahead)
    strands = cut_strands(flat_paths([np.array(line)]), MESH)
    found = np.bincount(strands.cell, strands.length, len(MESH.cells))
    wanted = sum(clipped(MESH, a, b) for a, b in itertools.pairwise(line))
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    assert (np.diff(strands.arc) > 0.0).all()


def test_a_piece_on_a_face_is_shared_by_both_cells():
    face = MESH.points[FACES]
    key = np.sort(FACES, axis=1)
    inner = next(k for k in range(len(key)) if (key == key[k]).all(axis=1).sum() == 2)
    a, b, c = face[inner]
    middle = (a + b + c) / 3
    strands = cut_strands(flat_paths([np.array([middle, 0.5 * (middle + a)])]), MESH)
    assert len(strands) == 2
    assert strands.length[0] == pytest.approx(strands.length[1])
    owners = np.flatnonzero((key == key[inner]).all(axis=1)) // 4
    assert set(strands.cell) == set(owners)


def test_a_piece_on_the_boundary_is_kept_whole():
    mesh = kuhn()
    line = np.array([[0.1, 0.0, 0.3], [2.9, 0.0, 0.3], [2.9, 0.0, 1.9]])
    assert cut_strands(flat_paths([line]), mesh).total == pytest.approx(2.8 + 1.6, rel=1e-12)


def test_arc_length_path_and_tangent_follow_the_paths():
    first = np.array([[0.2, 0.3, 0.4], [3.7, 0.5, 0.6], [3.5, 2.7, 2.2]])
    second = np.array([[0.1, 2.0, 2.0], [3.0, 2.1, 0.3]])
    strands = cut_strands(flat_paths([first, second]), MESH)
    assert set(strands.path) == {0, 1}
    for path, line in enumerate((first, second)):
        mine = strands.path == path
        arc = strands.arc[mine]
        assert (np.diff(arc) > 0.0).all()
        steps = np.diff(line, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        reached = np.concatenate([[0.0], np.cumsum(lengths)])
        leg = np.searchsorted(reached, arc) - 1
        np.testing.assert_allclose(
            strands.middle[mine],
            line[leg] + ((arc - reached[leg]) / lengths[leg])[:, None] * steps[leg],
            atol=1e-12,
        )
        np.testing.assert_allclose(strands.tangent[mine], (steps / lengths[:, None])[leg])


def test_the_part_outside_is_reported_and_above_one_percent_refused():
    line = np.array([[0.5, 1.0, 1.1], [3.01, 1.0, 1.1]])
    strands = cut_strands(flat_paths([line]), kuhn())
    assert strands.outside == pytest.approx(0.01)
    assert strands.total == pytest.approx(2.5)
    with pytest.raises(InputError, match=r"0.2 mm of 2.7 mm lie outside"):
        cut_strands(flat_paths([np.array([[0.5, 1.0, 1.1], [3.2, 1.0, 1.1]])]), kuhn())
    with pytest.raises(InputError, match=r"1 mm of 1 mm lie outside \(100 %, .*same frame"):
        cut_strands(flat_paths([np.array([[0.5, 1.0, 50.0], [0.5, 2.0, 50.0]])]), kuhn())


def test_links_carry_where_they_are_in_the_mesh_and_may_leave_it():
    # 2 mm to the face, out and back over 3 mm that are links, and 1.5 mm on.
    line = np.array([[1, 0.4, 1.1], [3, 0.4, 1.1], [4, 0.4, 1.1], [4, 1.4, 1.1], [1.5, 1.4, 1.1]])
    paths = flat_paths([line])
    marked = replace(paths, link=np.array([False, True, True, True, False]))
    strands = cut_strands(marked, kuhn())
    assert strands.total == pytest.approx(2.0 + 1.5)
    assert strands.outside == 0.0
    # Arc length runs on over the link, so places along the path are those of the toolpaths.
    assert strands.arc[strands.middle[:, 1] > 1.0].min() > 2.0 + 3.0
    bare = cut_strands(flat_paths([line[:2], np.array([[3.0, 1.4, 1.1], [1.5, 1.4, 1.1]])]), kuhn())
    assert np.sort(strands.cell).tolist() == np.sort(bare.cell).tolist()
    assert np.sort(strands.length) == pytest.approx(np.sort(bare.length))
    # What is no link must stay inside.
    with pytest.raises(InputError, match=r"2 mm of 5.5 mm lie outside"):
        cut_strands(replace(paths, link=np.array([False, False, True, False, False])), kuhn())
    beyond = flat_paths([line[2:4]])
    with pytest.raises(InputError, match=r"1 mm of links outside"):
        cut_strands(replace(beyond, link=np.array([True, False])), kuhn())


def test_a_gap_in_the_part_is_outside():
    mesh = kuhn(shape=(3, 1, 1), size=(3.0, 1.0, 1.0))
    middle = mesh.points[mesh.corners].mean(axis=1)[:, 0]
    split = TetMesh(mesh.points, mesh.cells[(middle < 1.0) | (middle > 2.0)])
    line = np.array([[0.2, 0.4, 0.7], [2.9, 0.4, 0.7]])
    strands = cut_strands(flat_paths([line]), split, most_outside=0.5)
    assert strands.outside == pytest.approx(1.0)


def test_a_small_part_far_from_another_needs_no_large_grid():
    near = kuhn(shape=(3, 2, 2), size=(0.03, 0.02, 0.02))
    far = near.points + 500.0
    mesh = TetMesh(
        np.concatenate([near.points, far]),
        np.concatenate([near.cells, near.cells + len(near.points)]),
    )
    line = np.array([[0.001, 0.01, 0.011], [0.029, 0.012, 0.011]])
    strands = cut_strands(flat_paths([line, line + 500.0]), mesh)
    assert strands.total == pytest.approx(2 * np.hypot(0.028, 0.002), rel=1e-9)


@pytest.mark.parametrize(
    "paths",
    [
        Toolpaths.empty(),
        flat_paths([np.array([[1.0, 1.0, 1.0], [2.0, 1.0, 1.0]])], kind=MATRIX),
        flat_paths([np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])]),
    ],
)
def test_no_fibre_is_refused(paths):
    with pytest.raises(InputError, match="needs fibre"):
        cut_strands(paths, kuhn())


def test_whole_strands_are_stored_for_the_last_mesh_and_stay_here(monkeypatch):
    line = np.array([[0.1, 0.2, 0.3], [3.9, 2.8, 2.6]])
    paths, other = flat_paths([line]), kuhn(shape=(2, 2, 2), size=(4.0, 3.0, 3.0))
    first = whole_strands(paths, MESH)
    np.testing.assert_array_equal(first.length, cut_strands(paths, MESH).length)
    assert first.length.sum() == pytest.approx(np.linalg.norm(line[1] - line[0]))
    assert whole_strands(paths, MESH) is first
    assert len(whole_strands(paths, other)) != len(first)
    assert paths.lengths is paths.lengths
    assert not vars(pickle.loads(pickle.dumps(paths))).keys() & {"strands", "lengths"}
    # Many pieces are not kept in memory.
    monkeypatch.setattr(strands_of, "_STORED", len(first) - 1)
    assert whole_strands(paths, MESH) is not whole_strands(paths, MESH)
