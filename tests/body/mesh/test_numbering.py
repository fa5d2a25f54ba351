"""Numbers of nodes with which factors stay sparse."""

import networkx
import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import splu

from ccfem.body.mesh.numbering import nested_dissection, reverse_cuthill_mckee


def sparse_rows(graph):
    return networkx.to_scipy_sparse_array(graph, nodelist=sorted(graph), format="csr")


def test_ties_go_to_the_first_node():
    # Ends 0 and 4 of a path have one neighbour each: the numbers start at 0, and are reversed.
    rows = sparse_rows(networkx.path_graph(5))
    np.testing.assert_array_equal(reverse_cuthill_mckee(rows.indptr, rows.indices), [4, 3, 2, 1, 0])


def test_neighbours_are_taken_by_rising_degree_and_pieces_one_by_one():
    # From 0: 1 has three neighbours, 2 and 3 two; then the edge from 5 to 6 comes before.
    graph = networkx.Graph([(0, 1), (1, 2), (1, 3), (2, 4), (3, 4), (4, 7), (5, 6)])
    rows = sparse_rows(graph)
    order = reverse_cuthill_mckee(rows.indptr, rows.indices)[::-1]
    np.testing.assert_array_equal(order, [0, 1, 2, 3, 4, 7, 5, 6])


@pytest.mark.parametrize("seed", range(4))
def test_every_node_once_and_a_narrow_band(seed):
    grid = networkx.grid_2d_graph(6, 40)
    shuffled = np.random.default_rng(seed).permutation(240)
    names = dict(zip(sorted(grid), shuffled.tolist(), strict=True))
    rows = sparse_rows(networkx.relabel_nodes(grid, names))
    order = reverse_cuthill_mckee(rows.indptr, rows.indices)
    np.testing.assert_array_equal(np.sort(order), np.arange(240))
    place = np.empty(240, dtype=int)
    place[order] = np.arange(240)
    ends = np.stack(rows.nonzero())
    assert np.abs(np.diff(place[ends], axis=0)).max() <= 8
    assert np.abs(np.diff(ends, axis=0)).max() > 100


def test_a_factor_of_a_dissected_grid_stays_within_the_bound_of_george():
    # Of an n x n grid it has less than 31/4 n^2 log2 n entries (George 1973), row by row n^3.
    n = 48
    grid = networkx.strong_product(networkx.path_graph(n), networkx.path_graph(n))
    rows = sparse_rows(grid)
    order = nested_dissection(np.array(sorted(grid), dtype=float), rows.indptr, rows.indices)
    np.testing.assert_array_equal(np.sort(order), np.arange(n * n))
    matrix = scipy.sparse.diags_array(9.0 + np.zeros(n * n)) - rows
    entries = [
        splu(
            scipy.sparse.csc_array(some),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        ).L.nnz
        for some in (matrix.tocsr()[order][:, order], matrix)
    ]
    assert entries[0] < 31 / 4 * n**2 * np.log2(n) < entries[1]
