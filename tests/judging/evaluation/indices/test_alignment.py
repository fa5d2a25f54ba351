"""Alignment with hand-made stress."""

import numpy as np
import pytest

from ccfem.judging.evaluation.indices.alignment import alignment_indices, sample_alignment
from ccfem.slicing.layers.layer import stress_on


def indices(part, *lines):
    on_layer = stress_on(part.layers[0], part.stress)
    return alignment_indices(sample_alignment(part.plane(*lines), on_layer, 1.0))


def strand(degrees, length=20.0):
    half = 0.5 * length * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    centre = np.array([30.0, 20.0])
    return [centre - half, centre + half]


@pytest.mark.parametrize("degrees", [0.0, 5.0, 15.0, 25.0, 60.0, 90.0, 175.0, -30.5])
def test_a_straight_strand_in_uniform_tension(pulled, degrees):
    values = indices(pulled, strand(degrees))
    angle = min(degrees % 180.0, -degrees % 180.0)
    assert values["angle_mean"] == pytest.approx(angle, abs=1e-9)
    for limit in (10, 20, 30):
        assert values[f"aligned_{limit}"] == (1.0 if angle < limit else 0.0)
        assert values[f"aligned_stress_{limit}"] == values[f"aligned_{limit}"]
    assert values["efficiency"] == pytest.approx(np.cos(np.radians(angle)) ** 2)
    assert values["no_tension"] == 0.0


def test_shares_go_by_length(pulled):
    values = indices(pulled, strand(0.0, 30.0), strand(45.0, 10.0))
    assert values["aligned_20"] == pytest.approx(0.75)
    assert values["angle_mean"] == pytest.approx(45.0 / 4.0)
    assert values["efficiency"] == pytest.approx(0.75 + 0.25 * 0.5)


def test_pure_shear_pulls_at_45_degrees(make_part, uniform):
    part = make_part(uniform(0.0, 0.0, 7.0))
    assert indices(part, strand(45.0))["angle_mean"] == pytest.approx(0.0, abs=1e-9)
    assert indices(part, strand(45.0))["efficiency"] == pytest.approx(1.0)
    across = indices(part, strand(-45.0))
    assert across["angle_mean"] == pytest.approx(90.0)
    assert across["efficiency"] == pytest.approx(-1.0)


def test_stress_weighting_follows_the_tension(make_part):
    # Tension along x grows as x / 60 from 0 to 1 MPa; the strand turns from x to y at x = 30.
    def bending(points):
        tensor = np.zeros((len(points), 3, 3))
        tensor[:, 0, 0] = points[:, 0] / 60.0
        return tensor

    values = indices(make_part(bending), [[0, 10], [30, 10]], [[30, 5], [30, 35]])
    along, across = 30.0 * 0.25, 30.0 * 0.5
    assert values["aligned_10"] == pytest.approx(0.5)
    assert values["aligned_stress_10"] == pytest.approx(along / (along + across))
    assert values["efficiency"] == pytest.approx(along / (along + across))


def test_in_compression_the_angle_is_to_the_larger_principal_value(make_part, uniform):
    part = make_part(uniform(-10.0, -2.0))
    values = indices(part, strand(90.0))
    assert values["angle_mean"] == pytest.approx(0.0, abs=1e-9)
    assert values["aligned_10"] == 1.0
    assert values["no_tension"] == 1.0
    assert np.isnan(values["aligned_stress_10"])
    assert np.isnan(values["efficiency"])


def test_half_the_fibre_in_tension(make_part):
    # A beam in pure bending: along x, -1 MPa at y = 0 to 1 MPa at y = 40.
    def bending(points):
        tensor = np.zeros((len(points), 3, 3))
        tensor[:, 0, 0] = points[:, 1] / 20.0 - 1.0
        return tensor

    part = make_part(bending)
    values = indices(part, [[30, 0], [30, 40]])
    assert values["no_tension"] == pytest.approx(0.5)
    # In tension the fibre lies across; in compression the direction without stress is its own.
    assert values["aligned_10"] == pytest.approx(0.5)
    assert values["aligned_stress_10"] == 0.0
    assert values["efficiency"] == pytest.approx(0.0, abs=1e-12)
    low = indices(part, [[5, 30], [55, 30]], [[5, 10], [55, 10]])
    assert low["efficiency"] == pytest.approx(0.0, abs=1e-12)
    assert indices(part, [[5, 30], [55, 30]])["efficiency"] == pytest.approx(1.0)


@pytest.mark.parametrize("equal", [0.0, 5.0, -5.0])
def test_without_a_direction_there_is_no_angle(make_part, uniform, equal):
    values = indices(make_part(uniform(equal, equal)), strand(30.0))
    assert np.isnan([values["angle_mean"], values["aligned_10"], values["aligned_30"]]).all()
    assert values["no_tension"] == (0.0 if equal > 0.0 else 1.0)
    if equal > 0.0:
        assert values["efficiency"] == pytest.approx(1.0)
    else:
        assert np.isnan(values["efficiency"])


def test_fibre_outside_the_part_meets_no_stress(pulled):
    on_layer = stress_on(pulled.layers[0], pulled.stress)
    samples = sample_alignment(pulled.plane([[30, -20], [30, 40]]), on_layer, 1.0)
    assert samples.length.sum() == pytest.approx(40.0)
    nothing = alignment_indices(
        sample_alignment(pulled.plane([[0, -20], [30, -20]]), on_layer, 1.0)
    )
    assert np.isnan(list(nothing.values())).all()


def test_scaling_the_load_changes_no_index(make_part, uniform):
    lines = strand(20.0), strand(-40.0, 12.0)
    small = indices(make_part(uniform(3.0, -1.0, 2.0)), *lines)
    large = indices(make_part(uniform(3000.0, -1000.0, 2000.0)), *lines)
    assert large == pytest.approx(small)


def test_out_of_plane_stress_does_not_count(make_part):
    def vertical(points):
        tensor = np.zeros((len(points), 3, 3))
        tensor[:, 2, 2] = 100.0
        tensor[:, 0, 2] = tensor[:, 2, 0] = 50.0
        tensor[:, 0, 0] = 1.0
        return tensor

    values = indices(make_part(vertical), strand(10.5))
    assert values["angle_mean"] == pytest.approx(10.5)
    assert values["efficiency"] == pytest.approx(np.cos(np.radians(10.5)) ** 2)


def test_the_angle_where_the_tension_is_highest(make_part):
    """Tension along x that grows with x: of a strand along x and one that turns at its end."""

    def growing(points):
        tensor = np.zeros((len(points), 3, 3))
        tensor[:, 0, 0] = 1.0 + points[:, 0]
        return tensor

    part = make_part(growing)
    # 40 mm along the tension, then 10 mm at 45 degrees where it is highest: the last fifth.
    step = 10.0 / np.sqrt(2.0)
    line = [[5, 5], [45, 5], [45 + step, 5 + step]]
    values = indices(part, line)
    assert values["angle_mean"] == pytest.approx(0.2 * 45.0, rel=0.01)
    assert values["angle_mean_top_20"] == pytest.approx(45.0, rel=0.05)
    # without tension there are no critical places
    none = make_part(lambda points: np.zeros((len(points), 3, 3)))
    assert np.isnan(indices(none, line)["angle_mean_top_20"])
