import numpy as np
import pytest
import shapely
from shapely import affinity

from ccfem.base.errors import InputError
from ccfem.paths.raster.bitmap import NEIGHBOURS, bitmap


def test_whole_number_of_pixels_gets_exactly_those():
    # 10 / 0.1 and the like are not whole in floating point.
    for pixel, size in ((0.1, (1.7, 0.3)), (0.8, (201.6, 36.0)), (0.7, (4.9, 2.1))):
        image = bitmap(affinity.translate(shapely.box(0, 0, *size), 0.3, -7.1), pixel)
        solid = image.mask[1:-1, 1:-1]
        assert solid.shape == (round(size[1] / pixel), round(size[0] / pixel))
        assert solid.all()
        assert not image.mask[[0, -1]].any()
        assert not image.mask[:, [0, -1]].any()


def test_pixels_are_solid_where_their_centre_is_inside():
    rng = np.random.default_rng(3)
    section = shapely.Polygon(rng.normal(size=(9, 2)) * 10.0).convex_hull
    section = section.difference(section.centroid.buffer(3.0))
    image = bitmap(section, 0.9)
    rows = np.argwhere(np.ones(image.mask.shape, dtype=bool))
    inside = shapely.contains_xy(section, image.centres(rows))
    np.testing.assert_array_equal(inside, image.mask.ravel())
    np.testing.assert_array_equal(image.pixels(image.centres(rows)), rows)


@pytest.mark.parametrize("count", [(40, 24), (41, 25)])
def test_ties_fall_alike_on_all_sides(count):
    # A square hole turned by 45 degrees: its sides pass through centres of pixels.
    hole = shapely.Polygon([(-5, 0), (0, -5), (5, 0), (0, 5)])
    section = affinity.scale(
        shapely.box(*(-0.5 * np.array(count)), *(0.5 * np.array(count))).difference(hole),
        0.7,
        0.7,
        origin=(0, 0),
    )
    mask = bitmap(affinity.translate(section, 12.34, 5.67), 0.7).mask
    for axis in (0, 1):
        np.testing.assert_array_equal(mask, np.flip(mask, axis))
    # By hand: centres at |x| + |y| > 5 pixels; on it is outside the section.
    row, column = np.mgrid[: count[1], : count[0]]
    off = np.abs(column - 0.5 * (count[0] - 1)) + np.abs(row - 0.5 * (count[1] - 1))
    np.testing.assert_array_equal(mask[1:-1, 1:-1], off > 5.0 + 1e-9)


def test_links_do_not_leave_the_section():
    slit = shapely.box(0, 0, 20, 12).difference(shapely.box(6.99, 2.0, 7.01, 13.0))
    speck = slit.difference(shapely.box(14.95, 4.95, 15.05, 5.05))
    image = bitmap(speck, 1.0)
    assert image.mask[1:-1, 1:-1].all()  # no centre lies in either
    rows = np.argwhere(image.mask)
    for k, step in enumerate(NEIGHBOURS):
        there = rows + step
        ways = shapely.linestrings(np.stack([image.centres(rows), image.centres(there)], axis=1))
        expected = image.mask[tuple(there.T)] & shapely.covers(speck, ways)
        np.testing.assert_array_equal(image.linked[tuple(rows.T)][:, k], expected)
        assert (~expected & image.mask[tuple(there.T)]).any() or step[1] == 0


def test_parts_that_touch_at_a_corner_are_not_linked():
    touching = shapely.union_all([shapely.box(0, 0, 4, 4), shapely.box(4, 4, 8, 8)])
    apart = shapely.MultiPolygon([shapely.box(0, 0, 4, 4), shapely.box(4.2, 4.2, 8.2, 8.2)])
    for section in (apart, affinity.translate(apart, 0.1, 0.0)):
        image = bitmap(section, 1.0)
        left = image.centres(np.argwhere(image.mask))[:, 0] < 4.1
        rows = np.argwhere(image.mask)[left]
        for k, step in enumerate(NEIGHBOURS):
            linked = image.linked[tuple(rows.T)][:, k]
            assert (image.centres(rows + step)[linked][:, 0] < 4.1).all()
    assert bitmap(touching, 1.0).mask.sum() == 32


def test_empty_and_bad_input():
    assert not bitmap(shapely.Polygon(), 1.0).mask.any()
    assert not bitmap(shapely.box(0, 0, 10, 0.01), 0.7).linked[..., [0, 4]].any()
    with pytest.raises(InputError, match="above 0"):
        bitmap(shapely.box(0, 0, 1, 1), 0.0)
    with pytest.raises(InputError, match="too large"):
        bitmap(shapely.box(0, 0, 1e4, 1e4), 1e-2)


def test_section_given_is_not_prepared():
    """Threads may share it, and GEOS crashes where two use one that is prepared."""
    section = shapely.box(0, 0, 20, 12)
    assert bitmap(section, 1.0).linked.any()
    assert not shapely.is_prepared(section)
