"""The order in which paths are printed."""

import numpy as np

from ccfem.arrays import BoolArray, FloatArray, IntArray

__all__ = ["nearest_end_order"]


def nearest_end_order(starts: FloatArray, ends: FloatArray) -> tuple[IntArray, BoolArray, float]:
    """Order of printing: always on to the path with the nearest end.

    Parameters
    ----------
    starts, ends : (k, 2) arrays, mm
        Ends of the paths; of a closed one the same point twice. The first path comes first.

    Returns
    -------
    order : (k,) int array
    reversed : (k,) bool array
        Whether the path at that place of the order is walked from its end.
    travel : float, mm
        Sum of the straight ways between them.
    """
    count = len(starts)
    order, backward = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    left = np.ones(count, dtype=bool)
    travel = 0.0
    for k in range(count):
        if k:
            here = starts[order[k - 1]] if backward[k - 1] else ends[order[k - 1]]
            off = np.stack([np.linalg.norm(p - here, axis=1) for p in (starts, ends)])
            off[:, ~left] = np.inf
            side, best = divmod(int(off.argmin()), count)
            order[k], backward[k] = best, bool(side)
            travel += float(off[side, best])
        left[order[k]] = False
    return order, backward, travel
