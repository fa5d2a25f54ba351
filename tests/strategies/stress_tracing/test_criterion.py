import numpy as np
import pytest
import shapely

from ccfem.strategies.stress_tracing.stress_lines import (
    Criterion,
    misalignment,
    plane_stress_at,
    stress_lines,
)


def test_smoothness_by_hand():
    """Equation 4 with k = eta = 1, epsilon = 0.1: from 0.1 at 0 to 1 at the limit."""
    rule = Criterion(90.0, 45.0, 3.0)
    np.testing.assert_allclose(rule([0.0, 45.0, 90.0], 45.0, 3.0), [0.1, 0.55, 1.0])
    np.testing.assert_allclose(rule(90.0, [0.0, 22.5, 45.0], 3.0), [0.1, 0.55, 1.0])
    np.testing.assert_allclose(rule(90.0, 45.0, [0.0, 1.5, 3.0]), [0.1, 0.55, 1.0])


def test_smoothness_is_the_product():
    """A third of every limit: each factor is 0.9 / 3 + 0.1."""
    assert Criterion(90.0, 45.0, 3.0)(30.0, 15.0, 1.0) == pytest.approx(0.4**3)


def test_stress_lines_of_pull_push_and_equal_stress():
    pull, push, shear, equal, nothing = np.array(
        [[9.0, 1.0, 0.0], [1.0, -9.0, 0.0], [0.0, 0.0, 3.0], [5.0, 5.0, 0.0], [0.0, 0.0, 0.0]]
    )
    lines = stress_lines(np.stack([pull, push, shear, equal, nothing]))
    np.testing.assert_allclose(lines.value[:4], [9.0, -9.0, 3.0, 5.0])
    # Pure shear pulls one way and pushes across it alike: it has no one direction.
    np.testing.assert_array_equal(lines.defined, [True, True, False, False, False])
    across = np.array([[0.0, 1.0]] * 5)
    beta = misalignment(across, lines, 22.5)
    np.testing.assert_allclose(beta, [90.0, 0.0, 22.5, 22.5, 22.5], atol=1e-9)
    np.testing.assert_allclose(misalignment(-across, lines, 22.5), beta, atol=1e-9)


def test_stress_at_points_is_that_of_the_layer(stressed):
    stress = stressed(shapely.box(0, 0, 20, 10), [[4.0, 1.0], [1.0, -2.0]])
    at = np.array([[5.0, 5.0], [20.5, 5.0], [40.0, 5.0]])
    expected = [[4.0, -2.0, 1.0], [4.0, -2.0, 1.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(plane_stress_at(stress, at, 1.0), expected, atol=1e-12)
