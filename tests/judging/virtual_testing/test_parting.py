"""Layers that part in a breaking load: analytic loads, what is left, which places are looked at."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.tensor import from_voigt
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.zone import BALL, ball_averages
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.failure_laws import interlayer
from ccfem.judging.virtual_testing.failure_laws.interlayer import parted_stiffness, parting_factors
from ccfem.judging.virtual_testing.progressive_failure import breaking_load
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.slicing.slicers import Planar

from .test_progressive_failure import AREA, bar

ACROSS, ALONG = 12.0, 9.0
"""Strengths between layers, MPa, across them and in their plane."""


@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0])
def test_a_bar_of_tilted_layers_parts_at_the_analytic_load(angle):
    """Where the quadratic criterion of its traction is 1; and then it is in two."""
    part = bar()
    material = replace(part.problem.material, interlayer_tensile=ACROSS, interlayer_shear=ALONG)
    part = replace(part, problem=replace(part.problem, material=material))
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    layers = Planar(count=3).cut(part.mesh, (cosine, 0.0, sine))
    curve = breaking_load(None, part, band=False, layers=layers).curve
    stress = 1.0 / np.hypot(cosine**2 / ACROSS, sine * cosine / ALONG)
    assert stress < 30.0
    assert curve.first == "layers"
    assert curve.load == pytest.approx(stress * AREA, rel=1e-4)
    assert curve.force[-1] < 0.65 * curve.load
    assert curve.utilisation == pytest.approx(1.0, rel=1e-4)
    assert curve.parted[-1] == np.count_nonzero(curve.parted_at >= 0) > 0
    assert f"layers first at {curve.load:.4g} N" in curve.story


def test_layers_along_the_pull_hold():
    part = bar()
    material = replace(part.problem.material, interlayer_tensile=1.0)
    weak = replace(part, problem=replace(part.problem, material=material))
    layers = Planar(count=2).cut(part.mesh, (0.0, 0.0, 1.0))
    with_bond, without = (
        breaking_load(None, given, band=False, layers=layers).curve for given in (weak, part)
    )
    np.testing.assert_array_equal(with_bond.force, without.force)
    assert not with_bond.parted.any()
    assert with_bond.utilisation < 1e-3


def test_parted_layers_carry_within_themselves_alone():
    modulus, poisson = 2000.0, 0.3
    stiffness = isotropic(modulus, poisson).stiffness
    normals = np.array([[0.0, 0.0, 1.0], [2 / 3, -1 / 3, 2 / 3]])
    left = parted_stiffness(stiffness, normals)
    np.testing.assert_allclose(left, left.transpose(0, 2, 1), atol=1e-9)
    # Plane stress in the layer.
    plane = modulus / (1.0 - poisson**2)
    expected = np.array([[plane, poisson * plane], [poisson * plane, plane]])
    np.testing.assert_allclose(left[0][:2, :2], expected, rtol=2e-3)
    strain = np.random.default_rng(3).normal(size=6)
    for matrix, normal in zip(left, normals, strict=True):
        traction = from_voigt(matrix @ strain) @ normal
        before = from_voigt(stiffness @ strain) @ normal
        np.testing.assert_allclose(traction, 1e-3 * before, atol=1e-9)


def test_only_places_near_high_traction_are_averaged_and_none_is_missed():
    mesh = box_mesh((12.0, 12.0, 6.0), (8, 8, 4))
    stress = np.random.default_rng(5).normal(size=(len(mesh.cells), 6))
    normal = np.broadcast_to([0.0, 0.0, 1.0], (len(stress), 3))
    limits, every = Limits(1.0, 1.0, (1.5, 1.5)), np.arange(len(stress))
    tensor = from_voigt(stress).reshape(-1, 9)
    mean = ball_averages(mesh.centres, tensor, mesh.volumes, every, BALL).reshape(-1, 3, 3)
    factors = 1.0 / interlayer.index(mean, limits, normal)
    most = float(np.quantile(factors, 0.1))
    found = parting_factors(mesh, stress, limits, normal, every, most)
    np.testing.assert_allclose(found, np.where(factors <= most, factors, np.inf))
