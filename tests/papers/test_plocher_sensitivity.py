"""The curve f(theta) through the energies of turned fibre."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.fem.materials import named_material
from ccfem.judging.evaluation.sensitivity import OffAxis
from ccfem.papers.plocher_2022.figures import layup_moduli
from ccfem.papers.plocher_2022.plane_study import ANGLES, Sensitivity, reduced_stiffness


def test_fit_through_the_eleven_angles_stays_near_the_curve():
    curve = OffAxis(named_material("c_fram"))
    fit = Sensitivity(np.array(ANGLES), curve.compliance(np.radians(ANGLES)))
    np.testing.assert_allclose(fit(np.radians(ANGLES)), fit.values, rtol=1e-12)
    angle = np.radians(np.linspace(0.0, 90.0, 361))
    assert np.abs(fit(angle) - curve(angle)).max() < 0.015
    np.testing.assert_allclose(fit(-angle), fit(angle), atol=1e-12)
    np.testing.assert_allclose(fit(np.pi - angle), fit(angle), atol=1e-12)
    assert (np.diff(fit(angle)) <= 0.0).all()


def test_curves_that_are_none_are_refused():
    with pytest.raises(InputError, match="rising angles"):
        Sensitivity(np.array([0.0, 0.0, 90.0]), np.ones(3))
    with pytest.raises(InputError, match="from 0 to 90 degrees"):
        Sensitivity(np.array([5.0, 90.0]), np.ones(2))
    with pytest.raises(InputError, match="energies above 0"):
        Sensitivity(np.array([0.0, 90.0]), np.array([1.0, 0.0]))


def test_modulus_of_layers():
    angle = np.linspace(0.0, np.pi, 37)
    one = layup_moduli(angle, (0.0,), "c_fram")
    np.testing.assert_allclose(one, 1.0 / OffAxis(named_material("c_fram")).compliance(angle))
    turned = layup_moduli(angle, (30.0,), "c_fram")
    np.testing.assert_allclose(turned[6:], one[:-6], rtol=1e-9)  # 30 degrees are six steps
    # Equal layers at right angles, in closed form: A11 - A12^2 / A22 (Jones 1999, section 4.2).
    stiff = reduced_stiffness(named_material("c_fram"))
    along, across = 0.5 * (stiff[0, 0] + stiff[1, 1]), stiff[0, 1]
    expected = along - across**2 / along
    crossed = layup_moduli(angle, (0.0, 90.0), "c_fram")
    np.testing.assert_allclose(crossed[[0, 18, 36]], expected)
    np.testing.assert_allclose(layup_moduli(angle, (45.0, -45.0), "c_fram")[[9, 27]], expected)
