"""Smooth indices of first failure, and their derivatives."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.elasticity.zone import ball_averages, ball_shares
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing import failure_laws, first_failure, virtual_test
from ccfem.judging.virtual_testing.failure_laws import fibre, matrix
from ccfem.judging.virtual_testing.failure_laws.interlayer import interlayer
from ccfem.judging.virtual_testing.near_failure import (
    MatrixPeaks,
    Peak,
    check_stretched,
    nearness,
    stretched_index,
)
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strength import matrix_peak
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar

NORMAL = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def beam():
    """A beam, 24 x 10 x 4 mm, clamped at one end, its tip pushed at a slant."""
    mesh = box_mesh((24.0, 10.0, 4.0), (9, 4, 2))
    material = replace(
        isotropic(3500.0, 0.35), tensile_strength=50.0, interlayer_tensile=18.0, interlayer_shear=14
    )
    loads = {"tip": (Force("x_max", (10.0, 20.0, 30.0)),)}
    return solve(Problem(mesh, material, (Support("x_min"),), loads, order=1))["tip"]


def brittle(stress, limits, normal):
    """Rankine's law: the largest principal stress reaches the strength."""
    return np.linalg.eigvalsh(stress)[:, -1] / limits.matrix


def judged(beam, what, displacement):
    limits = Limits(86.0, 50.0, (18.0, 14.0))
    return MatrixPeaks(beam).peaks(displacement, None, limits, NORMAL)[what]


@pytest.fixture
def with_brittle(monkeypatch):
    laws = {**failure_laws.named(), "brittle": SimpleNamespace(index=brittle)}
    monkeypatch.setattr(failure_laws, "named", lambda: laws)


@pytest.mark.usefixtures("with_brittle")
@pytest.mark.parametrize("what", ["matrix", "interlayer", "brittle"])
def test_derivative_agrees_with_finite_differences(beam, what):
    u, rng = beam.displacement, np.random.default_rng(3)
    found = judged(beam, what, u)
    direction = rng.normal(size=u.shape) * np.abs(u).max() * 0.01
    ends = [np.log(judged(beam, what, u + h * direction).norm) for h in (1e-4, -1e-4)]
    slope = float(np.vdot(found.by_displacement, direction))
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)
    # Indices grow with the load: the derivative along the displacement itself is that of a power.
    assert np.vdot(found.by_displacement, u) == pytest.approx(1.0, rel=1e-7)


def test_peaks_are_those_of_first_failure(beam):
    assert judged(beam, "matrix", beam.displacement).index == pytest.approx(
        matrix_peak(beam)[0] / 50.0, rel=1e-12
    )
    bond = interlayer(beam, Planar(count=2).cut(beam.mesh)).index
    assert judged(beam, "interlayer", beam.displacement).index == pytest.approx(bond, rel=1e-12)


@pytest.mark.usefixtures("with_brittle")
def test_a_law_that_is_an_index_alone_fails_where_that_is_largest(beam):
    """Its load and its place are those of the index away from loads and supports."""
    layers = Planar(count=2).cut(beam.mesh)
    line = Toolpaths.from_plane([[[1.0, 5.0], [23.0, 5.0]]], layers[0])
    test = virtual_test(line, beam, Strand(rho=1e-6), span=())
    failure = first_failure(test, layers=layers)
    near = judged(beam, "brittle", test.solution.displacement).index
    assert test.force / failure.loads["brittle"] == pytest.approx(near, rel=1e-9)


@pytest.mark.parametrize("values", [None, np.nan])
def test_an_index_that_judges_nothing_is_named(beam, monkeypatch, values):
    law = SimpleNamespace(index=lambda stress, *_: values and np.full(len(stress), values))
    monkeypatch.setattr(
        failure_laws, "named", lambda: {"matrix": matrix, "fibre": fibre, "mute": law}
    )
    layers = Planar(count=1).cut(beam.mesh)
    line = Toolpaths.from_plane([[[1.0, 5.0], [23.0, 5.0]]], layers[0])
    failure = first_failure(virtual_test(line, beam, span=()))
    assert failure.note == "law of failure 'mute' did not judge the part, and gave no reason"


def test_derivative_where_cells_are_weaker_than_their_material(beam):
    cells = len(beam.mesh.cells)
    strength = np.random.default_rng(5).uniform(0.2, 1.0, cells)
    weak = solve(replace(beam.problem, strength=strength))["tip"]
    u, rng = weak.displacement, np.random.default_rng(6)
    direction = rng.normal(size=u.shape) * np.abs(u).max() * 0.01
    for what in ("matrix", "interlayer"):
        slope = float(np.vdot(judged(weak, what, u).by_displacement, direction))
        ends = [np.log(judged(weak, what, u + h * direction).norm) for h in (1e-4, -1e-4)]
        assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)
    assert judged(weak, "matrix", u).index == pytest.approx(matrix_peak(weak)[0] / 50.0, rel=1e-12)
    layers = Planar(count=2).cut(beam.mesh)
    bond = interlayer(weak, layers).index
    assert judged(weak, "interlayer", u).index == pytest.approx(bond, rel=1e-12)
    assert bond > 1.2 * interlayer(beam, layers).index


def test_derivative_on_cells_with_midside_nodes(beam):
    problem = replace(beam.problem, mesh=beam.mesh.quadratic(), order=2)
    fine = solve(problem)["tip"]
    u, rng = fine.displacement, np.random.default_rng(4)
    direction = rng.normal(size=u.shape) * np.abs(u).max() * 0.01
    slope = float(np.vdot(judged(fine, "matrix", u).by_displacement, direction))
    ends = [np.log(judged(fine, "matrix", u + h * direction).norm) for h in (1e-4, -1e-4)]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-5)


def test_fibre_index_is_the_highest_strain_and_its_norm_that_of_all():
    strain = np.array([0.001, 0.002, 0.004, -0.01])
    length = np.array([60.0, 39.5, 0.4, 0.1])
    index, norm, counted = stretched_index(strain, length, 0.002, 0.004)
    assert index == pytest.approx(0.5)
    assert counted.sum() == pytest.approx(1.0)
    assert counted[3] == 0.0
    # The norm of one strain alone is that strain, times its length to the power 1/16.
    alone = stretched_index(strain[:1], length[:1], 0.001, 0.004)
    assert alone[1] == pytest.approx(0.25 * 60.0 ** (1.0 / 16.0), rel=1e-12)
    assert norm > 1.0 * 0.4 ** (1.0 / 16.0)


def test_fibre_has_to_be_stretched_under_one_load_case_at_least():
    pushed, pulled = np.array([-1e-3, 0.0]), np.array([-1e-3, 1e-9])
    with pytest.raises(InputError, match="stretched"):
        check_stretched([pushed, pushed])
    with pytest.raises(InputError, match="stretched"):
        check_stretched([np.zeros(0)])
    check_stretched([pushed, pulled])


def test_what_has_no_factor_does_not_count():
    zero = np.zeros((1, 3))
    peaks = {"fibre": Peak(0.4, 0.2, zero), "matrix": Peak(0.3, 0.3, zero)}
    for factors in ({"matrix": 1.0}, {"matrix": 1.0, "fibre": 0.0}):
        near, counts = nearness(peaks, factors)
        assert counts == {"fibre": 0.0, "matrix": 1.0}
        assert np.exp(near) == pytest.approx(0.3)


def test_shares_of_balls_are_the_transpose_of_their_averages():
    rng = np.random.default_rng(5)
    points, weights = 8.0 * rng.random((300, 3)), 0.1 + rng.random(300)
    judged = rng.choice(300, 120, replace=False)
    values, slopes = rng.standard_normal((300, 2)), rng.standard_normal((120, 2))
    averages = ball_averages(points, values, weights, judged, 1.5)
    shares = ball_shares(points, slopes, weights, judged, 1.5)
    assert (slopes * averages).sum() == pytest.approx((shares * values).sum(), rel=1e-12)


@pytest.mark.parametrize("size", [8.0, 3000.0])
def test_averages_over_balls_of_parts_of_any_size(size):
    # Groups of points within a millimetre, in a part of 3 m as of 8 mm: beside each distance.
    rng = np.random.default_rng(7)
    points = (size * rng.random((60, 1, 3)) + rng.random((60, 5, 3))).reshape(-1, 3)
    values, weights = rng.standard_normal((300, 2)), 0.1 + rng.random(300)
    near = np.linalg.norm(points[:, None] - points, axis=2) <= 1.5
    expected = (near * weights) @ values / (near @ weights)[:, None]
    found = ball_averages(points, values, weights, np.arange(300), 1.5)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("size", [0.5, 2.0, 6.0])
def test_averages_over_balls_that_hold_many_boxes(size):
    rng = np.random.default_rng(11)
    points, weights = size * rng.random((900, 3)), 0.1 + rng.random(900)
    values, judged = 1.0 + rng.random((900, 2)), rng.permutation(900)[:300]
    near = np.linalg.norm(points[judged][:, None] - points, axis=2) <= 1.5
    expected = (near * weights) @ values / (near @ weights)[:, None]
    found = ball_averages(points, values, weights, judged, 1.5)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_largest_index_counts_most_and_equal_ones_alike():
    zero = np.zeros((1, 3))
    factors = {"fibre": 2.0, "matrix": 1.0}
    alike = {"fibre": Peak(0.4, 0.2, zero), "matrix": Peak(0.4, 0.4, zero)}
    near, counts = nearness(alike, factors)
    assert counts == pytest.approx({"fibre": 0.5, "matrix": 0.5})
    assert np.exp(near) == pytest.approx(0.4 * 2.0 ** (1.0 / 8.0))
    near, counts = nearness({**alike, "matrix": Peak(0.1, 0.1, zero)}, factors)
    assert counts["fibre"] > 0.9999
    assert np.exp(near) == pytest.approx(0.4, rel=1e-4)


@pytest.mark.parametrize(
    ("strand", "material", "message"),
    [
        (Strand(strength=None), {"tensile_strength": 50.0}, "strength of a strand, N"),
        (Strand(), {}, "strength of the matrix, MPa"),
    ],
)
def test_missing_strengths_are_asked_for(strand, material, message):
    with pytest.raises(InputError, match=message):
        Limits.of(replace(isotropic(3500.0, 0.35), **material), strand)
