"""Stress lines in space, against straight lines, circles and counts that are known beforehand."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.body.meshing import extrude
from ccfem.slicing.principal_lines import Tracer, critical_region, strongest_stress, trace
from ccfem.slicing.principal_lines.tracing import ENDS


def constant(mesh, vector):
    return np.tile(np.asarray(vector) / np.linalg.norm(vector), (len(mesh.cells), 1))


@pytest.fixture(scope="module")
def bar():
    return box_mesh((40.0, 10.0, 10.0), (16, 4, 4))


@pytest.fixture(scope="module")
def ring():
    outline = shapely.Point(0.0, 0.0).buffer(30.0, quad_segs=32)
    return extrude(outline.difference(shapely.Point(0.0, 0.0).buffer(15.0, quad_segs=32)), 6.0, 2.0)


def test_strongest_is_the_largest_in_size_whatever_its_sign():
    stress = np.stack([np.diag([3.0, -5.0, 1.0]), np.diag([3.0, -2.0, 0.0]), np.zeros((3, 3))])
    found = strongest_stress(stress)
    np.testing.assert_allclose(found.value, [-5.0, 3.0, 0.0])
    np.testing.assert_allclose(np.abs(found.direction), [[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(found.distinct, [0.4, 1.0 / 3.0, 0.0])


def test_across_is_mutual_and_leaves_out_the_boundary(bar):
    cell, side = np.nonzero(bar.across >= 0)
    other = bar.across[cell, side]
    assert (bar.across[other] == cell[:, None]).any(axis=1).all()
    assert (bar.across < 0).sum() == len(bar.boundary)
    assert len(cell) == 2 * len(bar.neighbours)


@pytest.mark.parametrize("vector", [(1.0, 0.0, 0.0), (3.0, 1.0, -2.0)])
def test_lines_of_a_constant_field_are_straight_from_wall_to_wall(bar, vector):
    direction = constant(bar, vector)
    seeds = np.arange(0, len(bar.cells), 7)
    unit = direction[0]
    centre = bar.points[bar.corners].mean(axis=1)
    traced = Tracer.of(bar, direction).survey(seeds, np.zeros(len(bar.cells), dtype=np.int64))
    assert {ENDS[k] for k in traced.ends.ravel()} == {"boundary"}
    # The exact length of a line through each seed, cut at the box.
    with np.errstate(divide="ignore"):
        near, far = (bar.bounds[0] - centre[seeds]) / unit, (bar.bounds[1] - centre[seeds]) / unit
    exact = np.maximum(near, far).min(axis=1) - np.minimum(near, far).max(axis=1)
    np.testing.assert_allclose(traced.length, exact, rtol=1e-9)
    for seed, line in zip(seeds[:40], trace(bar, direction, seeds[:40]), strict=True):
        away = line - centre[seed]
        assert np.abs(away - np.outer(away @ unit, unit)).max() < 1e-9


@pytest.mark.parametrize("rise", [0.3, 0.0])
def test_signs_of_the_directions_mean_nothing(ring, rise):
    """An eigenvector's sign is that of its solver; without a rise, halves of lines meet."""
    middle = ring.points[ring.corners].mean(axis=1)
    direction = np.stack([-middle[:, 1], middle[:, 0], rise * middle[:, 0]], axis=1)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    flips = np.random.default_rng(1).choice([-1.0, 1.0], len(direction))
    seeds = np.arange(0, len(direction), 11)
    one, other = (Tracer.of(ring, d) for d in (direction, direction * flips[:, None]))
    for a, b in zip(one.lines(seeds), other.lines(seeds), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)
    np.testing.assert_array_equal(one.crossings(seeds), other.crossings(seeds))


def test_lines_round_an_axis_keep_their_radius(ring):
    middle = ring.points[ring.corners].mean(axis=1)
    direction = np.stack([-middle[:, 1], middle[:, 0], 0.0 * middle[:, 0]], axis=1)
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    radius = np.hypot(middle[:, 0], middle[:, 1])
    seeds = np.flatnonzero((radius > 20.0) & (radius < 25.0))[::5]
    for seed, line in zip(seeds, trace(ring, direction, seeds), strict=True):
        drift = np.hypot(line[:, 0], line[:, 1]) / radius[seed] - 1.0
        # Straight steps leave the circle by the square of the cell over the radius, each.
        assert np.abs(drift).max() < 0.15
        assert np.abs(np.median(drift)) < 0.05
        np.testing.assert_allclose(line[:, 2], middle[seed, 2], atol=1e-9)


def test_every_line_along_a_bar_joins_its_ends(bar):
    ends = [np.unique(bar.patch(name)) for name in ("x_min", "x_max")]
    region = critical_region(bar, constant(bar, (1.0, 0.0, 0.0)), ends)
    assert region.kept.all()
    assert (region.crossings > 0).all()
    # Every line crosses as many cells as lie on it: all crossings, counted line by line.
    tracer = Tracer.of(bar, constant(bar, (1.0, 0.0, 0.0)))
    each = sum(tracer.crossings(np.array([seed])) for seed in range(len(bar.cells)))
    np.testing.assert_array_equal(region.crossings, each)
    assert region.weight[region.crossings > 0].mean() == pytest.approx(1.0, rel=0.2)
    assert region.weight.max() <= 5.0


def test_lines_that_join_nothing_are_refused_with_the_cure(bar):
    ends = [np.unique(bar.patch(name)) for name in ("x_min", "x_max")]
    across = constant(bar, (0.0, 1.0, 0.0))
    with pytest.raises(InputError, match=r'no stress line joins two of the 2 joints.*"touching"'):
        critical_region(bar, across, ends)
    touching = critical_region(bar, across, ends, keep="touching")
    x = bar.points[bar.corners][..., 0]
    at_end = (x.min(axis=1) == 0.0) | (x.max(axis=1) == 40.0)
    np.testing.assert_array_equal(touching.crossings > 0, at_end)
    assert critical_region(bar, across, ends, keep="all").kept.all()


def test_only_the_pairs_asked_for_count(bar):
    walls = [np.unique(bar.patch(name)) for name in ("x_min", "x_max", "y_min")]
    along = constant(bar, (1.0, 0.0, 0.0))
    with pytest.raises(InputError, match="no stress line joins"):
        critical_region(bar, constant(bar, (0.0, 0.0, 1.0)), walls[:2], pairs=[(0, 1)])
    assert critical_region(bar, along, walls, pairs=[(0, 1)]).kept.all()
    beside = critical_region(bar, along, walls, pairs=[(0, 2)]).kept
    # Lines along the bar touch the wall y_min only in its own layer of cells.
    y = bar.points[bar.corners].mean(axis=1)[:, 1]
    assert beside.any()
    assert y[beside].max() < 2.5 < y[~beside].max()


def test_without_stress_there_is_no_line(bar):
    none = np.zeros((len(bar.cells), 3))
    traced = Tracer.of(bar, none).survey(np.arange(4), np.zeros(len(bar.cells), dtype=np.int64))
    assert {ENDS[k] for k in traced.ends.ravel()} == {"no direction"}
    assert not traced.length.any()
