import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.fem.materials import plane_stress
from ccfem.fem.plates.mesh import raster_mesh
from ccfem.fem.plates.problem import (
    rotate_plane,
    stack_plane,
    strain_in_axes,
    stress_in_axes,
    turned_by,
)
from ccfem.fem.plates.solve import PlaneElements
from ccfem.fem.topopt.design import harmonics

Q = plane_stress(73200.0, 4100.0, 0.33, 2200.0)
WANG = plane_stress(18300.0, 19800.0, 0.17, 5150.0)
ANGLES = st.floats(-4.0, 4.0)


@settings(max_examples=30, deadline=None)
@given(angle=ANGLES)
def test_invariants_of_tsai_and_pagano(angle):
    (q11, q12, _), (_, q22, _), (_, _, q66) = Q
    u1 = (3 * q11 + 3 * q22 + 2 * q12 + 4 * q66) / 8
    u2, u3 = (q11 - q22) / 2, (q11 + q22 - 2 * q12 - 4 * q66) / 8
    u4, u5 = (q11 + q22 + 6 * q12 - 4 * q66) / 8, (q11 + q22 - 2 * q12 + 4 * q66) / 8
    c2, s2, c4, s4 = (f(k * angle) for k in (2, 4) for f in (np.cos, np.sin))
    a11, a22, a12, a66 = u1 + u2 * c2 + u3 * c4, u1 - u2 * c2 + u3 * c4, u4 - u3 * c4, u5 - u3 * c4
    a16, a26 = u2 * s2 / 2 + u3 * s4, u2 * s2 / 2 - u3 * s4
    wanted = np.array([[a11, a12, a16], [a12, a22, a26], [a16, a26, a66]])
    np.testing.assert_allclose(rotate_plane(Q, angle), wanted, rtol=1e-11, atol=1e-7)


@settings(max_examples=30, deadline=None)
@given(angle=ANGLES)
def test_five_matrices_turn_an_element(angle):
    elements = PlaneElements(raster_mesh(np.ones((1, 1), dtype=bool)))
    five = elements.matrices(harmonics(WANG))
    direct = elements.matrices(rotate_plane(WANG, angle)[None])[0]
    combined = np.tensordot(turned_by(np.array(angle)), five, axes=1)
    assert np.abs(combined - direct).max() <= 1e-12 * np.abs(direct).max()
    step = 1e-4
    slope = np.tensordot(turned_by(np.array(angle), derivative=True), five, axes=1)
    ends = elements.matrices(rotate_plane(WANG, np.array([angle + step, angle - step])))
    difference = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(slope, difference, atol=1e-6 * np.abs(direct).max())


def test_invariants_of_the_published_laminate():
    # Wang et al. 2021: Q 18.89, 20.44, 3.475, 5.15 GPa; U2 -0.774, U3 1.473.
    np.testing.assert_allclose(
        WANG[[0, 1, 0, 2], [0, 1, 1, 2]] / 1e3, [18.89, 20.44, 3.475, 5.15], rtol=1e-3
    )
    five = harmonics(WANG) / 1e3
    assert five[1, 0, 0] == pytest.approx(-0.774, abs=1e-3)
    assert five[3, 0, 0] == pytest.approx(1.473, abs=1e-3)


@settings(max_examples=30, deadline=None)
@given(angle=ANGLES)
def test_work_is_the_same_in_turned_axes(angle):
    strain = np.array([1e-3, -2e-3, 5e-4])
    stress = rotate_plane(Q, angle) @ strain
    own_stress, own_strain = stress_in_axes(stress, angle), strain_in_axes(strain, angle)
    np.testing.assert_allclose(own_stress, Q @ own_strain, rtol=1e-9, atol=1e-9)
    assert own_stress @ own_strain == pytest.approx(stress @ strain)


def test_layers_are_weighted_by_thickness():
    layers = np.stack([Q, WANG])
    np.testing.assert_allclose(stack_plane(layers, [1.0, 3.0]), 0.25 * Q + 0.75 * WANG)
    with pytest.raises(InputError, match="2 positive numbers"):
        stack_plane(layers, [1.0])
