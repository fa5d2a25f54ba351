"""The order in which paths are printed, and the speed along them."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.machine.machine import Machine
from ccfem.machine.speeds import table_speeds
from ccfem.paths.toolpaths import FIBRE, Toolpaths


def nearest_end_order(starts: FloatArray, ends: FloatArray) -> tuple[IntArray, BoolArray, float]:
    """Order of printing in which the path with the nearest end always comes next.

    Parameters
    ----------
    starts, ends : (k, 2) or (k, 3) arrays, mm
        Ends of the paths; for a closed path the same point twice. The first path comes first.

    Returns
    -------
    order : (k,) int array
    reversed : (k,) bool array
        Whether the path at that place of the order is printed from its end.
    travel : float, mm
        Sum of the straight ways between them.
    """
    count = len(starts)
    order, backward = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=bool)
    points = np.concatenate([starts, ends])
    entry = np.arange(2 * count)  # k: path k at its start; count + k: at its end
    left = points.T.copy()
    chosen, travel = 0, 0.0
    for k in range(count):
        if k:
            here = points[(chosen + count) % (2 * count)]
            way = left - here[:, None]
            chosen = int(entry[np.einsum("ij,ij->j", way, way).argmin()])
            travel += float(np.linalg.norm(points[chosen] - here))
        backward[k], order[k] = divmod(chosen, count)
        taken = np.searchsorted(entry, [order[k], count + order[k]])
        left[:, taken] = np.inf
        if k % 64 == 63:
            kept = np.isfinite(left[0])
            left, entry = left[:, kept], entry[kept]
    return order, backward, travel


# Speed of a machine along toolpaths.


_REACH = 2.0
"""Least length over which curvature is taken, in fibre widths. Our choice: over less, the corners
that a mesh gives to round borders and to isocurves would count as turns, and paths would break into
short slow pieces."""


def step_speeds(toolpaths: Toolpaths, machine: Machine) -> FloatArray:
    """Speed of the step from each point to the next one of its path.

    Parameters
    ----------
    toolpaths : Toolpaths
        Paths of any kind; the speed table is for fibre.

    Returns
    -------
    (P,) array, mm/s
        Undefined at the last point of a path.
    """
    of_kind = np.array(
        [machine.fibre_speed, machine.matrix_speed, machine.matrix_speed, machine.travel_speed]
    )
    sizes = np.diff(toolpaths.offsets)
    speeds = np.repeat(of_kind[toolpaths.kind], sizes)
    if machine.speeds is not None:
        fibre = toolpaths.of_kind(FIBRE)
        speeds[np.repeat(toolpaths.kind == FIBRE, sizes)] = table_speeds(
            fibre.points, fibre.offsets, machine.speeds, _REACH * machine.fibre_width
        )
    return speeds
