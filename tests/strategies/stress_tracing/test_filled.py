"""What is done to the tracks of all main paths together: open places filled, symmetry."""

import numpy as np
import pytest
import shapely
import shapely.affinity

from ccfem.geometry.symmetry import mirror_lines
from ccfem.strategies.svt import blobs, made_symmetric, rest_of


def test_an_open_place_is_filled_and_keeps_off_the_strands():
    """A box with strands over its left half: the right half is laid full."""
    section = shapely.box(0, 0, 60, 30)
    lines = [np.array([[x, 0.0], [x, 30.0]]) for x in np.arange(0.5, 30.0)]
    (spirals,) = blobs(section, lines, 1.0, 1.0, 20.0)
    laid = shapely.union_all([shapely.LineString(line).buffer(0.5) for line in spirals])
    open_ = shapely.box(30, 0, 60, 30)
    assert shapely.intersection(laid, open_).area > 0.95 * open_.area
    assert shapely.difference(laid, open_).area < 1e-6
    assert rest_of(section, [*lines, *spirals], 1.0, 2.0).is_empty
    # What is laid full has no open place, and a spiral shorter than is allowed is none.
    full = [np.array([[x, 0.0], [x, 30.0]]) for x in np.arange(0.5, 60.0)]
    assert blobs(section, full, 1.0, 1.0, 20.0) == []
    assert blobs(section, full[:-2], 1.0, 1.0, 80.0) == []


@pytest.mark.parametrize("angle", [0.0, 37.0])
def test_tracks_become_mirror_images_of_each_other(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    turn = np.array([[c, s], [-s, c]])
    box = shapely.box(0, 0, 60, 30)
    section = shapely.transform(box, lambda points: points @ turn)
    x = np.linspace(0.0, 60.0, 61)
    wave = 0.2 * np.sin(0.3 * x)
    across = [np.stack([x, y + wave], axis=1) for y in (10.0, 15.0, 20.0)]
    up = np.stack([np.linspace(5.0, 20.0, 31), np.linspace(0.0, 30.0, 31)], axis=1)
    down = np.stack([np.linspace(55.3, 40.2, 41), np.linspace(0.0, 30.0, 41)], axis=1)
    lone = np.array([[30.0, 0.0], [48.0, 30.0]])
    groups = [[line @ turn for line in group] for group in (across, [up], [down], [lone])]
    found = made_symmetric(groups, section, 1.0)
    found = [[line @ turn.T for line in group] for group in found]
    curves = [shapely.LineString(line) for group in found[:3] for line in group]
    for axis, middle in ((0, 30.0),):
        for curve in curves:
            points = shapely.get_coordinates(curve).copy()
            points[:, axis] = 2.0 * middle - points[:, axis]
            image = shapely.LineString(points)
            assert min(image.hausdorff_distance(other) for other in curves) < 0.02
    np.testing.assert_allclose(found[3][0], lone, atol=1e-12)
    # Nothing is symmetric in a section that is not.
    wedge = shapely.Polygon([(0, 0), (60, 0), (60, 30), (0, 20)])
    same = made_symmetric([across, [up]], wedge, 1.0)
    np.testing.assert_array_equal(same[0][1], across[1])


def test_mirrors_are_found_in_any_direction():
    """Those of a rectangle, a square, a ring about a square hole, and an isosceles triangle."""
    ring = shapely.Point(3, 4).buffer(5.0) - shapely.box(2, 3, 4, 5)
    triangle = shapely.Polygon([(0, 0), (60, 0), (30, 20)])
    scalene = shapely.Polygon([(0, 0), (60, 0), (20, 20)])
    cases = [(shapely.box(0, 0, 60, 30), 2), (shapely.box(0, 0, 9, 9), 2), (ring, 2)]
    for section, count in [*cases, (triangle, 1), (scalene, 0)]:
        for angle in (0.0, 37.0):
            turned = shapely.affinity.rotate(section, angle)
            found = mirror_lines(turned)
            assert len(found) == count
            for mirror in found:
                np.testing.assert_allclose(
                    mirror.point, shapely.get_coordinates(turned.centroid)[0], atol=1e-6
                )
    (mirror,) = mirror_lines(shapely.affinity.rotate(triangle, 37.0))
    upright = np.radians(127.0)
    assert abs(mirror.direction @ [np.cos(upright), np.sin(upright)]) == pytest.approx(1.0)
