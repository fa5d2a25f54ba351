"""Worth of the pieces of a fibre path, and the pieces that are worth more than a price of fibre."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.compiled import compiled

_BISECTIONS = 50

_EQUAL = 1e-12
"""Least difference by which one choice has to be better, as a share of a piece's largest gain."""


@dataclass(frozen=True)
class Profile:
    """Worth of each piece of one fibre path.

    Attributes
    ----------
    path : int
        Number of the path in the toolpaths.
    value : (n,) array
        Mean value per length of equal pieces. A closed path starts at its least valuable place.
    step : float, mm
        Length of a piece.
    origin : float, mm
        Arc length of the path at which the first piece starts.
    """

    path: int
    value: FloatArray
    step: float
    origin: float

    def least(self, minimum: float) -> int:
        """Pieces of a stretch that is no shorter than `minimum`, mm, or of the whole path."""
        pieces = int(np.ceil(minimum / self.step - 1e-9))
        return min(max(pieces, 1), len(self.value))

    def kept(self, price: float, minimum: float, cut_cost: float) -> tuple[BoolArray, float]:
        """Pieces to keep where a mm of fibre costs `price`, and their worth beyond that cost.

        Of all divisions of the path into stretches no shorter than `minimum`, mm, take that of
        largest ``sum of (value - price) * length - cut_cost * price * (stretches - 1)``.
        """
        least = self.least(minimum)
        keep = np.empty(len(self.value), dtype=np.bool_)
        worth = (self.value - price) * self.step
        equal = _EQUAL * float(np.abs(worth).max())
        gain = _best_stretches(worth, least, cut_cost * price, equal, keep)
        return keep, float(gain)


@compiled
def _best_stretches(
    gain: FloatArray, least: int, cost: float, equal: float, keep: BoolArray
) -> float:  # pragma: no cover
    """Mark the pieces to keep and return their gain: dynamic programming over the pieces.

    `free[i]` is the largest gain of the first i pieces, `held[i]` the largest gain if piece i is
    kept. Stretches are at least `least` pieces long; each but the first costs `cost`.
    """
    n = len(gain)
    total = np.zeros(n + 1)
    for i in range(n):
        total[i + 1] = total[i] + gain[i]
    free = np.zeros(n + 1)
    held = np.empty(n + 1)
    start = np.zeros(n + 1, np.int64)  # of the stretch that ends with piece i
    alone = np.zeros(n + 1, np.bool_)  # whether nothing is kept before that stretch
    for i in range(least):
        held[i] = -np.inf
    for i in range(least, n + 1):
        held[i] = held[i - 1] + gain[i - 1]
        start[i], alone[i] = start[i - 1], alone[i - 1]
        before = max(free[i - least] - cost, 0.0)
        opened = total[i] - total[i - least] + before
        if opened >= held[i] - equal:
            held[i], start[i], alone[i] = opened, i - least, before == 0.0
        free[i] = held[i] if held[i] > free[i - 1] + equal else free[i - 1]
    for i in range(n):
        keep[i] = False
    i = n
    while i > 0 and free[i] > 0.0:
        if free[i] == free[i - 1]:
            i -= 1
            continue
        for k in range(start[i], i):
            keep[k] = True
        i = 0 if alone[i] else start[i]
    return free[n]


def least_price(
    along: Sequence[Profile], length: float, minimum: float, cut_cost: float = 20.0
) -> float:
    """Smallest price of fibre at which no more than the given length, mm, is worth keeping."""
    values = [profile.value for profile in along]
    pieces = np.array([len(value) for value in values], dtype=np.int64)
    value, ends = np.concatenate([np.zeros(0), *values]), np.cumsum(pieces)
    step = np.array([profile.step for profile in along])
    least = np.array([profile.least(minimum) for profile in along], dtype=np.int64)

    def left(price: float) -> float:
        return float(_kept_length(value, ends, step, least, price, cut_cost * price))

    if left(0.0) <= length:
        return 0.0
    low, high = 0.0, 2.0 * max(float(profile.value.max()) for profile in along)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left(middle) > length else (low, middle)
    return high


@compiled
def _kept_length(
    value: FloatArray, ends: IntArray, step: FloatArray, least: IntArray, price: float, cost: float
) -> float:  # pragma: no cover
    """Length that a price keeps of all profiles."""
    longest, begin = 0, 0
    for k in range(len(ends)):
        longest = max(longest, ends[k] - begin)
        begin = ends[k]
    gain, keep = np.empty(longest), np.empty(longest, np.bool_)
    total, begin = 0.0, 0
    for k in range(len(ends)):
        count, most = ends[k] - begin, 0.0
        for i in range(count):
            gain[i] = (value[begin + i] - price) * step[k]
            most = max(most, abs(gain[i]))
        _best_stretches(gain[:count], least[k], cost, _EQUAL * most, keep[:count])
        kept = 0
        for i in range(count):
            kept += keep[i]
        total += step[k] * kept
        begin = ends[k]
    return total
