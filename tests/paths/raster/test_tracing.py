import numpy as np
import pytest
from scipy import ndimage

from ccfem.paths.raster.bitmap import NEIGHBOURS, bands
from ccfem.paths.raster.raster_plan import corners, trace


def free_links(mask):
    """Links between all neighbouring solid pixels."""
    linked = [mask & np.roll(mask, (-i, -j), (0, 1)) for i, j in NEIGHBOURS]
    return np.stack(linked, axis=-1)


def check(paths, regions, linked):
    """Every pixel once; steps are links within a region; isolated pixels have no path."""
    visits = np.zeros(regions.shape, dtype=int)
    np.add.at(visits, tuple(paths.pixels.T), 1)
    np.testing.assert_array_equal(visits + paths.isolated, regions >= 0)
    for k in range(len(paths)):
        chain = paths.pixels[paths.offsets[k] : paths.offsets[k + 1]]
        assert len(chain) >= 2
        assert len(np.unique(regions[tuple(chain.T)])) == 1
        assert (paths.label[tuple(chain.T)] == k).all()
        ring = np.concatenate([chain, chain[:1]]) if paths.closed[k] else chain
        for here, step in zip(ring, np.diff(ring, axis=0), strict=False):
            sense = np.flatnonzero((step == NEIGHBOURS).all(axis=1))
            assert len(sense) == 1
            assert linked[(*here, sense[0])]


def regions_of(*rows):
    return np.pad(
        [[-1 if c == "." else int(c) for c in row] for row in rows], 1, constant_values=-1
    )


def test_ring_is_one_closed_path_with_its_corners():
    regions = regions_of("00000", "0...0", "0...0", "00000")
    paths = trace(regions, free_links(regions >= 0))
    check(paths, regions, free_links(regions >= 0))
    assert len(paths) == 1
    assert paths.closed.all()
    assert len(paths.pixels) == 14
    assert not paths.isolated.any()


def test_two_rows_make_a_closed_path():
    regions = regions_of("0" * 9, "0" * 9)
    paths = trace(regions, free_links(regions >= 0))
    check(paths, regions, free_links(regions >= 0))
    assert paths.closed.tolist() == [True]
    assert len(paths.pixels) == 18


def test_spurs_do_not_open_a_ring():
    regions = regions_of("000000000", "0.......0", "0..00...0", "0000.0000", ".....0...")
    paths = trace(regions, free_links(regions >= 0))
    check(paths, regions, free_links(regions >= 0))
    assert paths.closed.tolist() == [True]
    i, j = np.mgrid[:60, :60] - 30
    ring = np.abs(np.hypot(i, j) - 20) < 0.8
    rays = (np.abs(j) < 1) & (np.abs(np.abs(i) - 22) < 2)
    regions = np.where(ring | rays, 0, -1)
    paths = trace(regions, free_links(regions >= 0))
    assert paths.closed.sum() == 1
    assert np.diff(paths.offsets)[paths.closed] > 2.0 * np.pi * 20.0


def test_limbs_are_no_spurs():
    regions = regions_of("0000000000", *["....0....."] * 6)
    paths = trace(regions, free_links(regions >= 0))
    check(paths, regions, free_links(regions >= 0))
    assert len(paths) == 2
    assert not paths.isolated.any()


def test_rows_of_different_regions_stay_apart():
    regions = regions_of("0000000", "1111111", "2......")
    paths = trace(regions, free_links(regions >= 0))
    check(paths, regions, free_links(regions >= 0))
    assert np.diff(paths.offsets).tolist() == [7, 7]
    # The single pixel is isolated, and goes to the path above it.
    assert np.argwhere(paths.isolated).tolist() == [[3, 1]]
    assert paths.label[3, 1] == paths.label[2, 1]


def test_diagonals_of_two_regions_do_not_cross():
    regions = regions_of("000..1", "...01.", "...10.", "111..0")
    linked = free_links(regions >= 0)
    paths = trace(regions, linked)
    check(paths, regions, linked)
    ends = np.concatenate([paths.pixels[:-1], paths.pixels[1:]], axis=1)
    steps = {tuple(row) for row in ends.tolist()} | {tuple(row[[2, 3, 0, 1]]) for row in ends}
    assert ((2, 4, 3, 5) in steps) != ((2, 5, 3, 4) in steps)


def test_links_that_are_missing_cut_paths():
    regions = regions_of("0000000000")
    linked = free_links(regions >= 0)
    linked[1, 4, 2] = linked[1, 5, 6] = False
    paths = trace(regions, linked)
    check(paths, regions, linked)
    assert sorted(np.diff(paths.offsets)) == [4, 6]


@pytest.mark.parametrize("metric", ["euclid", "cross", "square"])
def test_every_pixel_of_rings_is_on_one_path_or_isolated(metric):
    rng = np.random.default_rng(5)
    for blur in (2.5, 4.0, 8.0):
        mask = np.pad(ndimage.gaussian_filter(rng.normal(size=(80, 100)), blur) > 0, 1)
        regions, linked = bands(mask, metric), free_links(mask)
        paths = trace(regions, linked)
        check(paths, regions, linked)
        assert paths.isolated.sum() < 0.06 * mask.sum()
        beside = ndimage.binary_dilation(paths.label >= 0, np.ones((3, 3)))
        assert (paths.label[paths.isolated & beside] >= 0).all()


def test_random_regions():
    rng = np.random.default_rng(6)
    regions = np.pad(rng.integers(-1, 3, (60, 60)), 1, constant_values=-1)
    linked = free_links(regions >= 0)
    drop = rng.random((62, 62, 4)) < 0.2
    for k, (i, j) in enumerate(NEIGHBOURS[:4]):
        linked[..., k] &= ~drop[..., k]
        linked[..., k + 4] = np.roll(linked[..., k], (i, j), (0, 1))
    check(trace(regions, linked), regions, linked)


def test_starts_of_closed_paths_are_drawn_by_the_seed():
    mask = np.pad(np.ones((40, 60), dtype=bool), 1)
    linked = free_links(mask)
    one, again, other = (trace(bands(mask), linked, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.pixels, again.pixels)
    assert not np.array_equal(one.pixels, other.pixels)
    starts = one.pixels[one.offsets[:-1]][one.closed]
    assert len(np.unique(starts[:, 1])) > 0.6 * len(starts)
    check(other, bands(mask), linked)


def test_empty():
    paths = trace(np.full((4, 4), -1), np.zeros((4, 4, 8), dtype=bool))
    assert len(paths) == 0
    assert not paths.isolated.any()


def kept(steps, stairs=True):
    """Number of the points that stay, of a path by its steps E, N, W, S and D (to north east)."""
    ways = {"E": (0, 1), "N": (-1, 0), "W": (0, -1), "S": (1, 0), "D": (-1, 1)}
    pixels = np.concatenate([[[0, 0]], np.cumsum([ways[s] for s in steps], axis=0)])
    return np.flatnonzero(corners(pixels, np.array([0, len(pixels)]), stairs)).tolist()


def test_straight_runs_keep_their_ends():
    assert kept("EEEEE") == [0, 5]
    assert kept("EEENNN") == [0, 3, 6]
    assert kept("DDDEE") == [0, 3, 5]
    assert kept("EEWW") == [0, 2, 4]


def test_staircases_become_chords():
    assert kept("ENENENEN") == [0, 8]
    assert kept("ENENENEN", stairs=False) == list(range(9))
    assert kept("EN") == [0, 1, 2]  # a corner
    assert kept("ENE") == [0, 3]
    assert kept("EEENENENNN") == [0, 2, 8, 10]
    # No turning back: E N W is no staircase.
    assert kept("ENW") == [0, 1, 2, 3]


def test_staircases_share_no_step():
    # E N E N up, then N is followed by W N W N: the second starts after the last step of the first.
    assert kept("ENENWNWN") == [0, 4, 8]
    # Long chord of 45 degrees and its neighbour of the same slope are one straight line.
    assert kept("ENENEENENE") in ([0, 5, 10], [0, 10])
