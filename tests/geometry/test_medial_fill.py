"""Strands along the medial axis: as many as a strip is wide."""

import numpy as np
import pytest
import shapely

from ccfem.geometry.shapes import strings
from ccfem.strategies.mat import medial_fill


@pytest.mark.parametrize("count", range(1, 8))
def test_strip_of_whole_width_is_filled_once(count):
    strip = shapely.box(0.0, 0.0, 80.0, count)
    lines = strings(medial_fill(strip, 1.0, 0.6))
    bands = shapely.buffer(lines, 0.5)
    covered = shapely.union_all(bands).intersection(strip)
    assert covered.area > 0.985 * strip.area
    # No more fibre than there is room for, so none lies on other fibre.
    assert shapely.length(lines).sum() <= 1.001 * strip.area
    # In the middle the strands lie where the strip is cut into equal shares.
    across = shapely.linestrings([[40.0, -1.0], [40.0, count + 1.0]])
    met = [shapely.get_coordinates(shapely.intersection(line, across))[:, 1] for line in lines]
    np.testing.assert_allclose(np.sort(np.concatenate(met)), np.arange(count) + 0.5, atol=0.01)


def test_plate_with_a_hole_stays_symmetric():
    plate = shapely.box(-40.0, -15.0, 40.0, 15.0).difference(shapely.Point(0.0, 0.0).buffer(7.0))
    lines = medial_fill(plate, 1.0, 0.6)
    bands = shapely.union_all(shapely.buffer(strings(lines), 0.5))
    for mirror in ([-1.0, 1.0], [1.0, -1.0]):
        other = shapely.transform(bands, lambda points, by=mirror: points * by)
        assert shapely.symmetric_difference(bands, other).area < 2e-3 * plate.area
