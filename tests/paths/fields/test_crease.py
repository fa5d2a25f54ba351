"""Where the signs of a field of lines are cut: along the lines of fields that are known."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from ccfem.paths.fields.directed import orient_along
from ccfem.paths.fields.layer_elements import Surface

HOLE, RIM = 5.0, 20.0


def disc_with_hole(spacing: float) -> Surface:
    """Annulus meshed without regard to any direction."""
    random = np.random.default_rng(3)
    inner = [HOLE * np.array([np.cos(a), np.sin(a)]) for a in np.arange(0.0, 2 * np.pi, 0.1)]
    grid = np.arange(-RIM, RIM, spacing)
    points = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    points = points + random.uniform(-0.2, 0.2, points.shape) * spacing
    radius = np.hypot(*points.T)
    points = np.concatenate([inner, points[(radius > HOLE + 0.4 * spacing) & (radius < RIM)]])
    triangles = Delaunay(points).simplices
    centre = points[triangles].mean(axis=1)
    return Surface(points, triangles[np.hypot(*centre.T) > HOLE])


def turned_by_half(points: np.ndarray, axis: float) -> np.ndarray:
    angle = axis + 0.5 * np.mod(np.arctan2(points[:, 1], points[:, 0]) - axis, 2.0 * np.pi)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def opposed(surface: Surface, direction: np.ndarray) -> np.ndarray:
    """Places where neighbours point against each other."""
    i, j = surface.neighbours.T
    against = np.einsum("ij,ij->i", direction[i], direction[j]) < 0.0
    centre = surface.points[surface.triangles].mean(axis=1)
    return 0.5 * (centre[i] + centre[j])[against]


@pytest.mark.parametrize("axis", [0.0, 0.6, 2.5])
@pytest.mark.parametrize("spacing", [0.8, 1.4])
def test_confocal_parabolas_are_cut_along_one_of_them(axis: float, spacing: float) -> None:
    # Half a turn round the hole: lines at half the polar angle, on which 2 sqrt(r) sin(angle / 2)
    # is constant; its slope is 1 / sqrt(r).
    surface = disc_with_hole(spacing)
    lines = turned_by_half(surface.points[surface.triangles].mean(axis=1), axis)
    lines = lines * np.random.default_rng(1).choice([-1.0, 1.0], len(lines))[:, None]
    cut = opposed(surface, orient_along(surface, lines, np.ones(len(lines))))
    radius = np.hypot(*cut.T)
    polar = np.mod(np.arctan2(cut[:, 1], cut[:, 0]) - axis + np.pi, 2.0 * np.pi) - np.pi
    assert radius.min() < HOLE + spacing
    assert radius.max() > RIM - 2.0 * spacing
    assert np.ptp(2.0 * np.sqrt(radius) * np.sin(0.5 * polar)) < 0.75 * spacing / np.sqrt(HOLE)


def test_no_cut_where_a_continuous_choice_exists() -> None:
    surface = disc_with_hole(1.4)
    centre = surface.points[surface.triangles].mean(axis=1)
    hoop = np.column_stack([-centre[:, 1], centre[:, 0]]) / np.hypot(*centre.T)[:, None]
    random = np.random.default_rng(2)
    mixed = hoop * random.choice([-1.0, 1.0], len(hoop))[:, None]
    result = orient_along(surface, mixed, random.uniform(0.0, 1.0, len(hoop)))
    assert len(opposed(surface, result)) == 0
    np.testing.assert_array_equal(np.abs(result), np.abs(mixed))
