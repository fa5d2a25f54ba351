"""Principal values in a plane against eigenvalues, and the stronger of the two by hand."""

import numpy as np
import pytest

from ccfem.base.tensor import largest_in_plane, strongest, strongest_in_plane


@pytest.fixture(scope="module")
def stresses():
    return np.random.default_rng(5).normal(size=(200, 3))


def eigen(stresses):
    s11, s22, s12 = stresses.T
    return np.linalg.eigh(np.stack([[s11, s12], [s12, s22]]).transpose(2, 0, 1))


def test_principal_values_in_the_plane_are_eigenvalues(stresses):
    values, vectors = eigen(stresses)
    largest, smallest, angle = largest_in_plane(stresses)
    np.testing.assert_allclose(np.stack([smallest, largest], axis=1), values, atol=1e-12)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(np.abs((along * vectors[:, :, 1]).sum(axis=1)), 1.0)


def test_the_strongest_is_the_eigenvalue_of_the_largest_size(stresses):
    values, vectors = eigen(stresses)
    rows, wanted = np.arange(len(values)), np.abs(values).argmax(axis=1)
    value, angle, defined = strongest_in_plane(stresses)
    np.testing.assert_allclose(value, values[rows, wanted], atol=1e-12)
    along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(np.abs((along * vectors[rows, :, wanted]).sum(axis=1)), 1.0)
    sizes = np.sort(np.abs(values), axis=1)
    np.testing.assert_array_equal(defined, sizes[:, 0] < 0.98 * sizes[:, 1])
    assert 0 < (~defined).sum() < 20


def test_values_of_one_size_have_no_strongest_direction():
    largest, smallest = np.array([[3.0, 1.0], [1.0, -3.0], [1.0, -1.0], [1.0, 1.0], [0.0, 0.0]]).T
    across, defined = strongest(largest, smallest)
    assert across.tolist() == [False, True, False, False, False]
    assert defined.tolist() == [True, True, False, False, False]
    value, _, known = strongest_in_plane(np.array([[0.0, 0.0, 2.0], [-2.0, -2.0, 0.0]]))
    assert value.tolist() == [2.0, -2.0]
    assert known.tolist() == [False, False]


def test_the_strongest_turns_with_the_frame(stresses):
    turn = 0.7
    c, s = np.cos(turn), np.sin(turn)
    tensors = np.stack([stresses[:, [0, 2]], stresses[:, [2, 1]]], axis=1)
    frame = np.array([[c, s], [-s, c]])
    turned = frame @ tensors @ frame.T
    value, angle, _ = strongest_in_plane(stresses)
    same, other, _ = strongest_in_plane(
        np.stack([turned[:, 0, 0], turned[:, 1, 1], turned[:, 0, 1]], 1)
    )
    np.testing.assert_allclose(same, value, atol=1e-12)
    np.testing.assert_allclose(np.cos(2.0 * (angle - turn - other)), 1.0)
