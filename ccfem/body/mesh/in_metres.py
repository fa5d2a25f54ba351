"""A body so small or large that its coordinates look like those of another unit."""

import numpy as np

from ccfem.base.arrays import FloatArray

_SMALL = 1.0
"""Diagonal, mm, below which lengths look like metres: a strand is about as wide."""
_INCHES = 10.0
"""Diagonal, mm, below which lengths may be inches: no part with fibre is so small."""
_LARGE = 1e4
"""Diagonal, mm, above which lengths may be micrometres."""


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


def about_size(points: FloatArray) -> str:
    """Say that the lengths of a body may be in another unit, and the cure; nothing otherwise.

    Parameters
    ----------
    points : (n, 3) array, mm

    Examples
    --------
    >>> about_size([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    'the body is only 5 mm across: if it is in inches, set scale = 25.4 (or --scale 25.4)'
    >>> about_size([[0.0, 0.0, 0.0], [3e4, 4e4, 0.0]])
    'the body is 5e+04 mm across: if it is in micrometres, set scale = 0.001 (or --scale 0.001)'
    """
    across = float(np.linalg.norm(np.ptp(points, axis=0)))
    if across > _LARGE:
        return (
            f"the body is {across:.3g} mm across: if it is in micrometres, "
            "set scale = 0.001 (or --scale 0.001)"
        )
    if _SMALL <= across < _INCHES:
        return (
            f"the body is only {across:.3g} mm across: if it is in inches, "
            "set scale = 25.4 (or --scale 25.4)"
        )
    return in_metres(points)
