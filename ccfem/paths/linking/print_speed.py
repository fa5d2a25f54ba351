"""Speed of a machine along toolpaths."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.machine.machine import Machine
from ccfem.machine.speeds import table_speeds
from ccfem.paths.toolpaths import FIBRE, Toolpaths

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
