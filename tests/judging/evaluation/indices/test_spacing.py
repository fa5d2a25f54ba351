"""Spacing of strands at known distances, and against a brute-force search."""

import numpy as np
import pytest
import shapely
from shapely.ops import substring

from ccfem.judging.evaluation.indices.spacing import sample_spacing, spacing_indices
from ccfem.machine import Machine


def indices(paths, width=1.0):
    return spacing_indices(sample_spacing(paths, width), Machine(fibre_width=width))


@pytest.mark.parametrize("pitch", [0.4, 0.985, 0.995, 1.0, 1.7, 4.9])
def test_straight_strands_at_a_pitch(pulled, pitch):
    values = indices(pulled.plane(*[[[5, y], [55, y]] for y in 5.0 + pitch * np.arange(5)]))
    for name in ("spacing_1", "spacing_5", "spacing_50"):
        assert values[name] == pytest.approx(pitch)
    assert values["spacing_below"] == (1.0 if pitch < 0.99 else 0.0)


@pytest.mark.parametrize("width", [0.5, 1.0, 3.0])
def test_a_strand_on_its_own_has_the_largest_spacing(pulled, width):
    assert indices(pulled.plane([[5, 5], [55, 5]]), width)["spacing_1"] == pytest.approx(5 * width)
    far = pulled.plane([[5, 5], [55, 5]], [[5, 5.0 + 6.0 * width], [55, 5.0 + 6.0 * width]])
    assert indices(far, width)["spacing_50"] == pytest.approx(5.0 * width)
    assert indices(far, width)["spacing_below"] == 0.0


def test_the_distance_is_to_the_strand_not_to_its_points(pulled):
    # Two points only, 40 mm apart, beside the middle of the other strand.
    values = indices(pulled.plane([[10, 10], [50, 10]], [[29, 11.3], [31, 11.3]]))
    samples = sample_spacing(pulled.plane([[10, 10], [50, 10]], [[29, 11.3], [31, 11.3]]), 1.0)
    assert values["spacing_1"] == pytest.approx(1.3)
    assert samples.distance.min() == pytest.approx(1.3)


def test_a_fan_has_the_spacing_of_its_places(pulled):
    # Two strands that part at a small angle: the distance grows with the way.
    angle = 0.1
    samples = sample_spacing(
        pulled.plane(
            [[10, 10], [50, 10]], [[10, 10], [10 + 50 * np.cos(angle), 10 + 50 * np.sin(angle)]]
        ),
        1.0,
    )
    way = 0.2 * (np.arange(200) + 0.5)
    expected = np.minimum(way * np.sin(angle), 5.0)
    assert samples.distance[:200] == pytest.approx(expected, abs=1e-9)


def test_the_own_path_counts_from_five_widths_on(pulled):
    # A hairpin 2 mm wide: beyond the turn each leg has the other one beside it.
    hairpin = [[10, 10], [40, 10], [40, 12], [10, 12]]
    samples = sample_spacing(pulled.plane(hairpin), 1.0)
    way = (np.arange(len(samples.distance)) + 0.5) * samples.length[0]
    beside = way < 30.0 - 1.5
    assert samples.distance[beside] == pytest.approx(2.0)
    # At the turn: straight to the point that is 5 mm further along.
    turn = np.argmin(np.abs(way - 30.0))
    on_path = shapely.LineString(hairpin)
    here, there = on_path.interpolate(way[turn]), on_path.interpolate(way[turn] + 5.0)
    back = on_path.interpolate(way[turn] - 5.0)
    expected = min(here.distance(there), here.distance(back))
    assert samples.distance[turn] == pytest.approx(expected, abs=1e-9)


def test_a_closed_path_counts_the_shorter_way_round(pulled):
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    for radius, expected in ((10.0, 2.0 * 10.0 * np.sin(0.25)), (1.5, 3.0), (0.7, 5.0)):
        ring = np.array([30.0, 20.0]) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        ring[-1] = ring[0]
        # On a ring of 9.4 mm nothing is further than 4.7 mm along it.
        expected = 5.0 if np.pi * radius < 5.0 else expected
        samples = sample_spacing(pulled.plane(ring), 1.0)
        assert samples.distance == pytest.approx(expected, rel=1e-3)


def test_touching_and_crossing_strands_have_no_spacing(pulled):
    values = indices(pulled.plane([[10, 10], [20, 10]], [[10, 10], [20, 10]]))
    assert values["spacing_50"] == 0.0
    assert values["spacing_below"] == 1.0


def test_random_paths_against_brute_force(pulled):
    rng = np.random.default_rng(5)
    lines = [
        np.array([30.0, 20.0]) + rng.normal(size=(rng.integers(2, 40), 2)).cumsum(axis=0)
        for _ in range(8)
    ]
    samples = sample_spacing(pulled.plane(*lines), 1.0)
    curves = [shapely.LineString(line) for line in lines]
    expected = []
    for k, curve in enumerate(curves):
        count = max(1, round(curve.length / 0.2))
        for way in (np.arange(count) + 0.5) * curve.length / count:
            here = curve.interpolate(way)
            rest = [c for j, c in enumerate(curves) if j != k]
            if way > 5.0:
                rest.append(substring(curve, 0.0, way - 5.0))
            if way < curve.length - 5.0:
                rest.append(substring(curve, way + 5.0, curve.length))
            expected.append(min([5.0, *(here.distance(c) for c in rest)]))
    assert samples.distance == pytest.approx(np.array(expected), abs=1e-7)


def test_no_path(pulled):
    assert np.isnan(list(indices(pulled.plane()).values())).all()
