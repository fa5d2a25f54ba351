import numpy as np
from hypothesis import given, settings, strategies as st

from ccfem.fem.topopt.parametrisation import ConeFilter
from ccfem.fem.topopt.simp import optimality_criteria


def dense(centres, volumes, radius):
    distance = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    return np.maximum(0.0, radius - distance) * volumes


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 999), radius=st.floats(0.05, 2.0), dimension=st.integers(2, 3))
def test_cone_weights(seed, radius, dimension):
    rng = np.random.default_rng(seed)
    centres, volumes = rng.random((30, dimension)), rng.uniform(0.5, 2.0, 30)
    cone = ConeFilter.of_cells(centres, volumes, radius)
    weights = dense(centres, volumes, radius)
    np.testing.assert_allclose(cone.weights.toarray(), weights, atol=1e-12)
    values, gradient = rng.random(30), -rng.random(30)
    mean = weights / weights.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(cone.average(values), mean @ values)
    np.testing.assert_allclose(cone.average(np.ones(30)), 1.0)
    np.testing.assert_allclose(cone.transposed(gradient), mean.T @ gradient)
    # With equal volumes: the formula of the 88 lines.
    equal = ConeFilter.of_cells(centres, np.ones(30), radius)
    h = dense(centres, np.ones(30), radius)
    wanted = h @ (values * gradient) / h.sum(axis=1) / np.maximum(1e-3, values)
    np.testing.assert_allclose(equal.sensitivities(values, gradient), wanted)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 999), radius=st.floats(0.05, 2.0), share=st.floats(0.1, 0.9))
def test_a_cell_in_two_pieces_has_the_sensitivity_of_the_whole(seed, radius, share):
    rng = np.random.default_rng(seed)
    centres, volumes = rng.random((30, 2)), rng.uniform(0.5, 2.0, 30)
    density, gradient = rng.uniform(0.1, 1.0, 30), -rng.random(30)
    whole = ConeFilter.of_cells(centres, volumes, radius).sensitivities(density, gradient)
    pieces = np.array([share, 1.0 - share])
    split = ConeFilter.of_cells(
        np.concatenate([centres[1:], centres[[0, 0]]]),
        np.concatenate([volumes[1:], volumes[0] * pieces]),
        radius,
    ).sensitivities(
        np.concatenate([density[1:], density[[0, 0]]]),
        np.concatenate([gradient[1:], gradient[0] * pieces]),
    )
    np.testing.assert_allclose(split, np.concatenate([whole[1:], whole[0] * pieces]))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 999), share=st.floats(0.1, 0.9))
def test_optimality_criteria(seed, share):
    rng = np.random.default_rng(seed)
    density, gradient = rng.random(50), -(rng.random(50) ** 4)
    volume = rng.uniform(0.5, 2.0, 50)
    low, high = np.maximum(0.0, density - 0.2), np.minimum(1.0, density + 0.2)
    target = share * volume @ low + (1.0 - share) * volume @ high
    found = optimality_criteria(density, gradient, volume, target, 0.2)
    assert np.all(found >= low)
    assert np.all(found <= high)
    np.testing.assert_allclose(volume @ found, target, rtol=1e-6)
    # Strictly between the bounds every cell gives the same gain for its volume.
    inner = (found > low + 1e-9) & (found < high - 1e-9)
    gain = -gradient[inner] / volume[inner] * (density[inner] / found[inner]) ** 2
    if inner.any():
        np.testing.assert_allclose(gain, gain.mean(), rtol=1e-6)


def test_a_cell_without_gain_is_emptied():
    density = np.full(4, 0.5)
    found = optimality_criteria(density, np.array([-1.0, -1.0, 0.0, 2.0]), np.ones(4), 1.6, 0.3)
    np.testing.assert_allclose(found, [0.6, 0.6, 0.2, 0.2], atol=1e-6)
    np.testing.assert_array_equal(
        optimality_criteria(density, np.ones(4), np.ones(4), 1.6, 0.2), 0.5
    )
