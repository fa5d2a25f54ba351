"""A body so small that its coordinates look like metres."""

import numpy as np

from ccfem.arrays import FloatArray

__all__ = ["in_metres"]

_SMALL = 1.0
"""Diagonal, mm, below which lengths look like metres: a strand is about as wide."""


def in_metres(points: FloatArray) -> str:
    """Say that the lengths of a body look like metres, and the cure; nothing where they do not.

    Parameters
    ----------
    points : (n, 3) array, mm

    Examples
    --------
    >>> in_metres([[0.0, 0.0, 0.0], [0.03, 0.04, 0.0]])
    'the body is only 0.05 mm across: if it is in metres, set scale = 1000 (or --scale 1000)'
    >>> in_metres([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0]])
    ''
    """
    across = float(np.linalg.norm(np.ptp(points, axis=0)))
    if across >= _SMALL:
        return ""
    return (
        f"the body is only {across:.3g} mm across: if it is in metres, "
        "set scale = 1000 (or --scale 1000)"
    )
