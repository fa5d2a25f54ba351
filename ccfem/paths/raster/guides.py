"""Guides as lines of pixels: streamlines and the places that they start from."""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.tensor import in_plane
from ccfem.paths.fields.streamlines import streamlines
from ccfem.paths.raster.bands import depth
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.skeleton import segments, skeleton
from ccfem.paths.raster.thinning import thin
from ccfem.slicing.layers.layer_stress import LayerStress

_STEP = 0.5
_APART = 2.0
_SHORTEST = 6
"""In pixels: step along a streamline, minimum distance of guides, minimum number of pixels."""


def segment_seeds(inside: BoolArray) -> IntArray:
    """Middle pixel (k, 2) of every segment of the medial axis, the deepest first.

    A closed one has four, a quarter of the way round from each to the next, the deepest of its
    pixels first; a piece without a segment has its fork.

    Parameters
    ----------
    inside : (H, W) bool array
        Its outermost rows and columns are empty.
    """
    far = depth(inside)
    found, forks = segments(thin(np.where(skeleton(inside), 0, -1)))
    seeds: list[IntArray] = []
    for one in found:
        count = len(one.pixels)
        at = [count // 2]
        if one.closed:
            deepest = int(far[tuple(one.pixels.T)].argmax())
            at = [(deepest + k * count // 4) % count for k in range(4)]
        seeds += [one.pixels[k] for k in at]
    pieces, count = ndimage.label(inside, np.ones((3, 3)))
    held = {int(pieces[tuple(pixel)]) for pixel in seeds}
    for piece in range(1, count + 1):
        if piece not in held:
            places = np.argwhere((pieces == piece) & (forks >= 0))
            seeds.append(places[0])
    seeds.sort(key=lambda pixel: (-far[tuple(pixel)], *pixel.tolist()))
    return np.array(seeds, dtype=np.int64).reshape(-1, 2)


def _guide_pixels(
    raster: Bitmap, inside: BoolArray, curves: Sequence[FloatArray], seeds: IntArray
) -> IntArray:
    """Guide (H, W) that each pixel is on, -1 for none, cut where it comes near to one before it.

    Curves are in the order of their importance, with steps of at most half a pixel; a guide holds
    the seed (k, 2) of its curve.
    """
    guides = np.full(inside.shape, -1, dtype=np.int64)
    free = inside.copy()
    for number, (curve, seed) in enumerate(zip(curves, seeds, strict=True)):
        if len(curve) < 2 or not free[tuple(seed)]:
            continue
        chain = raster.pixels(curve)
        fine = free[tuple(chain.T)]
        if (curve[0] == curve[-1]).all() and not fine.all():
            # A closed one that is cut: from a cut to the next.
            turn = -int(np.flatnonzero(~fine)[0])
            chain, fine = np.roll(chain, turn, axis=0), np.roll(fine, turn)
        middle = int(np.abs(chain - seed).sum(axis=1).argmin())
        if not fine[middle]:
            continue
        stops = np.flatnonzero(~fine)
        first = stops[stops < middle].max(initial=-1) + 1
        last = stops[stops > middle].min(initial=len(chain))
        chain = np.unique(chain[first:last], axis=0)
        if len(chain) < _SHORTEST:
            continue
        guides[tuple(chain.T)] = number
        free &= ndimage.distance_transform_edt(guides < 0) >= _APART
    return guides


def stress_guides(
    raster: Bitmap, inside: BoolArray, stress: LayerStress, points: FloatArray | None = None
) -> IntArray:
    """Guides along streamlines of the principal stress of the largest size.

    Parameters
    ----------
    raster : Bitmap
    inside : (H, W) bool array
        Pixels that guides stay in.
    stress : LayerStress
    points : (k, 2) array, mm, optional
        Where streamlines start, at the nearest pixel inside; by default `segment_seeds`.

    Returns
    -------
    (H, W) int array
        Guide of each pixel; -1 where there is none.
    """
    if not inside.any():
        return np.full(inside.shape, -1, dtype=np.int64)
    if points is None:
        seeds = segment_seeds(inside)
    else:
        _, nearest = ndimage.distance_transform_edt(~inside, return_indices=True)
        seeds = nearest[:, *raster.pixels(points).T].T.astype(np.int64)
    layer = stress.layer
    plane = in_plane(stress.nodal, layer.plane.frame)
    starts = raster.centres(seeds)
    step = _STEP * raster.pixel
    curves = streamlines(layer.plane.points, layer.triangles, plane, starts, step)
    return _guide_pixels(raster, inside, curves, seeds)
