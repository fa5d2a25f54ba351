"""Coverage by strands of known area, and against exact areas."""

import numpy as np
import pytest
import shapely

from ccfem.judging.evaluation.indices.coverage import coverage_indices, sample_coverage
from ccfem.slicing.layers.layer import stress_on


def indices(part, *lines, width=1.0):
    on_layer = stress_on(part.layers[0], part.stress)
    return coverage_indices(sample_coverage(part.plane(*lines), on_layer, width))


def strands(pitch, first=0.0):
    return [[[0, y], [60, y]] for y in np.arange(first + 0.5 * pitch, 40.0, pitch)]


@pytest.mark.parametrize("first", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("pitch", [2.0, 2.5, 4.0])
def test_parallel_strands_cover_width_over_pitch(pulled, pitch, first):
    lines = strands(pitch, first)
    exact = len(lines) * 1.0 / 40.0
    assert indices(pulled, *lines)["coverage"] == pytest.approx(exact, abs=0.006)


def test_strands_at_the_pitch_of_their_width_cover_everything(pulled):
    values = indices(pulled, *strands(1.0))
    for name in ("coverage", "coverage_stress", "coverage_quartile_1", "coverage_top_10"):
        assert values[name] == pytest.approx(1.0, abs=0.002)


def test_overlapping_strands_do_not_count_twice(pulled):
    line = [[0, 20], [60, 20]]
    assert indices(pulled, line, line)["coverage"] == pytest.approx(1.0 / 40.0, abs=0.001)


@pytest.mark.parametrize("width", [0.5, 1.0, 2.0])
def test_crooked_paths_cover_the_area_of_their_buffer(pulled, width):
    rng = np.random.default_rng(11)
    lines = [
        np.clip(rng.random(2) * [60, 40] + rng.normal(size=(30, 2)).cumsum(axis=0), 0, [60, 40])
        for _ in range(10)
    ]
    band = shapely.union_all([shapely.LineString(line).buffer(0.5 * width, 64) for line in lines])
    exact = band.intersection(pulled.layers[0].plane.polygon).area / 2400.0
    assert indices(pulled, *lines, width=width)["coverage"] == pytest.approx(exact, rel=0.01)


def gradient(points):
    """Tension along x that grows with y from 0 to 4 MPa."""
    tensor = np.zeros((len(points), 3, 3))
    tensor[:, 0, 0] = points[:, 1] / 10.0
    return tensor


def test_stress_weighting_and_quartiles(make_part):
    part = make_part(gradient)
    # Only y in [30, 35] is covered: half of the highest quartile, nothing else.
    values = indices(part, *[[[0, y], [60, y]] for y in 30.5 + np.arange(5)])
    assert values["coverage"] == pytest.approx(5.0 / 40.0, abs=0.002)
    assert values["coverage_stress"] == pytest.approx(5.0 * 3.25 / (40.0 * 2.0), abs=0.003)
    assert [values[f"coverage_quartile_{k}"] for k in (1, 2, 3)] == pytest.approx(
        [0, 0, 0], abs=0.03
    )
    assert values["coverage_quartile_4"] == pytest.approx(0.5, abs=0.03)
    # The top 20 % lie above y = 32, the top 10 % above y = 36.
    assert values["coverage_top_20"] == pytest.approx(3.0 / 8.0, abs=0.03)
    assert values["coverage_top_10"] == 0.0


def test_equal_stress_counts_in_full(pulled):
    values = indices(pulled, [[0, 20], [60, 20]])
    # Of the two free rectangles only the corners are too narrow: 1 - pi/4 mm^2 in each.
    assert values.pop("gap_area") == pytest.approx(2.0 * (1.0 - 0.25 * np.pi), abs=0.3)
    for name, value in values.items():
        assert value == pytest.approx(values["coverage"]), name


def test_without_tension_only_the_area_counts(make_part, uniform):
    for stress in (uniform(0.0), uniform(-3.0, -1.0)):
        values = indices(make_part(stress), [[0, 20], [60, 20]])
        assert np.isnan(values.pop("coverage_stress"))
        assert values.pop("gap_area") < 1.0
        assert list(values.values()) == pytest.approx([1.0 / 40.0] * 8, abs=0.001)


def test_fibre_outside_the_section_covers_nothing(pulled):
    assert indices(pulled, [[0, -20], [60, -20]], [[-50, 90], [-20, 90]])["coverage"] == 0.0
    # Half of a strand on the edge lies inside.
    assert indices(pulled, [[0, 0], [60, 0]])["coverage"] == pytest.approx(0.5 / 40.0, abs=0.003)


def test_overfill_counts_overlapping_strands_twice(pulled):
    values = indices(pulled, *[[[0, y], [60, y]] for y in (10, 10, 10.4, 20)], width=2.0)
    assert values["overfill"] == pytest.approx(4 * 2.0 / 40.0)
    assert values["coverage"] == pytest.approx((2.4 + 2.0) / 40.0, abs=0.001)


def test_no_path_covers_nothing(pulled):
    values = indices(pulled)
    assert values.pop("gap_area") == pytest.approx(1.0 - 0.25 * np.pi, abs=0.15)
    assert set(values.values()) == {0.0}


@pytest.mark.parametrize(("pitch", "gap"), [(1.0, 0.0), (1.6, 0.6), (2.6, 0.0)])
def test_gaps_are_what_is_too_narrow_for_a_strand(pulled, pitch, gap):
    """Strands from end to end of a plate of 60 mm: between two a slit of pitch less width."""
    lines = [[[-1, y], [61, y]] for y in 10.0 + pitch * np.arange(4)]
    found = sample_coverage(pulled.plane(*lines), stress_on(pulled.layers[0], pulled.stress), 1.0)
    area = coverage_indices(found)["gap_area"]
    assert area == pytest.approx(3 * 60.0 * gap, rel=0.01, abs=1.0)
