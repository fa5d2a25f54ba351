"""Agreement, the sensitivity curve f, and the index PI."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.fem.elasticity import GivenStress
from ccfem.fem.materials import isotropic, named_material
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.indices.stiffness_alignment import (
    READINGS,
    agreement,
    performance_index,
    stiffness_alignment_indices,
)
from ccfem.judging.evaluation.sensitivity import OffAxis, acute, strand_lamina
from ccfem.judging.virtual_testing import Strand
from ccfem.machine import Machine

MACHINE = Machine()


def engineering_modulus(angle, e1, e2, nu12, g12):
    """E(theta) / E1 of a lamina by its engineering constants (Jones 1999, eq. 2.97)."""
    c, s = np.cos(angle), np.sin(angle)
    return 1.0 / (c**4 + (e1 / g12 - 2.0 * nu12) * s**2 * c**2 + e1 / e2 * s**4)


TABLE_5 = {
    "c_fram": (73200.0, 4100.0, 0.33, 2200.0),
    "s_fram": (1900.0, 1100.0, 0.41, 700.0),
}


@pytest.mark.parametrize("name", TABLE_5)
def test_curve_of_uniform_tension_is_the_off_axis_modulus(name):
    angle = np.radians(np.linspace(0.0, 90.0, 721))
    expected = engineering_modulus(angle, *TABLE_5[name])
    found = OffAxis(named_material(name))(angle)
    np.testing.assert_allclose(found, expected / expected.max(), rtol=1e-5)
    assert found.max() <= 1.0


@pytest.mark.parametrize(("name", "drop"), [("c_fram", 94.4), ("s_fram", 42.1)])
def test_drop_at_90_degrees(name, drop):
    # E2 / E1 of table 5; s_fram is at its stiffest 13 degrees off the fibre.
    found = float(OffAxis(named_material(name))(np.array(np.pi / 2.0)))
    assert 100.0 * (1.0 - found) == pytest.approx(drop, abs=0.2)


def test_curve_of_an_isotropic_sheet_is_one():
    angle = np.linspace(0.0, np.pi / 2.0, 7)
    np.testing.assert_allclose(OffAxis(isotropic(1000.0, 0.3))(angle), 1.0, rtol=1e-12)


def test_acute_angles_and_agreement():
    angle = np.radians([0.0, 45.0, 90.0, 135.0, 180.0, -30.0, 725.0])
    np.testing.assert_allclose(np.degrees(acute(angle)), [0, 45, 90, 45, 0, 30, 5], atol=1e-9)
    np.testing.assert_allclose(agreement(angle)[:4], [1.0, 0.5, 0.0, 0.5], atol=1e-12)


def test_index_in_its_three_readings_by_hand():
    factor, energy = np.array([1.0, 0.5, 0.25]), np.array([2.0, 1.0, 0.0])
    weighted = (1.0 * 2.0 + 0.5 * 1.125 + 0.25) / (2.0 + 1.125 + 1.0)
    assert performance_index(factor, energy) == pytest.approx(weighted)
    assert performance_index(factor, energy, "literal") == pytest.approx(1.0 + 1.0625 / 3.0)
    assert performance_index(factor, energy, "harmonic") == pytest.approx(3.0 / 4.0)
    with pytest.raises(InputError, match="there are: weighted, literal, harmonic"):
        performance_index(factor, energy, "other")


def test_single_peak_does_not_rule_the_weights():
    energy = np.concatenate([np.ones(999), [1e9]])
    factor = np.concatenate([np.full(999, 0.5), [1.0]])
    assert performance_index(factor, energy) == pytest.approx(0.5005)


def test_no_sample_and_no_energy_have_no_index():
    for reading in READINGS:
        assert np.isnan(performance_index(np.zeros(0), np.zeros(0), reading))
        assert np.isnan(performance_index(np.ones(3), np.zeros(3), reading))


def full_of_strands(angle, modulus, nu, share):
    """E(theta) / E1 of an isotropic sheet with E `share` more stiffness along axis 1.

    Axial bars leave nu12 and G12 of the matrix; E1 is the sum of both, and across them strain is
    hindered: E2 of Q22 - Q12^2 / Q11.
    """
    e1 = modulus * (1.0 + share)
    q22 = modulus / (1.0 - nu**2)
    e2 = q22 - (nu * q22) ** 2 / (q22 + share * modulus)
    return engineering_modulus(angle, e1, e2, nu, modulus / (2.0 * (1.0 + nu)))


@pytest.mark.parametrize("share", [0.0, 0.5, 2.0, 40.0])
def test_curve_of_a_matrix_with_strands(share):
    angle = np.radians(np.linspace(0.0, 90.0, 721))
    expected = full_of_strands(angle, 3500.0, 0.35, share)
    found = OffAxis(strand_lamina(isotropic(3500.0, 0.35), share))(angle)
    np.testing.assert_allclose(found, expected / expected.max(), rtol=1e-5)


@pytest.mark.parametrize(("sign", "rho"), [(1.0, None), (-1.0, None), (1.0, 1.0)])
def test_fibre_along_and_across_uniaxial_stress(make_part, uniform, sign, rho):
    part = make_part(uniform(10.0 * sign), count=2)
    # The part is of E 1000, nu .3; its layers are 1 mm high, its strands 1 mm wide with EA 4 E.
    strand = None if rho is None else Strand(rho)
    for degrees in (0.0, 30.0, 45.0, 90.0):
        d = 10.0 * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        paths = part.paths(np.array([30.0, 20.0]) + np.array([-d, d]))
        total = evaluate(paths, part.layers, part.stress, MACHINE, strand).total
        angles = np.radians([degrees, *np.linspace(0.0, 90.0, 9001)])
        kept, *all_round = full_of_strands(angles, 1000.0, 0.3, rho or 4.0)
        kept /= max(all_round)
        assert total["agreement"] == pytest.approx(1.0 - degrees / 90.0, abs=1e-9)
        assert total["stiffness_alignment"] == pytest.approx(kept)
        assert total["stiffness_alignment_harmonic"] == pytest.approx(kept)


def test_stress_alone_is_weighed_with_the_material_of_the_paper(make_part, uniform):
    part = make_part(uniform(10.0))
    given = GivenStress(part.stress.mesh, part.stress.stress, part.stress.nodal)
    paths = part.paths(np.array([[30.0, 10.0], [30.0, 30.0]]))
    total = evaluate(paths, part.layers, given, MACHINE).total
    assert total["stiffness_alignment"] == pytest.approx(4.1 / 73.2)


def test_grids_under_uniaxial_stress_agree_by_half(make_part, uniform):
    part = make_part(uniform(5.0))
    for first in (0.0, 45.0):
        lines = []
        for degrees in (first, first + 90.0):
            d = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
            lines.append(np.array([30.0, 20.0]) + 10.0 * np.array([-d, d]))
        total = evaluate(part.paths(*lines), part.layers, part.stress, MACHINE).total
        assert total["agreement"] == pytest.approx(0.5)


def test_pure_shear_has_no_strongest_direction(make_part, uniform):
    part = make_part(uniform(0.0, 0.0, 3.0))
    total = evaluate(part.paths([[10, 20], [40, 20]]), part.layers, part.stress, MACHINE).total
    assert np.isnan(total["agreement"])
    assert np.isnan(total["stiffness_alignment"])


def test_harmonic_index_weighs_by_energy(pulled):
    from ccfem.judging.evaluation.indices.alignment import AlignmentSamples

    # Stress 2 along the fibre, 1 across it: energies 4 to 1 for the stress along the fibre.
    samples = AlignmentSamples(
        np.ones(2), np.array([0.0, np.pi / 2.0]), np.array([2.0, 1.0]), np.zeros(2), np.zeros(2)
    )
    found = stiffness_alignment_indices(samples, named_material("c_fram"))
    kept = float(OffAxis(named_material("c_fram"))(np.array(np.pi / 2.0)))
    assert found["stiffness_alignment_harmonic"] == pytest.approx(5.0 / (4.0 + 1.0 / kept))
