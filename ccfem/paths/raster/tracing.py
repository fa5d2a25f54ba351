"""Ordered paths through the pixels of regions."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, IntArray, freeze, seen_only
from ccfem.paths.raster.thinning import thin
from ccfem.paths.raster.walking import (
    absorb,
    chains,
    cut_spurs,
    extend_ends,
    fill_corners,
    join_ends,
    walk,
)

_STUB = 4
"""Branches and paths of fewer pixels beside another path of their region do not count: it absorbs
them."""
_ROUNDS = 20


@dataclass(frozen=True)
class PixelPaths:
    """Paths as chains of neighbouring pixels, and the path that each solid pixel belongs to.

    Attributes
    ----------
    pixels : (P, 2) int array
        Row and column of the pixels, each once.
    offsets : (K + 1,) int array
        Path k holds ``pixels[offsets[k]:offsets[k + 1]]``.
    closed : (K,) bool array
        Whether the path goes on from its last pixel to its first.
    label : (H, W) int array
        Path of each pixel; -1 where there is none.
    isolated : (H, W) bool array
        Pixels that no path passes through, with the label of a path beside them, which has to be
        wider there (more extrusion); -1 where there is none beside them.
    """

    pixels: IntArray
    offsets: IntArray
    closed: BoolArray
    label: IntArray
    isolated: BoolArray

    def __post_init__(self) -> None:
        freeze(self, pixels=int, offsets=int, label=int, closed=bool, isolated=bool)

    def __len__(self) -> int:
        return len(self.closed)


def trace(regions: IntArray, linked: BoolArray, seed: int = 0) -> PixelPaths:
    """Trace paths through regions of pixels.

    Each region is thinned, and its lines are followed, without spurs and straight on where they
    fork. Pixels left over come back as corners of diagonal steps, then as paths of their own;
    single ones stay isolated. Paths of one region whose ends meet are joined. No two paths cross.

    Parameters
    ----------
    regions : (H, W) int array
        Region of each solid pixel, about a pixel wide; negative elsewhere. The outermost rows and
        columns are empty.
    linked : (H, W, 8) bool array
        `Bitmap.linked`.
    seed : int
        Of the random pixel that each closed path starts at, so that starts make no seam.
    """
    regions = seen_only(np.asarray(regions, dtype=np.int64))
    linked = seen_only(linked)
    following = np.full(regions.size, -1, dtype=np.int64)
    before = np.full(regions.size, -1, dtype=np.int64)
    used = np.zeros(regions.shape, dtype=bool)
    for _ in range(_ROUNDS):
        left = np.where(used, -1, regions)
        line = thin(left)
        if not line.any():
            break
        cut_spurs(line, regions, linked, _STUB)
        if not walk(line, regions, linked, used, following, before, _STUB):
            break
        join_ends(regions, linked, used, following, before)
        fill_corners(regions, linked, used, following, before)
        extend_ends(regions, linked, used, following, before)
    join_ends(regions, linked, used, following, before)
    fill_corners(regions, linked, used, following, before)
    pixels, offsets, closed = chains(regions, used, following, before)
    random = np.random.default_rng(seed)
    for k in np.flatnonzero(closed):
        own = slice(offsets[k], offsets[k + 1])
        pixels[own] = np.roll(pixels[own], random.integers(offsets[k + 1] - offsets[k]), axis=0)
    label = np.full(regions.shape, -1, dtype=np.int64)
    label[tuple(pixels.T)] = np.repeat(np.arange(len(closed)), np.diff(offsets))
    isolated = (regions >= 0) & ~used
    absorb(regions, linked, isolated, label)
    return PixelPaths(pixels, offsets, closed, label, isolated)
