"""The paper's rule on stresses made by hand."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from ccfem.paths.fields.tensile import plane_tension, spatial_tension

PRINCIPAL = [
    # principal values, index of the direction taken, stress
    ((5.0, 1.0, -2.0), 0, 5.0),
    ((-5.0, 2.0, 0.0), 1, 2.0),  # |s1/s2| = 2.5 < 3
    ((-5.0, 1.0, 0.0), None, 0.0),  # |s1/s2| = 5
    ((-5.0, -1.0, 0.5), None, 0.0),  # the second by size is compressive
    ((1.0, 0.0, 0.0), 0, 1.0),
]


@pytest.mark.parametrize(("values", "taken", "size"), PRINCIPAL)
def test_rule_in_space(values: tuple, taken: int | None, size: float) -> None:
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    stress = rotation @ np.diag(values) @ rotation.T
    tension = spatial_tension(stress[None])
    assert tension.defined[0] == (taken is not None)
    assert tension.stress[0] == pytest.approx(size)
    direction = rotation[:, taken if taken is not None else 0]
    assert abs(tension.direction[0] @ direction) == pytest.approx(1.0)


@given(
    angle=st.floats(-np.pi / 2, np.pi / 2),
    first=st.floats(-10, 10),
    second=st.floats(-10, 10),
)
def test_plane_rule_is_the_spatial_rule_for_plane_stress(
    angle: float, first: float, second: float
) -> None:
    if abs(abs(first) - abs(second)) < 1e-3 or min(abs(first), abs(second)) < 1e-3:
        return
    if abs(3.0 * max(first, second) + min(first, second)) < 1e-3:
        return
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, -s], [s, c]])
    plane = rotation @ np.diag([first, second]) @ rotation.T
    stress = np.zeros((1, 3, 3))
    stress[0, :2, :2] = plane
    spatial = spatial_tension(stress)
    flat = plane_tension(np.array([[plane[0, 0], plane[1, 1], plane[0, 1]]]))
    assert flat.defined[0] == spatial.defined[0]
    assert flat.stress[0] == pytest.approx(spatial.stress[0])
    if flat.defined[0]:
        assert abs(flat.direction[0] @ spatial.direction[0, :2]) == pytest.approx(1.0)


@pytest.mark.parametrize("factor", [1e-9, 1e6])
def test_tension_of_a_larger_load_is_larger_by_as_much(factor: float) -> None:
    stress = np.random.default_rng(8).normal(size=(40, 3, 3))
    stress = stress + np.swapaxes(stress, 1, 2)
    plane = stress[:, [0, 1, 0], [0, 1, 1]]
    for rule, one in ((spatial_tension, stress), (plane_tension, plane)):
        before, after = rule(one), rule(factor * one)
        assert 0 < before.defined.sum() < len(before.defined)
        np.testing.assert_array_equal(after.defined, before.defined)
        np.testing.assert_allclose(after.stress, factor * before.stress, rtol=1e-12, atol=0.0)
