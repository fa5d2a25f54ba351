"""Areas of surfaces in cells, against the B-spline that the section of a simplex is."""

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.strategies.fibre_aware.heights import areas_in_cells

SIZE = (4.0, 3.0, 2.0)


def sheet(height, slope=(0.0, 0.0), reach=0.0):
    """Two triangles over the base of the box, and beyond it by a reach."""
    ends = [(x, y) for x in (-reach, SIZE[0] + reach) for y in (-reach, SIZE[1] + reach)]
    corners = np.array([(x, y, height + slope[0] * x + slope[1] * y) for x, y in ends])
    return corners[[[0, 2, 1], [1, 2, 3]]]


def sections(mesh, normal, level):
    """Sections of cells, mm^2: volume times the B-spline on the heights of their corners.

    Curry and Schoenberg 1966; by divided differences of truncated powers.
    """
    heights = mesh.points[mesh.corners] @ normal - level
    total = np.zeros(len(heights))
    for i in range(4):
        others = [j for j in range(4) if j != i]
        gaps = np.prod(heights[:, [i]] - heights[:, others], axis=1)
        total += 3.0 * np.maximum(heights[:, i], 0.0) ** 2 / gaps
    return mesh.volumes * total


def areas(mesh, *surfaces):
    return areas_in_cells(mesh.points, mesh.corners, mesh.across, surfaces)


def test_a_sloping_sheet_has_the_section_of_every_cell_that_it_cuts():
    mesh, slope = box_mesh(SIZE, (3, 2, 3)), (0.21, 0.13)
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.hypot(1.0, np.hypot(*slope))
    exact = sections(mesh, normal, 0.4 * normal[2])
    assert (exact > 1e-6).sum() > 30
    np.testing.assert_allclose(areas(mesh, sheet(0.4, slope)), exact, atol=1e-9)


def test_cells_on_both_sides_of_a_sheet_share_it_and_one_at_the_boundary_has_all():
    # Also where the triangles of the sheet are none of the facets in it.
    mesh = box_mesh(SIZE, (3, 2, 2))
    for height, cells_on in ((1.0, 2), (0.0, 1), (2.0, 1)):
        own = areas(mesh, sheet(height))
        facets = mesh.facets[(mesh.points[mesh.facets][..., 2] == height).all(axis=1)]
        at = np.flatnonzero((mesh.points[mesh.facets][..., 2] == height).all(axis=1)) // 4
        size = mesh.facet_areas(facets)[0] / cells_on
        np.testing.assert_allclose(own, np.bincount(at, size, len(own)), atol=1e-12)


@pytest.mark.parametrize("height", [0.7, 1.0, 2.2])
def test_what_lies_outside_all_cells_counts_to_the_nearest(height):
    mesh = box_mesh(SIZE, (3, 2, 2))
    own = areas(mesh, sheet(height, reach=0.5), sheet(0.3))
    assert own.sum() == pytest.approx(5.0 * 4.0 + 4.0 * 3.0, rel=1e-12)
    assert areas(mesh).sum() == 0.0
