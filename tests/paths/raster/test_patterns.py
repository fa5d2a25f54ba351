import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.distance import cdist

from ccfem.paths.raster.bitmap import bands, depth
from ccfem.paths.raster.patterns import (
    GUIDE,
    INFILL,
    SHELL,
    concentric_regions,
    first_touch,
    grid_regions,
    hatch_lines,
    inside_shells,
    medial_regions,
    rings_round,
    stress_regions,
)
from ccfem.strategies.mps import segment_seeds

CROSS = ndimage.generate_binary_structure(2, 1)


def plate(height, width, holes=(), radius=0.0):
    """Solid pixels of a plate with round holes at (x, y) from its middle, in pixels."""
    row, column = np.indices((height, width)) + 0.5
    mask = np.ones((height, width), dtype=bool)
    for x, y in holes:
        off = (column - 0.5 * width - x) ** 2 + (0.5 * height - row - y) ** 2
        mask &= off > radius**2 + 1e-9
    return np.pad(mask, 1)


PLATE = plate(31, 70, [(-20, 3), (10, -2)], 5.0)


def all_patterns(mask):
    guides = np.full(mask.shape, -1)
    inside = inside_shells(mask, 3)
    for k, (row, column) in enumerate(segment_seeds(inside)):
        guides[row, column : column + 4] = k
    return {
        "concentric": concentric_regions(mask),
        "grid": grid_regions(mask, 0.0),
        "diagonals": grid_regions(mask, 0.25 * np.pi, every_row=True),
        "mat": medial_regions(mask),
        "mps": stress_regions(mask, guides),
    }


def test_bands_are_distances_to_the_empty_pixels():
    solid, empty = np.argwhere(PLATE), np.argwhere(~PLATE)
    away = cdist(solid, empty).min(axis=1)
    np.testing.assert_allclose(depth(PLATE)[PLATE], away)
    np.testing.assert_array_equal(bands(PLATE)[PLATE], np.floor(away - 0.5))


@pytest.mark.parametrize(
    ("metric", "structure"), [("cross", CROSS), ("square", np.ones((3, 3), dtype=bool))]
)
def test_other_metrics_are_repeated_erosion(metric, structure):
    ring, left = bands(PLATE, metric), PLATE
    for number in range(4):
        eroded = ndimage.binary_erosion(left, structure)
        np.testing.assert_array_equal(ring == number, left & ~eroded)
        left = eroded


@pytest.mark.parametrize("degrees", [0.0, 20.0, 45.0, 63.0, 90.0, 135.0])
def test_lines_of_a_hatch(degrees):
    angle = np.radians(degrees)
    rows = hatch_lines(PLATE, angle, every_row=True)
    steep = abs(np.sin(angle)) > abs(np.cos(angle)) + 1e-9
    for number in np.unique(rows[PLATE]):
        # One pixel in every column, or row, that it runs through.
        places = np.argwhere(rows == number)[:, 0 if steep else 1]
        assert len(np.unique(places)) == len(places)
    strips = hatch_lines(PLATE, angle)
    rows, columns = np.nonzero(PLATE)
    across = columns * -np.sin(angle) - rows * np.cos(angle)
    for number in np.unique(strips[PLATE]):
        assert np.ptp(across[strips[PLATE] == number]) < 1.0 + 1e-9


def test_every_diagonal_is_a_line_at_45_degrees():
    rows, columns = np.nonzero(PLATE)
    lines = hatch_lines(PLATE, 0.25 * np.pi, every_row=True)[PLATE]
    assert len(np.unique(lines)) == len(np.unique(rows + columns))
    pairs = np.unique(np.stack([lines, rows + columns], axis=1), axis=0)
    assert len(pairs) == len(np.unique(lines))


def test_rings_round_guides_lie_by_the_nearest_one():
    guides = np.full(PLATE.shape, -1)
    guides[16, 3:20], guides[5, 40:60] = 0, 1
    ring, guide = rings_round(guides, PLATE)
    places = np.argwhere(PLATE)
    away = np.stack([cdist(places, np.argwhere(guides == k)).min(axis=1) for k in (0, 1)])
    np.testing.assert_array_equal(ring[PLATE], np.floor(away.min(axis=0) + 0.5))
    clear = np.abs(away[0] - away[1]) > 1e-9
    np.testing.assert_array_equal(guide[PLATE][clear], away.argmin(axis=0)[clear])


def test_first_touch_is_that_of_the_narrowest_place():
    inside = np.pad(np.ones((21, 60), dtype=bool), 1)
    inside[1:6, 30:35] = False  # 10 pixels from the middle row on one side, 5 there
    line = np.full(inside.shape, -1)
    line[11, 6:56] = 0
    ring, _ = rings_round(line, inside)
    # Pixels beside the notch are 5 rows off; those at the ends of the bar 5 columns.
    assert first_touch(ring) == 5


@pytest.mark.parametrize("name", ["concentric", "grid", "diagonals", "mat", "mps"])
def test_every_pixel_has_a_region_and_shells_are_the_same(name):
    regions = all_patterns(PLATE)[name]
    np.testing.assert_array_equal(regions.number >= 0, PLATE)
    np.testing.assert_array_equal(regions.domain >= 0, PLATE)
    shells = regions.domain == SHELL
    np.testing.assert_array_equal(shells, (bands(PLATE) >= 0) & (bands(PLATE) < 3))
    assert not set(regions.number[shells]) & set(regions.number[PLATE & ~shells])
    inner = {"mat": {GUIDE, INFILL}, "mps": {GUIDE, INFILL}}.get(name, {INFILL})
    assert set(regions.domain[PLATE & ~shells].tolist()) == inner


@pytest.mark.parametrize("shape", [(30, 80), (31, 80), (30, 81), (31, 81)])
def test_symmetric_masks_have_symmetric_patterns(shape):
    mask = plate(*shape, [(0, 0), (25, 0), (-25, 0)], 4.0)
    for axis in (0, 1):
        np.testing.assert_array_equal(mask, np.flip(mask, axis))
        for regions in (concentric_regions(mask), medial_regions(mask)):
            np.testing.assert_array_equal(regions.domain, np.flip(regions.domain, axis))
            edges = regions.number[:, 1:] == regions.number[:, :-1]
            mirrored = np.flip(regions.number, axis)
            # Regions turn into regions: equal where their mirror images are.
            if regions.domain.max() == INFILL and GUIDE not in regions.domain:
                np.testing.assert_array_equal(edges, mirrored[:, 1:] == mirrored[:, :-1])


def test_thin_parts_are_all_shell():
    mask = plate(5, 60)
    for regions in all_patterns(mask).values():
        np.testing.assert_array_equal(regions.domain == SHELL, mask)
        np.testing.assert_array_equal(regions.number, concentric_regions(mask).number)


def test_holes_that_touch_shells_share_their_rings():
    mask = plate(31, 60, [(0, 9)], 4.0)  # 2.5 pixels of material above the hole
    for regions in all_patterns(mask).values():
        first = regions.number[1, 1]
        beside_hole = mask & ndimage.binary_dilation(~mask[:, :], CROSS)
        assert set(regions.number[beside_hole]) == {first}


@pytest.mark.parametrize("height", [8, 9, 10, 11])
def test_beyond_a_short_guide_a_strip_is_filled_along(height):
    mask = plate(height, 150)
    guides = np.full(mask.shape, -1)
    guides[height // 2 + 1, 70:80] = 0
    regions = stress_regions(mask, guides)
    np.testing.assert_array_equal(regions.number >= 0, mask)
    beyond = regions.number[4 : height - 2, 8:60]  # between the shells
    # Along every row of the strip one region, and not the same on all of them.
    assert all(len(np.unique(row)) == 1 for row in beyond)
    assert (regions.domain[4 : height - 2, 8:60] == INFILL).all()


def test_disc_by_mat_is_concentric():
    row, column = np.indices((45, 45)) - 22
    mask = np.hypot(row, column) < 20
    mat, rings = medial_regions(mask), concentric_regions(mask)
    np.testing.assert_array_equal(mat.domain == SHELL, rings.domain == SHELL)
    assert GUIDE not in mat.domain
    # The rings inside the shells go on from the innermost shell to less than a pixel.
    inside = inside_shells(mask, 3)
    np.testing.assert_array_equal(mat.number[inside] - 3, bands(inside)[inside])


def test_ring_by_mat_follows_the_middle_circle():
    row, column = np.indices((65, 65)) - 32
    away = np.hypot(row, column)
    mask = (away < 30) & (away > 14)
    regions = medial_regions(mask)
    first = regions.number[(regions.domain == GUIDE)].min()
    middle = away[regions.number == first]
    assert middle.min() > 21.0
    assert middle.max() < 23.0
    assert len(segment_seeds(inside_shells(mask, 3))) == 4


def test_pieces_without_a_guide_are_concentric():
    mask = np.pad(np.ones((20, 60), dtype=bool), 1)
    mask[:, 30] = False
    guides = np.full(mask.shape, -1)
    guides[10, 8:20] = 0
    regions = stress_regions(mask, guides)
    assert set(regions.domain[:, :30][mask[:, :30]].tolist()) == {SHELL, GUIDE}
    assert set(regions.domain[:, 31:][mask[:, 31:]].tolist()) == {SHELL, INFILL}


def test_empty_mask():
    mask = np.zeros((4, 4), dtype=bool)
    for regions in all_patterns(mask).values():
        assert (regions.number == -1).all()
