import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import SolveError
from ccfem.fem.elasticity.direct import skyline, skyline_operations, skyline_within


def random_matrix(nodes, block, seed, density=0.2):
    """Symmetric positive definite matrix of dense blocks at random places."""
    rng = np.random.default_rng(seed)
    graph = sp.random_array((nodes, nodes), density=density, rng=rng) + sp.eye_array(nodes)
    graph = sp.csr_array(graph + graph.T)
    factor = sp.bsr_array(
        (rng.normal(size=(graph.nnz, block, block)), graph.indices, graph.indptr),
        shape=(nodes * block, nodes * block),
    )
    matrix = (factor @ factor.T + 0.1 * sp.eye_array(nodes * block)).tobsr((block, block))
    matrix.sort_indices()
    return sp.bsr_array(matrix)


@settings(max_examples=30, deadline=None)
@given(nodes=st.integers(1, 40), block=st.integers(1, 3), seed=st.integers(0, 999))
def test_solves_what_numpy_solves(nodes, block, seed):
    matrix = random_matrix(nodes, block, seed)
    rhs = np.random.default_rng(seed).normal(size=matrix.shape[0])
    wanted = np.linalg.solve(matrix.toarray(), rhs)
    solve = skyline(matrix)
    np.testing.assert_allclose(solve(rhs), wanted, atol=1e-8 * np.abs(wanted).max())
    np.testing.assert_array_equal(solve(rhs), solve(rhs.copy()))


def test_a_shuffled_band_is_found_again():
    n = 400
    band = sp.diags_array([np.full(n, 4.0), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    order = np.random.default_rng(0).permutation(n)
    shuffled = band.tocsr()[order][:, order].tobsr((1, 1))
    shuffled.sort_indices()
    assert skyline_operations(sp.bsr_array(shuffled)) < 20 * n
    rhs = np.random.default_rng(1).normal(size=n)
    found = skyline(sp.bsr_array(shuffled))(rhs)
    np.testing.assert_allclose(shuffled @ found, rhs, atol=1e-12)


def test_few_far_couplings_are_ordered_away():
    """Two chains beside each other that are numbered one after the other, and coupled at places."""
    n, every = 2000, 100
    first = np.arange(0, n // 2, every)
    chain = sp.diags_array([np.full(n, 4.0), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    entries = (-np.ones(len(first)), (first, first + n // 2))
    far = sp.csr_array(entries, shape=(n, n))
    matrix = (chain + far + far.T).tobsr((1, 1))
    matrix.sort_indices()
    matrix = sp.bsr_array(matrix)
    rhs = np.random.default_rng(2).normal(size=n)
    assert skyline_within(matrix, 1.0) is None
    solve = skyline_within(matrix, 20.0 * n)
    assert solve is not None
    np.testing.assert_allclose(matrix @ solve(rhs), rhs, atol=1e-12)


@pytest.mark.parametrize("pivot", [0.0, -1.0])
def test_no_positive_pivot(pivot):
    matrix = np.eye(8)
    matrix[5, 5] = pivot
    with pytest.raises(SolveError, match="no positive pivot"):
        skyline(sp.bsr_array(matrix, blocksize=(2, 2)))
