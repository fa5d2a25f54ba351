"""Facets by their nodes, against sets of Python's and at node numbers beyond 2^21."""

from collections import Counter

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.geometry.facets import (
    are_among,
    facet_keys,
    paired,
    positions,
    sides_at,
    unique_edges,
)

SHIFTS = [0, 3_000_000, 4_000_000_000]
"""The last is far above the numbers whose cubes, and just above those whose squares, fit."""


@pytest.fixture(params=SHIFTS, ids=str)
def facets(request):
    """Facets of few nodes, so that many coincide, with node numbers as large as the shift."""
    few = np.random.default_rng(3).permuted(np.tile(np.arange(6), (200, 1)), axis=1)[:, :3]
    return np.where(few > 2, few + request.param, few)


def test_keys_are_equal_for_the_same_nodes_only(facets):
    keys, again = facet_keys(facets, facets[::-1, ::-1])
    np.testing.assert_array_equal(keys, again[::-1])
    sets = [tuple(sorted(facet)) for facet in facets.tolist()]
    assert len(set(zip(sets, keys.tolist(), strict=True))) == len(set(sets)) == len(set(keys))
    assert [sets[k] for k in np.argsort(keys, kind="stable")] == sorted(sets)


def test_a_large_node_is_not_taken_for_another():
    """With keys of 21 bits a node these two were one facet."""
    one, other = np.array([[0, 0, 1 << 21]]), np.array([[0, 1, 0]])
    assert not are_among(one, other).any()
    assert positions(one, other).tolist() == [-1]


def test_pairs_and_single_facets_are_those_of_a_count(facets):
    facets = facets[:15]
    sets = [frozenset(facet) for facet in facets.tolist()]
    count = Counter(sets)
    pairs, single = paired(facets)
    assert single.tolist() == [k for k, one in enumerate(sets) if count[one] == 1]
    assert len(single)
    assert len(pairs) == sum(n - 1 for n in count.values())
    assert all(sets[a] == sets[b] and a < b for a, b in pairs.tolist())


def test_positions_are_the_first_row_of_the_same_nodes(facets):
    among = facets[:12]
    sets = [frozenset(facet) for facet in among.tolist()]
    wanted = [frozenset(facet) for facet in facets.tolist()]
    found = positions(facets, among)
    assert found.tolist() == [sets.index(one) if one in sets else -1 for one in wanted]
    np.testing.assert_array_equal(are_among(facets, among), found >= 0)
    assert (found < 0).any()
    assert positions(facets[:0], among).shape == (0,)
    assert positions(among, facets[:0]).tolist() == [-1] * 12


def test_unique_edges_are_those_of_a_set(facets):
    edges, number = unique_edges(facets[:, :2])
    wanted = sorted({tuple(sorted(edge)) for edge in facets[:, :2].tolist()})
    assert [tuple(edge) for edge in edges.tolist()] == wanted
    np.testing.assert_array_equal(edges[number], np.sort(facets[:, :2], axis=1))


def test_the_corners_of_a_quadratic_mesh_are_the_linear_one():
    mesh = box_mesh((2.0, 1.0, 1.0), (2, 1, 1))
    back = mesh.quadratic().linear()
    np.testing.assert_array_equal(back.points, mesh.points)
    np.testing.assert_array_equal(back.cells, mesh.cells)
    for name, facets in mesh.patches.items():
        np.testing.assert_array_equal(back.patches[name], facets)
    assert mesh.linear() is mesh


def test_a_directed_edge_has_the_side_of_one_triangle():
    triangles = np.array([[0, 1, 2], [2, 1, 3]])
    triangle, side = sides_at(np.array([[2, 0], [1, 2], [2, 1], [3, 2]]), triangles)
    np.testing.assert_array_equal(triangle, [0, 0, 1, 1])
    np.testing.assert_array_equal(triangles[triangle, (side + 2) % 3], [1, 0, 3, 1])
