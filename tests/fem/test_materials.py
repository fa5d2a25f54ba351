import numpy as np
import pytest
from hypothesis import given, strategies as st

from ccfem.base import tensor
from ccfem.base.errors import InputError
from ccfem.fem.materials import (
    Material,
    isotropic,
    material_names,
    named_material,
    plane_stress,
    transversely_isotropic,
)


def engineering_constants(material):
    compliance = np.linalg.inv(material.stiffness)
    e = 1.0 / np.diag(compliance)
    return e, -compliance[0, 1] * e[0], -compliance[1, 2] * e[1]


def test_isotropic_gives_back_its_constants():
    e, nu12, nu23 = engineering_constants(isotropic(3500.0, 0.35))
    np.testing.assert_allclose(e[:3], 3500.0)
    np.testing.assert_allclose(e[3:], 3500.0 / 2.7)
    assert nu12 == pytest.approx(0.35)
    assert nu23 == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("name", "c11", "c12", "c22", "c23", "g23"),
    [
        # Closed form of the transversely isotropic stiffness, evaluated in the specification.
        ("c_fram", 74.86, 2.516, 5.226, 2.398, 1.414),
        ("s_fram", 2.941, 1.269, 1.927, 1.168, 0.379),
        ("mf_carbon", 61.67, 2.528, 5.245, 2.417, 1.414),
    ],
)
def test_published_stiffness(name, c11, c12, c22, c23, g23):
    c = named_material(name).stiffness / 1000.0
    got = [c[0, 0], c[0, 1], c[1, 1], c[1, 2], c[3, 3]]
    np.testing.assert_allclose(got, [c11, c12, c22, c23, g23], atol=6e-3)


@given(
    st.floats(0.5e3, 2e5),
    st.floats(0.5e3, 2e4),
    st.floats(0.0, 0.4),
    st.floats(100.0, 1e4),
    st.floats(-0.2, 0.45),
)
def test_transversely_isotropic_is_symmetric_about_the_fibre(e1, e2, nu, g, nu23):
    if nu23 >= 0.99 - 2.0 * nu * nu * e2 / e1:
        return
    c = transversely_isotropic(e1, e2, nu, g, nu23).stiffness
    angle = 0.7
    turn = np.array(
        [
            [1.0, 0.0, 0.0],
            [0.0, np.cos(angle), -np.sin(angle)],
            [0.0, np.sin(angle), np.cos(angle)],
        ]
    )
    np.testing.assert_allclose(tensor.rotate_stiffness(c, turn), c, rtol=1e-9, atol=1e-9 * c.max())


def test_plane_stress_is_the_three_dimensional_law_without_stress_across():
    e1, e2, nu, g = 18300.0, 9800.0, 0.17, 5150.0
    material = transversely_isotropic(e1, e2, nu, g, 0.3)
    keep = [0, 1, 5]
    condensed = np.linalg.inv(np.linalg.inv(material.stiffness)[np.ix_(keep, keep)])
    np.testing.assert_allclose(plane_stress(e1, e2, nu, g), condensed, rtol=1e-12)


@pytest.mark.parametrize("name", material_names())
def test_every_material_of_the_table_says_where_it_comes_from(name):
    material = named_material(name)
    assert material.name == {"printed_pla": "PLA+"}.get(name, name)
    assert material.source


def test_unknown_material_lists_the_known():
    with pytest.raises(InputError, match=r"no material named 'wood'; there are: .*pla"):
        named_material("wood")


@pytest.mark.parametrize(
    "make",
    [
        lambda: isotropic(-1.0, 0.3),
        lambda: isotropic(1.0, 0.5),
        lambda: isotropic(float("nan"), 0.3),
        lambda: transversely_isotropic(1000.0, 9000.0, 0.4, 500.0),
        lambda: plane_stress(1000.0, 9000.0, 0.4, 500.0),
        lambda: Material("bad", np.diag([1.0, 1, 1, 1, 1, -1])),
        lambda: Material("bad", np.eye(3)),
        lambda: Material("bad", np.eye(6) + 0.1 * np.eye(6, k=3)),
    ],
)
def test_impossible_constants_are_refused(make):
    with pytest.raises(InputError):
        make()


@pytest.mark.parametrize("field", ["tensile_strength", "compressive_strength"])
def test_strengths_are_above_zero(field):
    for value in (-50.0, 0.0, np.nan):
        with pytest.raises(InputError, match=rf"material\.{field} must be .*above 0 MPa; got"):
            isotropic(3000.0, 0.3, **{field: value})
