"""Levels of a field, and what of a part lies away from its border, against what is known."""

import numpy as np
import pytest

from benchmarks.studies.strand_losses import share_inside
from ccfem.fibre_aware.smeared import SmearedPart
from ccfem.fibre_aware.spline_grid import SplineGrid
from ccfem.fibre_aware.stream_paths import Extraction, refined
from ccfem.machine import Machine

SIDE, HEIGHT = 24.0, 4.0
"""Of the plate, mm."""


def test_levels_of_a_linear_field_are_straight_and_a_unit_apart(two_pulls):
    mesh, layer = two_pulls[0].fields[0].mesh, two_pulls[1][0]
    points = refined(layer)[0]
    grid = SplineGrid.over(points, points.mean(axis=0), np.eye(2), 2.0)
    # Splines of degree two hold a linear field whose coefficients are its values at their middles.
    field = 0.8 * (grid.centre[1] + grid.size * (grid.used[:, 1] + 0.5))
    extraction = Extraction((field,), grid, mesh, (), Machine(), 5, 0.5, 10.0)
    low = points[:, 1].min()
    field = field - 0.8 * low - 0.2  # at the side 0.2 below a whole number
    lines = extraction.levels(layer, field, 0.3)
    assert len(lines) == 19  # 24 mm at 0.8 levels a mm, the first one 0.5 levels from the side
    for k, line in enumerate(sorted(lines, key=lambda line: line[0, 1])):
        np.testing.assert_allclose(line[:, 1], low + (0.5 + k) / 0.8, atol=1e-9)
        assert np.ptp(line[:, 0]) == pytest.approx(SIDE, abs=1e-9)


@pytest.mark.parametrize("inset", [3.0, 6.0])
def test_inside_is_what_is_left_of_a_plate_without_its_outer_cells(two_pulls, inset):
    cases, layers = two_pulls
    part = SmearedPart.of(cases.fields[0], layers[0].plane.frame)
    share = share_inside(part, layers, inset)
    # Insets of whole cells, 3 mm wide: every cell lies on one side.
    assert set(np.unique(share)) == {0.0, 1.0}
    left = (SIDE - 2.0 * inset) ** 2 * HEIGHT
    assert part.mesh.volumes @ share == pytest.approx(left, rel=1e-9)
