"""Curvature of circles, sinusoids and corners."""

import numpy as np
import pytest

from ccfem.judging.evaluation.indices.curvature import curvature_indices, sample_curvature
from ccfem.machine import Machine

MACHINE = Machine()


def arc(radius, start=0.0, end=2.0 * np.pi, points=4000, centre=(30.0, 20.0)):
    angle = np.linspace(start, end, points)
    line = np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if end - start == 2.0 * np.pi:
        line[-1] = line[0]
    return line


def indices(paths, step=1.0):
    return curvature_indices(sample_curvature(paths, step), MACHINE)


@pytest.mark.parametrize("radius", [2.0, 5.0, 15.0])
@pytest.mark.parametrize("end", [2.0 * np.pi, 1.7 * np.pi])
def test_a_circle_has_the_curvature_of_its_radius(pulled, radius, end):
    values = indices(pulled.plane(arc(radius, end=end)))
    for name in ("50", "80", "95", "max"):
        assert values[f"curvature_{name}"] == pytest.approx(1.0 / radius, rel=2e-3)
    assert values["curvature_ok"] == (1.0 if radius > MACHINE.minimum_radius else 0.0)
    assert values["turns_45"] == 0.0


def test_a_closed_circle_is_sampled_all_round(pulled):
    samples = sample_curvature(pulled.plane(arc(10.0)), 1.0)
    assert len(samples.curvature) == round(2.0 * np.pi * 10.0)
    # The turning of a closed convex curve is a full turn.
    step = samples.length[0] / len(samples.curvature)
    assert samples.curvature.sum() * step == pytest.approx(2.0 * np.pi)


def test_the_curvature_of_a_sinusoid(pulled):
    x = np.linspace(0.0, 60.0, 6001)
    k = 2.0 * np.pi / 30.0
    line = np.stack([x, 20.0 + 3.0 * np.sin(k * x)], axis=1)
    slope, second = 3.0 * k * np.cos(k * x), -3.0 * k * k * np.sin(k * x)
    exact = np.abs(second) / (1.0 + slope**2) ** 1.5
    weight = np.sqrt(1.0 + slope**2)
    order = np.argsort(exact)
    below = np.cumsum(weight[order]) / weight.sum()
    values = indices(pulled.plane(line), step=0.5)
    for name, share in (("50", 0.5), ("80", 0.8), ("95", 0.95)):
        expected = exact[order][np.searchsorted(below, share)]
        assert values[f"curvature_{name}"] == pytest.approx(expected, rel=0.02)
    assert values["curvature_max"] == pytest.approx(3.0 * k * k, rel=0.02)


def test_a_straight_path_has_none_and_a_short_one_no_value(pulled):
    values = indices(pulled.plane([[5, 5], [25, 5]]))
    assert values["curvature_max"] == 0.0
    assert values["curvature_ok"] == 1.0
    short = indices(pulled.plane([[5, 5], [6.2, 5]]))
    assert np.isnan([short[f"curvature_{k}"] for k in ("50", "80", "95", "max", "ok")]).all()
    assert short["turns_45"] == 0.0


def test_turns_are_counted_per_metre_on_the_planned_points(pulled):
    # Turns by 90, 60 and 30 degrees on 40 mm of fibre.
    line = [np.array([5.0, 5.0])]
    for heading in (0.0, 90.0, 150.0, 180.0):
        step = 10.0 * np.array([np.cos(np.radians(heading)), np.sin(np.radians(heading))])
        line.append(line[-1] + step)
    values = indices(pulled.plane(line))
    assert values["turns_45"] == pytest.approx(2.0 / 0.04)
    # Exactly 90 degrees is not above 90.
    assert values["turns_90"] == 0.0
    hairpin = indices(pulled.plane([[5, 5], [25, 5], [5, 5.5]]))
    assert hairpin["turns_90"] == pytest.approx(1.0 / 0.04, rel=1e-3)


def test_a_closed_square_also_turns_where_it_closes(pulled):
    square = [[5, 5], [15, 5], [15, 15], [5, 15], [5, 5]]
    assert indices(pulled.plane(square))["turns_45"] == pytest.approx(4.0 / 0.04)


def test_more_points_on_the_same_curve_change_nothing(pulled):
    line = arc(8.0, end=5.0, points=40)
    finer = np.insert(line, np.arange(1, len(line)), 0.5 * (line[1:] + line[:-1]), axis=0)
    few, many = indices(pulled.plane(line)), indices(pulled.plane(finer))
    assert many == pytest.approx(few, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("closed", [True, False])
def test_vertices_of_a_polygon_have_the_curvature_of_its_circle(pulled, closed):
    # 33 chords of a circle of 5 mm lie 0.023 mm inside it: none is simplified away.
    line = arc(5.0, end=2.0 * np.pi if closed else np.pi, points=34 if closed else 17)
    samples = sample_curvature(pulled.plane(line), 1.0)
    assert len(samples.native) == (33 if closed else 15)
    assert samples.native == pytest.approx(0.2, rel=1e-9)


@pytest.mark.parametrize("radius", [2.0, 3.0, 4.5, 8.0, 15.0])
def test_a_finely_drawn_circle_is_judged_by_its_radius(pulled, radius):
    values = indices(pulled.plane(arc(radius)))
    assert values["curvature_ok_native"] == (1.0 if radius > MACHINE.minimum_radius else 0.0)


def test_vertices_count_one_by_one_once_straight_ones_are_gone(pulled):
    # Half a circle of 2 mm at the end of two strands; points straight between others do not count.
    turn = arc(2.0, -0.5 * np.pi, 0.5 * np.pi, 10, (40.0, 20.0))
    leg = np.linspace(5.0, 40.0, 30, endpoint=False)
    lower, upper = np.stack([leg, 0 * leg + 18.0], 1), np.stack([leg[::-1], 0 * leg + 22.0], 1)
    wave = np.array([[5.0, 5.0], [20.0, 6.0], [35.0, 5.0], [50.0, 6.0]])
    values = indices(pulled.plane(np.concatenate([lower, turn, upper]), wave))
    # The two where the turn meets the strands have a long step at their side: they bend little.
    assert values["curvature_ok_native"] == pytest.approx((2.0 + 2.0) / (10.0 + 2.0))
    assert values["curvature_ok"] > 0.9


def test_a_corner_is_sharp_however_long_its_sides(pulled):
    corner = sample_curvature(pulled.plane([[5, 5], [25, 5], [25, 25]]), 1.0).native
    assert corner == pytest.approx(np.sqrt(2.0))
    hairpin = sample_curvature(pulled.plane([[5, 5], [25, 5], [15, 5]]), 1.0).native
    assert hairpin == pytest.approx(2.0)
    # Sides shorter than a fibre width count as they are.
    small = sample_curvature(pulled.plane([[5, 5], [5.5, 5], [5.5, 5.25]]), 1.0).native
    assert small == pytest.approx(np.sqrt(2.0) / 0.375)


def test_no_path(pulled):
    values = indices(pulled.plane())
    assert np.isnan(list(values.values())).all()
