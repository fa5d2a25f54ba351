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
    points = np.concatenate([starts, ends])
    entry = np.arange(2 * count)  # k: path k at its start; count + k: at its end
    x, y = points.T.copy()
    chosen, travel = 0, 0.0
    for k in range(count):
        if k:
            here = points[(chosen + count) % (2 * count)]
            chosen = int(entry[np.argmin((x - here[0]) ** 2 + (y - here[1]) ** 2)])
            travel += float(np.linalg.norm(points[chosen] - here))
        backward[k], order[k] = divmod(chosen, count)
        taken = np.searchsorted(entry, [order[k], count + order[k]])
        x[taken] = np.inf
        if k % 64 == 63:
            left = np.isfinite(x)
            x, y, entry = x[left], y[left], entry[left]
    return order, backward, travel
