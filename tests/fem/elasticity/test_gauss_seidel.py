import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import example, given, settings, strategies as st

from ccfem.fem.elasticity import gauss_seidel
from ccfem.fem.elasticity.conjugate_gradient import conjugate_gradient
from ccfem.fem.elasticity.gauss_seidel import ClusterSweeps, GaussSeidel


def random_matrix(nodes, seed):
    """Return a sparse symmetric positive definite matrix of 3x3 blocks."""
    generator = np.random.default_rng(seed)
    joined = generator.random((nodes, nodes)) < 0.3
    joined |= joined.T | np.eye(nodes, dtype=bool)
    square = generator.normal(size=(3 * nodes, 3 * nodes)) * np.kron(joined, np.ones((3, 3)))
    dense = square + square.T
    dense += (np.abs(dense).sum(axis=1).max() + 1.0) * np.eye(3 * nodes)
    return sp.bsr_array(dense, blocksize=(3, 3)), dense


@given(st.integers(1, 8), st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_sweeps_are_triangular_solves(nodes, seed):
    matrix, dense = random_matrix(nodes, seed)
    generator = np.random.default_rng(seed + 1)
    rhs, start = generator.normal(size=(2, 3 * nodes))
    row = np.arange(3 * nodes) // 3
    lower = np.where(row[:, None] >= row[None, :], dense, 0.0)
    upper = np.where(row[:, None] <= row[None, :], dense, 0.0)
    smoother = GaussSeidel(matrix)
    x, residual = smoother.forward(rhs)
    np.testing.assert_allclose(x, np.linalg.solve(lower, rhs), atol=1e-12)
    np.testing.assert_allclose(residual, rhs - dense @ x, atol=1e-12)
    expected = start + np.linalg.solve(upper, rhs - dense @ start)
    np.testing.assert_allclose(smoother.backward(rhs, start.copy()), expected, atol=1e-12)
    single = GaussSeidel(matrix, single=True)
    np.testing.assert_allclose(single.forward(rhs), (x, residual), atol=1e-6)
    np.testing.assert_allclose(single.backward(rhs, start.copy()), expected, atol=1e-6)
    if nodes % 2 == 0:
        # The same matrix in blocks of six.
        pair = np.arange(3 * nodes) // 6
        lower = np.where(pair[:, None] >= pair, dense, 0.0)
        upper = np.where(pair[:, None] <= pair, dense, 0.0)
        smoother = GaussSeidel(sp.bsr_array(dense, blocksize=(6, 6)))
        x, residual = smoother.forward(rhs)
        np.testing.assert_allclose(x, np.linalg.solve(lower, rhs), atol=1e-12)
        np.testing.assert_allclose(residual, rhs - dense @ x, atol=1e-12)
        expected = start + np.linalg.solve(upper, rhs - dense @ start)
        np.testing.assert_allclose(smoother.backward(rhs, start.copy()), expected, atol=1e-12)


@pytest.mark.parametrize("along", [None, np.arange(8) % 3])
def test_sweeps_over_clusters_are_triangular_solves_in_their_order(along, monkeypatch):
    """Two halves that do not meet, swept by two threads or one, then what parts them."""
    matrix, dense = random_matrix(8, 5)
    of_node = np.array([1, 0, -1, 1, 1, -1, 0, -1])
    if along is not None:
        # Nodes 2 and 5, and the two clusters, meet across the median at nodes 7 and 2 only.
        half = np.kron(along > 1, [1, 1, 1])
        dense = np.where(half[:, None] == half, dense, 0.0)
        dense[6:9, 15:18] = dense[15:18, 6:9] = 0.25 * np.eye(3)
        matrix = sp.bsr_array(dense, blocksize=(3, 3))
    first = np.array([0, 1, 2, 0, 0, 5, 1, 7])
    order = np.unique(first, return_inverse=True)[1]
    if along is not None:
        part = (along > 1)[first]
        part = np.where(np.isin(first, first[[5]]) & part, 2, part)
        order = np.unique(10 * part + order, return_inverse=True)[1]
    rank = np.repeat(order, 3)
    upper = np.where(rank[:, None] <= rank, dense, 0.0)
    rhs, start = np.random.default_rng(6).normal(size=(2, 24))
    monkeypatch.setattr(gauss_seidel, "_MANY_NODES", 0)
    sweeps = []
    for threads in "12":
        monkeypatch.setenv("CCFEM_THREADS", threads)
        smoother = ClusterSweeps(matrix, of_node, along)
        sweeps.append((*smoother.forward(rhs), smoother.backward(rhs, start.copy())))
    np.testing.assert_array_equal(*sweeps)
    x, residual, backward = sweeps[0]
    np.testing.assert_allclose(x, np.linalg.solve(upper.T, rhs), atol=1e-6)
    np.testing.assert_allclose(residual, rhs - dense @ x, atol=1e-6)
    expected = start + np.linalg.solve(upper, rhs - dense @ start)
    np.testing.assert_allclose(backward, expected, atol=1e-6)


def test_motions_that_no_aggregate_has_stay_zero():
    """A motion of two blocks that nothing holds: sweeps solve for the rest."""
    _, dense = random_matrix(8, 3)
    lost = np.zeros((24, 2))
    lost[:6, 0], lost[6:12, 1] = np.random.default_rng(4).normal(size=(2, 6))
    lost /= np.linalg.norm(lost, axis=0)
    keep = np.eye(24) - lost @ lost.T
    dense = keep @ dense @ keep
    pair = np.arange(24) // 6
    lower = np.where(pair[:, None] >= pair, dense, 0.0) + lost @ lost.T
    rhs = keep @ np.random.default_rng(5).normal(size=24)
    smoother = GaussSeidel(sp.bsr_array(dense, blocksize=(6, 6)), singular=True)
    x, residual = smoother.forward(rhs)
    np.testing.assert_allclose(x, np.linalg.solve(lower, rhs), atol=1e-12)
    np.testing.assert_allclose(residual, rhs - dense @ x, atol=1e-12)


@given(st.integers(2, 8), st.integers(0, 10_000))
@example(5, 1024)
@settings(max_examples=15, deadline=None)
def test_conjugate_gradients_end_after_as_many_steps_as_unknowns(nodes, seed):
    matrix, dense = random_matrix(nodes, seed)
    values, vectors = np.linalg.eigh(dense)
    # As much of every eigenvector: steps that never see one know nothing of its eigenvalue.
    rhs = vectors @ np.random.default_rng(seed).choice([-1.0, 1.0], 3 * nodes)
    x, iterations, lowest = conjugate_gradient(matrix, rhs, lambda r: r, tolerance=1e-10)
    # A residual of 1e-10 of the right-hand side leaves an error of so much at most.
    error = np.linalg.norm(x - np.linalg.solve(dense, rhs))
    assert error <= 1.01e-10 * np.linalg.norm(rhs) / values[0]
    assert iterations <= 3 * nodes
    assert lowest == pytest.approx(values[0], rel=0.01)


def test_conjugate_gradients_stop_at_an_indefinite_matrix():
    matrix = sp.bsr_array(np.diag([1.0, -2.0, 1.0]), blocksize=(3, 3))
    x, iterations, _ = conjugate_gradient(matrix, np.array([0.0, 1.0, 0.0]), lambda r: r)
    assert iterations == 0
    assert not x.any()


def test_conjugate_gradients_give_up_after_the_given_steps():
    matrix, _ = random_matrix(8, 0)
    rhs, close = np.ones(24), 1e-14
    _, iterations, _ = conjugate_gradient(matrix, rhs, lambda r: r, tolerance=close, most=2)
    assert iterations == 2


def test_nothing_to_do_takes_no_steps():
    matrix, _ = random_matrix(3, 0)
    x, iterations, _ = conjugate_gradient(matrix, np.zeros(9), lambda r: r)
    assert iterations == 0
    assert x == pytest.approx(0.0)
