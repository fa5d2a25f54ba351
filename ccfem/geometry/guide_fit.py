"""Guides: curves from which parallel strands start, spaced so that whole strands fit between them.

Strands lie at whole multiples of the pitch from their guide. Between the last of them and the
border, or the strands of the next guide, a gap or overlap of up to half a pitch remains along the
whole length. Its size depends on the position of the guide, so guides are shifted sideways.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.offsets import rings
from ccfem.geometry.own_way import until_itself
from ccfem.geometry.polylines import line_length, pack, sample_midpoints, straight_pieces
from ccfem.geometry.shapes import Region, open_lines

_SHIFTS = np.array([0.0, 0.5, 0.25, -0.25, 0.125, -0.125, 0.375, -0.375])
"""Sideways shifts that are tried, in pitches, preferred ones first."""
_BETTER = 0.01
"""Mean misfit a side, in pitches, by which a shift must be better than an earlier one."""
_STEP = 1.0
_FAR = 30.0
"""Distance between samples along a guide, and length of the rays to both sides, in pitches."""
_ROUNDS = 3
"""Number of times that all guides are fitted, since the neighbours of a guide move too."""


def spaced_guides(
    curves: Sequence[FloatArray],
    seeds: FloatArray,
    region: Region,
    distance: float,
    least_length: float,
) -> list[FloatArray]:
    """Clip curves to a region, and cut each where it comes near itself or an earlier one.

    At most one piece of each curve, a (m, 2) array in mm, remains.

    Parameters
    ----------
    curves : sequence of (m, 2) arrays, mm
        In the order of their importance; empty ones are left out.
    seeds : (k, 2) array, mm
        Point of each curve that its guide must contain.
    region : shapely (Multi)Polygon, mm
    distance : float, mm
        Minimum distance between guides.
    least_length : float, mm
        Shorter guides are dropped.
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
        guide = until_itself(pieces[nearest], seed, distance)
        if line_length(guide) < least_length:
            continue
        guides.append(guide)
        free = shapely.difference(free, shapely.buffer(shapely.LineString(guide), distance))
    return guides


def fitted_guides(guides: Sequence[FloatArray], region: Region, pitch: float) -> list[FloatArray]:
    """Shift guides sideways by at most half a pitch, to minimise gaps and overlaps.

    Parameters
    ----------
    guides : sequence of (k, 2) arrays, mm
    region : shapely (Multi)Polygon, mm
        Its border is the edge of other strands.
    pitch : float, mm
        Distance of the strands beside a guide.

    Returns
    -------
    list of (k, 2) arrays, mm
        A guide that moves by half a pitch is replaced by two, half a pitch to either side: the
        strands beside it are the same, and symmetric parts stay symmetric.
    """
    border = straight_pieces(rings(region))
    shifts = np.zeros(len(guides))
    moved = list(guides)
    rays = [_rays(guide, pitch) for guide in guides]
    fixed = [_first_hits(*ray, border, pitch) for ray in rays]
    for _ in range(_ROUNDS):
        before = shifts.copy()
        for k, (start, normal) in enumerate(rays):
            others = straight_pieces([other for j, other in enumerate(moved) if j != k])
            gap, parallel, to_guide = _nearer(fixed[k], _first_hits(start, normal, others, pitch))
            shifts[k] = _best_shift(gap / pitch - np.where(to_guide, 0.0, 0.5), parallel)
            moved[k] = _shifted(guides[k], shifts[k] * pitch)
        if (shifts == before).all():
            break
    found = []
    for guide, shift in zip(guides, shifts, strict=True):
        ways = (-0.5, 0.5) if shift == 0.5 else (shift,)
        found += [_shifted(guide, way * pitch) for way in ways]
    return found


def _best_shift(gap: FloatArray, weight: FloatArray) -> float:
    """Shift, in pitches, of the least misfit; `gap` (2, n) in pitches, left and right."""
    total = weight.sum()
    if not total > 0.0:
        return 0.0
    best, least = 0.0, np.inf
    for shift in _SHIFTS:
        room = gap + shift * np.array([[-1.0], [1.0]])
        misfit = float((weight * np.abs(room - np.round(room))).sum() / total)
        if misfit < least - _BETTER:
            best, least = float(shift), misfit
    return best


def _rays(guide: FloatArray, pitch: float) -> tuple[FloatArray, FloatArray]:
    """Places (n, 2) along a guide, and its left normal (n, 2) there."""
    points, offsets = pack([guide])
    start, along, _, _ = sample_midpoints(points, offsets, _STEP * pitch)
    return start, np.column_stack([-along[:, 1], along[:, 0]])


def _first_hits(
    start: FloatArray, normal: FloatArray, pieces: FloatArray, pitch: float
) -> tuple[FloatArray, FloatArray]:
    """Distance (2, n) to the first piece on the left and on the right, and how parallel it is.

    Infinite if there is none. The second value is the squared cosine of the angle between piece and
    guide, 0 above 45 degrees.
    """
    n = len(start)
    gap, parallel = np.full((2, n), np.inf), np.zeros((2, n))
    if not len(pieces):
        return gap, parallel
    tree = shapely.STRtree(shapely.linestrings(pieces))
    for side, sign in enumerate((1.0, -1.0)):
        way = sign * normal
        rays = shapely.linestrings(np.stack([start, start + _FAR * pitch * way], axis=1))
        ray, piece = tree.query(rays, predicate="intersects")
        side_way = pieces[piece, 1] - pieces[piece, 0]
        size = np.linalg.norm(side_way, axis=1)
        across = np.einsum("ij,ij->i", way[ray], side_way[:, ::-1] * [1.0, -1.0])
        offset = pieces[piece, 0] - start[ray]
        distance = np.einsum("ij,ij->i", offset, side_way[:, ::-1] * [1.0, -1.0])
        whole = np.abs(across) > 1e-9 * size
        ray, distance = ray[whole], (distance[whole] / across[whole])
        cosine = np.abs(across[whole]) / size[whole]
        order = np.lexsort((distance, ray))
        _, first = np.unique(ray[order], return_index=True)
        chosen = order[first]
        gap[side, ray[chosen]] = distance[chosen]
        square = cosine[chosen] ** 2
        parallel[side, ray[chosen]] = np.where(square > 0.5, square, 0.0)
    return gap, parallel


def _nearer(
    border: tuple[FloatArray, FloatArray], guides: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Nearer of two hits: distance, how parallel, and whether it is the second."""
    second = guides[0] < border[0]
    gap = np.where(second, guides[0], border[0])
    parallel = np.where(second, guides[1], border[1])
    return np.where(np.isfinite(gap), gap, 0.0), np.where(np.isfinite(gap), parallel, 0.0), second


def _shifted(guide: FloatArray, way: float) -> FloatArray:
    """Curve parallel to a guide, to its left by `way`, mm."""
    if way == 0.0:
        return guide
    curve = shapely.offset_curve(shapely.LineString(guide), way)
    parts = shapely.get_parts(curve)
    return shapely.get_coordinates(parts[np.argmax(shapely.length(parts))])
