"""Evenly spaced streamlines of fields whose lines are known."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from ccfem.base.errors import InputError
from ccfem.geometry.polylines import pack
from ccfem.strategies.streamline import evenly_spaced_streamlines


def sheet(across, along, place):
    """Triangulated grid of u in `across` and v in `along`, mapped to the plane by `place`."""
    u, v = (x.ravel() for x in np.meshgrid(across, along, indexing="ij"))
    n, m = len(across), len(along)
    node = np.arange(n * m).reshape(n, m)
    a, b, c, d = (x.ravel() for x in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    return np.stack(place(u, v), axis=1), triangles


def plate(width, height, step=1.0):
    return sheet(
        np.arange(0, width + step, step), np.arange(0, height + step, step), lambda u, v: (u, v)
    )


def polar(r0, r1, degrees=360.0):
    """Annulus, or sector of one; its seam is closed by common points."""
    points, triangles = sheet(
        np.linspace(r0, r1, 25),
        np.radians(np.linspace(0.0, degrees, 241)),
        lambda r, t: (r * np.cos(t), r * np.sin(t)),
    )
    _, first, number = np.unique(
        np.round(points, 9), axis=0, return_index=True, return_inverse=True
    )
    return points[first], number.ravel()[triangles]


def stress_along(directions):
    """Unit tension along unit vectors (n, 2), growing slightly so that no two are the same."""
    size = 1.0 + 1e-6 * np.arange(len(directions))
    x, y = directions.T
    return size[:, None] * np.stack([x * x, y * y, x * y], axis=1)


def nearest(lines):
    """Distance of each point to the nearest point of another line."""
    points, offsets = pack(lines)
    owner = np.repeat(np.arange(len(lines)), np.diff(offsets))
    return np.concatenate([
        cKDTree(points[owner != k]).query(points[owner == k])[0] for k in range(len(lines))
    ])  # fmt: skip


def test_uniform_tension_gives_parallel_lines() -> None:
    points, triangles = plate(30.0, 10.0)
    stress = np.tile([2.0, 0.0, 0.0], (len(points), 1))
    region = shapely.box(0.5, 0.5, 29.5, 9.5)
    lines = evenly_spaced_streamlines(points, triangles, stress, region, 1.0)
    for line in lines:
        np.testing.assert_allclose(line[:, 1], line[0, 1], atol=1e-9)
        assert np.ptp(line[:, 0]) > 29.0 - 0.21
    heights = np.sort([line[0, 1] for line in lines])
    np.testing.assert_allclose(np.diff(heights), 1.0, rtol=2e-3)
    assert heights[0] - 0.5 < 1.0
    assert 9.5 - heights[-1] < 1.0


def test_hoop_tension_gives_closed_circles() -> None:
    points, triangles = polar(10.0, 20.0)
    radius = np.linalg.norm(points, axis=1)
    hoop = stress_along(np.stack([-points[:, 1], points[:, 0]], axis=1) / radius[:, None])
    region = shapely.Point(0, 0).buffer(19.5).difference(shapely.Point(0, 0).buffer(10.5))
    lines = evenly_spaced_streamlines(points, triangles, hoop, region, 1.0)
    found = []
    for line in lines:
        np.testing.assert_array_equal(line[0], line[-1])
        radii = np.linalg.norm(line, axis=1)
        np.testing.assert_allclose(radii, radii[0], rtol=2e-3)
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        assert length == pytest.approx(2.0 * np.pi * radii.mean(), rel=5e-3)
        found.append(radii.mean())
    assert len(found) >= 8
    np.testing.assert_allclose(np.diff(np.sort(found)), 1.0, atol=0.02)


@pytest.mark.parametrize("closest", [0.5, 0.8])
def test_lines_that_converge_end_before_they_are_too_near(closest) -> None:
    points, triangles = polar(5.0, 25.0, 90.0)
    radial = stress_along(points / np.linalg.norm(points, axis=1)[:, None])
    disc, hole = (shapely.Point(0, 0).buffer(r, quad_segs=64) for r in (24.5, 5.5))
    region = disc.difference(hole).intersection(shapely.box(0.2, 0.2, 30, 30))
    lines = evenly_spaced_streamlines(points, triangles, radial, region, 1.0, closest)
    for line in lines:
        angle = np.arctan2(line[:, 1], line[:, 0])
        assert np.ptp(angle) < 5e-3
    apart = nearest(lines)
    assert apart.min() >= closest - 1e-9
    assert np.percentile(apart, 95) < 2.0
    # At the outside there is room for more lines than at the inside.
    starts = np.array([np.linalg.norm(line, axis=1).min() for line in lines])
    assert (starts < 6.0).sum() < 0.6 * len(lines)


def test_no_gap_is_left_and_every_part_is_reached() -> None:
    one, triangles = plate(20.0, 8.0)
    two = one + np.array([0.0, 20.0])
    points = np.concatenate([one, two])
    both = np.concatenate([triangles, triangles + len(one)])
    x, y = points.T
    way = 0.6 * np.sin(0.3 * x) + 0.1 * y
    stress = stress_along(np.stack([np.cos(way), np.sin(way)], axis=1))
    region = shapely.union_all([shapely.box(0, 0, 20, 8), shapely.box(0, 20, 20, 28)])
    region = region.buffer(-0.5)
    lines = evenly_spaced_streamlines(points, both, stress, region, 1.0)
    assert {bool(line[0, 1] > 14.0) for line in lines} == {True, False}
    assert nearest(lines).min() >= 0.5
    assert np.percentile(nearest(lines), 5) >= 0.5
    middles = points[both].mean(axis=1)
    middles = middles[shapely.contains_xy(region, middles)]
    every, _ = pack(lines)
    # Left out are only places whose own line would be shorter than a separation.
    far = cKDTree(every).query(middles)[0] > 1.0
    assert far.mean() < 0.02
    assert shapely.covers(region, shapely.multipoints(every))


def test_same_lines_again_and_none_without_room() -> None:
    points, triangles = plate(12.0, 5.0)
    stress = np.tile([2.0, 0.0, 0.0], (len(points), 1))
    region = shapely.box(0, 0, 12, 5)
    lines, again = (
        evenly_spaced_streamlines(points, triangles, stress, region, 0.7) for _ in range(2)
    )
    assert len(lines) == len(again)
    for line, same in zip(lines, again, strict=True):
        np.testing.assert_array_equal(line, same)
    assert evenly_spaced_streamlines(points, triangles, stress, shapely.Polygon(), 1.0) == []
    assert evenly_spaced_streamlines(points, triangles, 0.0 * stress, region, 1.0) == []


@pytest.mark.parametrize(
    ("separation", "closest", "message"),
    [
        (0.0, 0.5, "separation of streamlines must be above 0 mm"),
        (1.0, 1.0, "closest must be above 0 and below 1; got 1"),
        (1e-4, 0.5, "separation"),
    ],
)
def test_bad_input_is_refused(separation, closest, message) -> None:
    points, triangles = plate(12.0, 5.0)
    stress = np.tile([2.0, 0.0, 0.0], (len(points), 1))
    with pytest.raises(InputError, match=message):
        evenly_spaced_streamlines(
            points, triangles, stress, shapely.box(0, 0, 12, 5), separation, closest
        )
