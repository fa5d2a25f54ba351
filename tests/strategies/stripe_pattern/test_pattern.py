import numpy as np
import pytest

from ccfem.geometry.facets import signed_areas
from ccfem.strategies.stripe_pattern.pattern import (
    Cells,
    isocurves,
    line_field,
    refined,
    stripe_pattern,
)


def grid(nx, ny, size=1.0):
    """Squares of a size, mm, each cut in two triangles."""
    x, y = np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij")
    points = size * np.column_stack([x.ravel(), y.ravel()]).astype(float)
    a = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def annulus(inner, outer, around, across):
    """Rings of triangles about the origin."""
    points, triangles = grid(around, across)
    seam = points[:, 0] == around
    number = np.where(seam, np.arange(len(points)) - around * (across + 1), np.arange(len(points)))
    angle = 2.0 * np.pi * points[:, 0] / around
    radius = inner + (outer - inner) * points[:, 1] / across
    places = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return places[~seam], number[triangles][:, [0, 2, 1]]


def uniaxial(angle, count):
    """Tension of 1 MPa at an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.tile([c * c, s * s, c * s], (count, 1))


def test_halved_edges_keep_area_and_linear_values():
    points, triangles = grid(3, 2, 5.0)
    plane = points @ [[2.0], [-1.0]] + 3.0
    finer, cells, values = refined(points, triangles, plane, 1.0)
    np.testing.assert_allclose(values, finer @ [[2.0], [-1.0]] + 3.0)
    areas = signed_areas(finer, cells)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(15.0 * 10.0)
    sides = finer[cells] - finer[np.roll(cells, 1, axis=1)]
    assert np.linalg.norm(sides, axis=2).max() <= 1.0 + 1e-9


def test_directions_follow_the_tension_whatever_its_size():
    points, triangles = grid(12, 8)
    cells = Cells(points, triangles)
    for size in (1e-9, 1.0, 1e9):
        stress = size * uniaxial(0.7, len(points))
        angle = line_field(cells, stress, np.zeros(len(cells.edges), bool), 2.0, 5.0)
        np.testing.assert_allclose(angle, 0.7, atol=1e-5)


def test_without_a_direction_the_border_gives_one():
    """Equal stress in all directions has none, nor has compression alone any to follow."""
    points, triangles = grid(30, 4)
    cells = Cells(points, triangles)
    for stress in ([1.0, 1.0, 0.0], [-1.0, -2.0, 0.0], [0.0, 0.0, 0.0]):
        angle = line_field(cells, np.tile(stress, (len(points), 1)), cells.border, 2.0, 5.0)
        middle = np.abs(points[:, 0] - 15.0) < 8.0
        np.testing.assert_allclose(angle[middle], 0.0, atol=0.02)
    nothing = line_field(
        cells, np.zeros((len(points), 3)), np.zeros(len(cells.edges), bool), 2.0, 5.0
    )
    assert np.isfinite(nothing).all()


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.9])
def test_curves_of_a_constant_direction_are_straight_and_a_pitch_apart(angle):
    points, triangles = grid(20, 16, 0.8)
    cells = Cells(points, triangles)
    # The sign of the direction is any, point by point.
    flipped = np.random.default_rng(1).integers(2, size=len(points))
    lines = isocurves(stripe_pattern(cells, angle + np.pi * flipped, 1.0))
    across = np.array([-np.sin(angle), np.cos(angle)])
    level = np.sort([float((line @ across).mean()) for line in lines])
    for line in lines:
        assert np.ptp(line @ across) < 1e-3
    np.testing.assert_allclose(np.diff(level), 1.0, atol=1e-3)
    extent = np.ptp(points @ across)
    assert extent - 1.0 <= len(lines) <= extent + 1.0


@pytest.mark.parametrize(("pitch", "seed"), [(0.9, 0), (1.0, 0), (1.0, 1), (1.3, 1)])
def test_a_border_draws_curves_to_half_a_pitch_from_it(pitch, seed):
    """On a strip any phase fits: without a border that draws it, chance decides."""
    points, triangles = grid(20, 16, 0.8)
    cells = Cells(points, triangles)
    below = cells.border & (points[cells.edges, 1].max(axis=1) < 1e-9)
    off = []
    for rim in (None, below):
        pattern = stripe_pattern(cells, np.zeros(len(points)), pitch, seed, rim)
        first = min(float(line[:, 1].mean()) for line in isocurves(pattern))
        off.append(abs(first - 0.5 * pitch))
    assert off[1] < 0.6 * off[0]


def test_curves_round_a_hole_are_circles():
    points, triangles = annulus(6.0, 12.0, 90, 10)
    cells = Cells(points, triangles)
    around = np.arctan2(points[:, 1], points[:, 0]) + 0.5 * np.pi
    lines = isocurves(stripe_pattern(cells, around, 1.0))
    assert len(lines) in (5, 6, 7)
    radii = []
    for line in lines:
        np.testing.assert_array_equal(line[0], line[-1])
        away = np.hypot(*line.T)
        assert np.ptp(away) < 0.05
        radii.append(away.mean())
    np.testing.assert_allclose(np.diff(np.sort(radii)), 1.0, atol=0.05)


def test_a_fan_branches_and_a_half_turn_of_the_direction_ends_curves():
    """Radial lines a pitch apart: the outer circle crosses twice as many as the inner one."""
    points, triangles = annulus(6.0, 12.0, 90, 10)
    cells = Cells(points, triangles)
    radial = np.arctan2(points[:, 1], points[:, 0])
    lines = isocurves(stripe_pattern(cells, radial, 1.0))
    ends = np.hypot(*np.array([line[k] for line in lines for k in (0, -1)]).T)
    assert abs(np.count_nonzero(ends > 11.9) - 2.0 * np.pi * 12.0) < 8.0
    assert abs(np.count_nonzero(ends < 6.1) - 2.0 * np.pi * 6.0) < 8.0
    # Directions that turn by half a turn round the middle have no sign that fits everywhere.
    points, triangles = grid(20, 20, 0.8)
    place = points - 8.37
    half = 0.5 * np.arctan2(place[:, 1], place[:, 0])
    lines = isocurves(stripe_pattern(Cells(points, triangles), half, 1.0))
    total = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
    assert total == pytest.approx(16.0 * 16.0, rel=0.15)


def test_curves_do_not_depend_on_signs_and_are_mirrored_with_the_layer():
    points, triangles = annulus(6.0, 12.0, 60, 8)
    angle = np.arctan2(points[:, 1], points[:, 0]) + 0.05 * points[:, 0]
    lines = isocurves(stripe_pattern(Cells(points, triangles), angle, 1.1))
    flipped = np.pi * np.random.default_rng(2).integers(2, size=len(points))
    again = isocurves(stripe_pattern(Cells(points, triangles), angle + flipped, 1.1))
    mirror = np.array([-1.0, 1.0])
    mirrored = Cells(points * mirror, triangles[:, [0, 2, 1]])
    image = isocurves(stripe_pattern(mirrored, np.pi - angle, 1.1))
    assert len(lines) == len(again) == len(image)
    for others, turn in ((again, np.ones(2)), (image, mirror)):
        both = [
            np.sort(np.concatenate(some) * t, axis=0) for some, t in ((lines, 1), (others, turn))
        ]
        np.testing.assert_allclose(*both, atol=1e-6)
