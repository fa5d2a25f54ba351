"""Guides moved aside so that whole strands fit beside them."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from ccfem.geometry.parallel_strands import grow
from ccfem.strategies.mps import fitted_guides

GUIDE = np.array([[0.0, 0.0], [60.0, 0.0]])


def misfit(guides, region):
    """Gap and overlap of strands of width 1 laid from guides, over the area of the region."""
    lines = grow(guides, region, 1.0, 0.6)
    laid = shapely.union_all(
        shapely.buffer([shapely.LineString(x) for x in lines], 0.5, quad_segs=2)
    )
    gaps = region.difference(laid).area
    total = sum(shapely.LineString(x).length for x in lines)
    return (2.0 * gaps + total - region.area) / region.area


@pytest.mark.parametrize(
    ("below", "above", "expected"),
    [
        (4.5, 4.5, [0.0]),  # nine strands, one of them in the middle
        (4.0, 4.0, [-0.5, 0.5]),  # eight: none in the middle
        (4.25, 4.75, [0.25]),  # nine, the middle one a quarter up
        (4.75, 4.25, [-0.25]),
    ],
)
def test_channel_of_whole_strands_is_filled_by_them(below, above, expected):
    region = shapely.box(0, -below, 60, above)
    guides = fitted_guides([GUIDE], region, 1.0)
    assert sorted(np.unique(g[:, 1]).item() for g in guides) == pytest.approx(expected)
    assert misfit(guides, region) < 0.005


def test_guide_that_fits_stays():
    region = shapely.box(0, -4.5, 60, 4.5)
    np.testing.assert_array_equal(fitted_guides([GUIDE], region, 1.0)[0], GUIDE)


def test_guides_are_fitted_to_each_other():
    """Two guides 8.3 apart in a channel of 17: whole strands between them, and to both sides."""
    region = shapely.box(0, -4.5, 60, 12.5)
    pair = [GUIDE, GUIDE + np.array([0.0, 8.3])]
    guides = fitted_guides(pair, region, 1.0)
    assert misfit(pair, region) > 0.03
    assert misfit(guides, region) < 0.02


def test_fit_turns_with_the_part():
    region = shapely.box(0, -4.2, 60, 4.6)
    guides = fitted_guides([GUIDE], region, 1.0)
    line = affinity.rotate(shapely.LineString(GUIDE), 33.0, origin=(0, 0))
    turned = fitted_guides(
        [shapely.get_coordinates(line)], affinity.rotate(region, 33.0, origin=(0, 0)), 1.0
    )
    for one, other in zip(guides, turned, strict=True):
        back = affinity.rotate(shapely.LineString(other), -33.0, origin=(0, 0))
        np.testing.assert_allclose(shapely.get_coordinates(back), one, atol=1e-9)


def test_nothing_to_fit():
    assert fitted_guides([], shapely.box(0, 0, 1, 1), 1.0) == []
