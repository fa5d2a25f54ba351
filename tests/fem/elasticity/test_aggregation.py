"""Smoothed aggregation beside dense matrices."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.linalg import eigh

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.assembly import assemble
from ccfem.fem.elasticity.conjugate_gradient import highest_eigenvalue
from ccfem.fem.elasticity.gauss_seidel import GaussSeidel
from ccfem.fem.elasticity.held import rigid_modes
from ccfem.fem.elasticity.multigrid import aggregates, galerkin, quick_aggregation, smoothed
from ccfem.fem.materials import isotropic


@pytest.fixture(scope="module")
def body():
    """Stiffness of a body that nothing holds, and its rigid motions (n, 3, 6).

    A copy may be written to, as the stiffness of a held part: functions are compiled for one kind.
    """
    mesh = box_mesh((3.0, 2.0, 1.0), (6, 4, 3))
    return assemble(mesh, isotropic(10.0, 0.3).stiffness).copy(), rigid_modes(mesh.points - 0.5)


@pytest.fixture(scope="module")
def groups(body):
    matrix, motions = body
    return aggregates(matrix, motions.reshape(-1, 3, 6), 0.02)


def spread(groups):
    """Motions of groups as a dense matrix."""
    dense = np.zeros((*groups.motions.shape[:2], len(groups.near_kernel), 6))
    rows = np.flatnonzero(groups.of_node >= 0)
    dense[rows, :, groups.of_node[rows]] = groups.motions[rows]
    return dense.reshape(dense.shape[0] * dense.shape[1], -1)


def prolongation(prolong):
    """All of it as a dense matrix, column by column."""
    columns = []
    for unit in np.eye(6 * prolong.groups):
        columns.append(np.zeros(prolong.blocks.shape[1] * (len(prolong.indptr) - 1)))
        prolong.add(unit, columns[-1])
    return np.column_stack(columns)


def blocks(dense):
    """Diagonal blocks of a dense matrix."""
    row = np.arange(len(dense)) // 3
    return np.where(row[:, None] == row, dense, 0.0)


def test_groups_move_as_the_body_does(body, groups):
    _, motions = body
    dense = spread(groups)
    assert 1 < len(groups.near_kernel) < len(groups.of_node) / 8
    np.testing.assert_allclose(dense @ groups.near_kernel.reshape(-1, 6), motions, atol=1e-12)
    np.testing.assert_allclose(dense.T @ dense, np.eye(dense.shape[1]), atol=1e-12)


def test_a_group_too_small_for_all_motions_has_fewer():
    # Two nodes on a line turn about it without moving; the third is tied to neither.
    joined = [[2.0, -1.0, 0.0], [-1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]
    matrix = sp.bsr_array(np.kron(joined, np.eye(3)), blocksize=(3, 3))
    motions = rigid_modes(np.array([[0.0, 0, 0], [1.0, 0, 0], [5.0, 5.0, 5.0]]))
    groups = aggregates(matrix, motions.reshape(-1, 3, 6), 0.02)
    assert groups.of_node.tolist() == [0, 0, -1]
    own = groups.motions[:2].reshape(6, 6)
    np.testing.assert_allclose(own.T @ own, np.diag([1.0, 1, 1, 0, 1, 1]), atol=1e-12)
    np.testing.assert_allclose(own @ groups.near_kernel[0], motions[:6], atol=1e-12)


def test_the_coarse_stiffness_is_that_of_dense_products(body, groups):
    matrix, _ = body
    dense, sweeps = matrix.toarray(), GaussSeidel(matrix)
    prolong = smoothed(matrix, sweeps.inverse, groups, 0.5)
    first = spread(groups)
    wanted = first - 0.5 * np.linalg.solve(blocks(dense), dense @ first)
    found = prolongation(prolong)
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    coarse = galerkin(matrix, prolong)
    np.testing.assert_allclose(coarse.toarray(), found.T @ dense @ found, atol=1e-12)
    # A rigid motion costs nothing on either level.
    assert (
        np.abs(coarse @ groups.near_kernel.reshape(-1, 6)).max() < 1e-5 * np.abs(coarse.data).max()
    )
    forces = np.random.default_rng(0).normal(size=len(dense))
    np.testing.assert_allclose(prolong.restrict(forces), found.T @ forces, atol=1e-12)


def test_the_highest_eigenvalue_is_found(body):
    matrix, _ = body
    sweeps = GaussSeidel(matrix)
    dense = matrix.toarray()
    exact = eigh(dense, blocks(dense), eigvals_only=True)[-1]
    assert 0.9 * exact < highest_eigenvalue(matrix, sweeps.jacobi) <= exact * (1.0 + 1e-9)


def test_a_matrix_without_strong_connections_is_swept_alone():
    diagonal = np.arange(1.0, 1801.0)
    matrix = sp.diags_array(diagonal).tobsr((3, 3))
    cycle = quick_aggregation(matrix, np.ones((1800, 6)))
    np.testing.assert_allclose(cycle(np.ones(1800)), 1.0 / diagonal, rtol=1e-12)


def test_the_cycle_is_symmetric_and_positive_definite(body):
    matrix, motions = body
    dense = matrix.toarray() + 0.1 * np.eye(len(motions))
    cycle = quick_aggregation(sp.bsr_array(dense, blocksize=(3, 3)), motions)
    inverse = np.column_stack([cycle(unit) for unit in np.eye(len(dense))])
    np.testing.assert_allclose(inverse, inverse.T, atol=1e-6 * np.abs(inverse).max())
    # A cycle never overshoots: the eigenvalues of what it leaves are in [0, 1).
    kept = np.linalg.eigvals(inverse @ dense).real
    assert kept.min() > 0.1
    assert kept.max() < 1.0 + 1e-6
