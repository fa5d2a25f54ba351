import numpy as np
import pytest
from scipy import ndimage

from ccfem.paths.raster.skeleton import segments, skeleton, thin

ALL = np.ones((3, 3), dtype=bool)


def image(*rows):
    """Regions by digits; a dot is outside."""
    return np.pad(
        [[-1 if c == "." else int(c) for c in row] for row in rows], 1, constant_values=-1
    )


def topology(mask):
    return ndimage.label(mask, ALL)[1], ndimage.label(~mask)[1]


def test_lines_stay():
    for rows in (("00000",), ("0....", ".0...", "..000"), ("0", "0", "0")):
        regions = image(*rows)
        np.testing.assert_array_equal(thin(regions), regions >= 0)


def test_bar_becomes_its_middle_row():
    found = thin(image(*["0" * 12] * 3))
    assert found.sum(axis=0).max() == 1
    assert found[2].sum() == found.sum() >= 10


def test_ring_becomes_a_closed_line():
    i, j = np.mgrid[:41, :41] - 20
    ring = (np.hypot(i, j) < 17) & (np.hypot(i, j) > 10)
    found = thin(np.where(ring, 0, -1))
    assert topology(found) == (1, 2)
    away = np.hypot(i, j)[found]
    assert away.min() > 12.5
    assert away.max() < 14.5
    around = ndimage.convolve(found.astype(int), ALL.astype(int))[found] - 1
    assert (around == 2).all()


def test_pieces_and_holes_stay():
    rng = np.random.default_rng(1)
    for blur in (1.0, 2.0, 4.0):
        mask = np.pad(ndimage.gaussian_filter(rng.normal(size=(90, 120)), blur) > 0, 1)
        found = thin(np.where(mask, 0, -1))
        assert topology(found) == topology(mask)
        assert not (found & ~mask).any()
        # One pixel wide: no square of 2 x 2.
        assert not ndimage.binary_hit_or_miss(found, np.ones((2, 2)), np.zeros((2, 2))).any()


def test_regions_are_thinned_each_by_itself():
    rng = np.random.default_rng(2)
    regions = np.pad(
        ndimage.gaussian_filter(rng.normal(size=(3, 60, 60)), (0, 3, 3)).argmax(axis=0),
        1,
        constant_values=-1,
    )
    found = thin(regions)
    for number in range(3):
        alone = thin(np.where(regions == number, 0, -1))
        np.testing.assert_array_equal(found & (regions == number), alone)


def test_medial_axis_of_a_cross_has_four_limbs():
    mask = np.zeros((63, 63), dtype=bool)
    mask[26:37, 2:61] = mask[2:61, 26:37] = True
    line = skeleton(mask)
    found, forks = segments(thin(np.where(line, 0, -1)))
    assert len(found) == 4
    assert forks.max() == 0
    # Corner spurs are off: each limb ends half a width inside its end.
    rows, columns = np.nonzero(line)
    assert 5 <= rows.min() - 2 <= 7
    assert 5 <= columns.min() - 2 <= 7


@pytest.mark.parametrize("shape", [(30, 80), (31, 80), (30, 81), (31, 81)])
@pytest.mark.parametrize("hole", [0.0, 5.0])
def test_symmetric_masks_have_a_symmetric_axis(shape, hole):
    i, j = (0.5 + np.indices(shape)).transpose(1, 2, 0).reshape(-1, 2).T
    mask = (np.hypot(i - 0.5 * shape[0], j - 0.5 * shape[1]) >= hole).reshape(shape)
    line = skeleton(np.pad(mask, 1))
    for axis in (0, 1):
        np.testing.assert_array_equal(line, np.flip(line, axis))
    assert topology(line) == (1, 2 if hole else 1)
    assert line.sum() > 0.5 * shape[1]


def test_disc_has_a_short_axis():
    i, j = np.mgrid[:40, :40] - 19.5
    line = skeleton(np.hypot(i, j) < 16)
    assert 1 <= line.sum() <= 4
    assert np.hypot(i, j)[line].max() < 2.0


def test_nothing_has_no_axis():
    assert not skeleton(np.zeros((5, 5), dtype=bool)).any()
    assert not thin(np.full((2, 2), -1)).any()
