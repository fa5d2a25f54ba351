"""Guides: curves through a region that parallel strands start from."""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.arrays import FloatArray
from ccfem.geometry.shapes import Region, open_lines

__all__ = ["spaced_guides"]


def spaced_guides(
    curves: Sequence[FloatArray],
    seeds: FloatArray,
    region: Region,
    distance: float,
    least_length: float,
) -> list[FloatArray]:
    """Clip curves to a region and cut each where it comes near to one before it.

    Parameters
    ----------
    curves : sequence of (m, 2) arrays, mm
        In the order of their importance; empty ones are left out.
    seeds : (k, 2) array, mm
        Point of each curve that its guide has to hold.
    region : shapely (Multi)Polygon, mm
    distance : float, mm
        Least distance of guides.
    least_length : float, mm
        Shorter guides are dropped.

    Returns
    -------
    list of (m, 2) arrays, mm
    """
    guides: list[FloatArray] = []
    free = region
    for curve, seed in zip(curves, seeds, strict=True):
        point = shapely.Point(seed)
        if len(curve) < 2 or not shapely.intersects(free, point):
            continue
        pieces = open_lines(shapely.intersection(free, shapely.LineString(curve)))
        if not pieces:
            continue
        strings = [shapely.LineString(piece) for piece in pieces]
        nearest = int(np.argmin(shapely.distance(strings, point)))
        if strings[nearest].length < least_length:
            continue
        guides.append(pieces[nearest])
        free = shapely.difference(free, shapely.buffer(strings[nearest], distance))
    return guides
