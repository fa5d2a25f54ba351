"""Lines, cut where they come near themselves."""

import numpy as np
from numba import njit

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import is_closed

_OWN = 3.0
"""Length along the seed line, in fibre widths, within which it may be near itself."""


def until_itself(line: FloatArray, start: FloatArray, width: float) -> FloatArray:
    """Cut a line (n, 2), from a point on it ahead and back, where it comes near itself.

    Streamlines may circle a hole many times, slightly displaced each time. A closed line stays
    closed if only its ends meet.

    Parameters
    ----------
    line : (n, 2) array, mm
    start : (2,) array, mm
        The point of the line nearest to this is kept.
    width : float, mm
    """
    if len(line) < 2:
        return line
    seed = int(np.argmin(((line - start) ** 2).sum(axis=1)))
    first, last = _own_way(line, seed, is_closed(line), width, _OWN * width)
    return line[first : last + 1]


@njit(cache=True, nogil=True)
def _own_way(
    line: FloatArray, seed: int, closed: bool, width: float, free: float
) -> tuple[int, int]:
    """First and last point that keep a distance from all others more than `free` mm of arc away."""
    count = len(line)
    along = np.zeros(count)
    for p in range(1, count):
        along[p] = along[p - 1] + np.sqrt(_squared(line, p, p - 1))
    # Ahead and back from the seed, until a point is too near to one of those that are kept.
    first = last = seed
    for sense in (1, -1):
        p = seed + sense
        while 0 <= p < count:
            for q in range(first, last + 1):
                arc = abs(along[p] - along[q])
                if closed:
                    arc = min(arc, along[-1] - arc)
                if arc > free and _squared(line, p, q) < width * width:
                    break
            else:
                first, last = min(first, p), max(last, p)
                p += sense
                continue
            break
    return first, last


@njit(cache=True, nogil=True)
def _squared(line: FloatArray, p: int, q: int) -> float:
    """Square of the distance of two points."""
    x, y = line[p, 0] - line[q, 0], line[p, 1] - line[q, 1]
    return x * x + y * y
