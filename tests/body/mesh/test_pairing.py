from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.tet_mesh import CROWDED, FOLDED, FREE
from ccfem.geometry.facets import facet_keys


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_partners_are_those_of_a_search_through_all(seed):
    random = np.random.default_rng(seed)
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 1))
    kept = np.flatnonzero(random.random(len(mesh.cells)) < 0.7)[:12]
    number = random.permutation(len(mesh.points))
    points = np.empty_like(mesh.points)
    points[number] = mesh.points
    mesh = TetMesh(points, number[mesh.cells[kept]])
    facets = [frozenset(cell[face].tolist()) for cell in mesh.cells for face in mesh.faces]
    expected = np.full(len(facets), FREE)
    for i, j in combinations(range(len(facets)), 2):
        if facets[i] == facets[j]:
            expected[i], expected[j] = j, i
    np.testing.assert_array_equal(mesh.partners, expected)
    # Every pair is one of two cells, and what is left over is the boundary.
    assert len(mesh.boundary) + 2 * len(mesh.neighbours) == 4 * len(mesh.cells)


def test_a_cell_that_comes_twice_is_seen():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2))
    twice = TetMesh(mesh.points, np.concatenate([mesh.cells, mesh.cells[10:11]]))
    assert set(np.unique(twice.partners[[40, 41, 42, 43]])) <= {CROWDED, FOLDED}
    assert "come twice" in twice.flaw
    alone = TetMesh(mesh.points, mesh.cells[[10, 10]])
    assert (alone.partners == FOLDED).all()
    assert mesh.flaw == ""


def test_flaws_of_a_mesh_come_with_their_cure():
    mesh = box_mesh((1.0, 1.0, 1.0), (2, 2, 2))
    points = np.array(mesh.points)
    points[3, 1] = np.inf
    assert "correct its coordinates" in TetMesh(points, mesh.cells).flaw
    turned = np.array(mesh.cells)
    turned[5] = turned[5][[0, 2, 1, 3]]
    assert "cell 5 of the mesh has volume -" in TetMesh(mesh.points, turned).flaw
    quadratic = mesh.quadratic()
    assert quadratic.flaw == ""
    points = np.array(quadratic.points)
    start, end = quadratic.points[quadratic.cells[0, :2]]
    points[quadratic.cells[0, 4]] += 0.1 * (end - start)
    assert TetMesh(points, quadratic.cells).flaw == ""
    points[quadratic.cells[0, 4]] += 0.3 * (end - start)
    assert "turned inside out by their curved sides" in TetMesh(points, quadratic.cells).flaw


@pytest.mark.parametrize("size", [2**20, 2**21, 2**24, 2**31])
def test_keys_of_facets_differ_whatever_the_node_numbers(size):
    # Neighbours in each of the three numbers, which collided above 2^21 nodes.
    random = np.random.default_rng(0)
    base = np.sort(random.integers(10, size - 10, (1000, 3)), axis=1)
    steps = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0], [1, -1, 0], [0, 1, -1]])
    facets = (base[:, None] + steps).reshape(-1, 3)
    facets = np.unique(np.sort(facets, axis=1), axis=0)
    keys, turned = facet_keys(facets, facets[:, [2, 0, 1]])
    assert len(np.unique(keys)) == len(facets)
    assert (np.argsort(keys, kind="stable") == np.arange(len(keys))).all()
    np.testing.assert_array_equal(turned, keys)
