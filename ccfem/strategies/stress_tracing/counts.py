"""Number of tracks along the length of a band: whole numbers that follow its width.

Where the number changes, tracks leave the section through the border, on one side or on both, and
the others spread out over a length. So the distance between tracks stays near the pitch, and tracks
end outside, where links turn.
"""

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.geometry.shapes import Region
from ccfem.strategies.stress_tracing.band import STEP, Band

_CHANGE = 0.3
"""Cost of one track more or less: as much as a tenth of the band left open over 3 mm."""
_CROWDED = 4.0
"""Cost of tracks nearer than `_NEAREST`, over that of a gap as wide as their overlap."""
_OVER = 0.02
"""The same for tracks that overlap but are not nearer than `_NEAREST`."""
_ROUNDING = 1.002
"""Distance, in pitches, that counts as one pitch."""
_LESS = 0.3
"""Weight of lengths in joints, which other tracks cross too."""
_NEAREST = 0.9
"""Distance, in pitches, below which tracks are too near to each other."""
_IN_JOINT = 6.0
"""Factor on the cost of a change in joints."""
_CLEAR = 5.0
"""Distance, mm, from a joint within which a change would reach into it."""
_SPREAD = 3.0
"""Standard deviation, mm, of the Gaussian over which a change of the number is spread."""
_ON_BORDER = 0.5
"""Distance, mm, up to which a side of a band runs along the border."""
_CLEARLY = 0.2
"""Share of a side by which more of it must lie on the outer border."""
_ONE_SIDE = 1.0
"""Factor on the cost of even changes below which changes on one side are taken."""


def places(band: Band, pitch: float, section: Region) -> FloatArray:
    """Place of every track across a band, in half widths.

    Parameters
    ----------
    pitch : float, mm
        Wanted distance between neighbouring tracks.
    section : shapely (Multi)Polygon, mm

    Returns
    -------
    (k, n) array
        From left (1) to right (-1) at each point of the band; tracks beyond lie outside it.
    """
    width = np.maximum(2.0 * np.linalg.norm(band.half, axis=1), 1e-9)
    wanted = width / pitch
    if band.closed:
        number = _round_ring(wanted, band.free > 0.5)
        shift = _outer(band, section) if np.ptp(number) else 0.0
        return _track_places(gaussian_filter1d(number, _SPREAD / STEP, mode="wrap"), shift)
    return _places_between_ends(band, wanted, pitch, section)


def _places_between_ends(
    band: Band, wanted: FloatArray, pitch: float, section: Region
) -> FloatArray:
    """Places (k, n) of tracks in a band with two ends, given the wanted numbers (n,) at a pitch."""
    # A free end continues to the border, by half its width.
    first, last = band.core.start, band.core.stop
    if not band.joined[0]:
        first = max(0, first - round(0.5 * wanted[first] * pitch / STEP))
    if not band.joined[1]:
        last = min(len(wanted), last + round(0.5 * wanted[last - 1] * pitch / STEP))
    inner = wanted[first:last]
    reach = 2 * round(_CLEAR / STEP) + 1
    joint = maximum_filter1d(band.free, reach, mode="constant", cval=1.0)[band.core] > 0.5
    joint = np.pad(joint, (band.core.start - first, last - band.core.stop))
    # Tracks come and go in pairs, one on each side; on one side only where that is much better.
    even, even_cost = min(
        (_steady_numbers(inner, joint, first, 2) for first in (1, 2)),
        key=lambda candidate: candidate[1],
    )
    any_, any_cost = _steady_numbers(inner, joint, 1, 1)
    shift = 0.0
    number = even
    if any_cost < _ONE_SIDE * even_cost:
        number, shift = any_, _outer(band, section)
    whole = np.concatenate(
        [np.full(first, number[0]), number, np.full(len(wanted) - last, number[-1])]
    )
    return _track_places(
        gaussian_filter1d(whole.astype(np.float64), _SPREAD / STEP, mode="nearest"), shift
    )


def _outer(band: Band, section: Region) -> float:
    """1 where tracks leave through the left side of a band, else -1.

    This is the side on the outer border, where links have room, not that on a hole. If both are
    equal, it is the longer side.
    """
    left, right = (band.middle[band.core] + sign * band.half[band.core] for sign in (1.0, -1.0))
    outside = shapely.union_all(shapely.get_exterior_ring(shapely.get_parts(section)))
    near = [
        float(np.mean(shapely.dwithin(shapely.points(side), outside, _ON_BORDER)))
        for side in (left, right)
    ]
    if abs(near[0] - near[1]) > _CLEARLY:
        return 1.0 if near[0] > near[1] else -1.0
    sizes = [np.linalg.norm(np.diff(side, axis=0), axis=1).sum() for side in (left, right)]
    return 1.0 if sizes[0] > sizes[1] else -1.0


def _track_places(number: FloatArray, shift: float) -> FloatArray:
    """Places (k, n) of tracks whose number (n,) changes on both sides (0) or on one (1, -1)."""
    most = int(np.ceil(number.max() - 1e-9))
    k = np.arange(most)[:, None]
    centred = most - 1.0 - 2.0 * k
    # On one side: the tracks of the other side keep their place at the border.
    return np.asarray((centred + shift * (most - number)) / number)


def _round_ring(wanted: FloatArray, joint: BoolArray) -> FloatArray:
    """Find whole numbers (n,) round a closed band: two rounds, cut in the middle of the first."""
    count = len(wanted)
    number, _ = _steady_numbers(np.tile(wanted, 2), np.tile(joint, 2), 1, 1)
    if number[count // 2] != number[count // 2 + count]:
        return np.full(count, float(max(1, round(float(np.median(wanted))))))
    return np.roll(number[count // 2 : count // 2 + count], count // 2).astype(np.float64)


def _steady_numbers(
    wanted: FloatArray, joint: BoolArray, first: int, step: int
) -> tuple[IntArray, float]:
    """Whole numbers (n,) near the wanted ones (n,) that change seldom, and their cost.

    In joints (n,) they hardly change, since there is no border to leave through. They are `first`
    plus multiples of `step`, and are found by dynamic programming.
    """
    most = max(first, int(np.ceil(wanted.max())) + 1)
    numbers = np.arange(first, most + 1, step)
    apart = wanted[:, None] / numbers
    # A single track may lie in a band narrower than itself.
    near = np.where(numbers == 1, 0.0, np.maximum(_NEAREST - apart, 0.0))
    over = np.maximum(1.0 - apart, 0.0)
    cost = STEP * (np.maximum(apart - _ROUNDING, 0.0) + _CROWDED * near + _OVER * over)
    cost[joint] *= _LESS
    change = _CHANGE * np.abs(numbers[:, None] - numbers)
    best, came = cost[0], np.zeros(cost.shape, dtype=np.int64)
    for n in range(1, len(cost)):
        over = best[:, None] + (_IN_JOINT if joint[n] else 1.0) * change
        came[n] = over.argmin(axis=0)
        best = over.min(axis=0) + cost[n]
    chosen = np.empty(len(cost), dtype=np.int64)
    chosen[-1] = best.argmin()
    for n in range(len(cost) - 1, 0, -1):
        chosen[n - 1] = came[n, chosen[n]]
    return numbers[chosen], float(best.min())
