"""How a part deforms and what stress it bears, as pages draw it: shares of the largest value."""

from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.comparison.report.packing import Rounded, as_bytes

_HIGH = 0.995
"""Share of the surface's nodes whose stress lies within the scale of colours."""
_SHOWN = 0.06
"""Largest displacement that is drawn, over the size of the part, at the scale that is proposed."""


def deformed(
    moved: FloatArray, most: float, mises: FloatArray, kept: IntArray, size: float
) -> dict[str, Any]:
    """Return what a page draws of a solution on the surface of a part.

    Parameters
    ----------
    moved : (n, 3) array, mm
        Displacement of the nodes of the surface.
    most : float, mm
        Largest displacement of all nodes.
    mises : (n,) array, MPa
        Stress of von Mises there.
    kept : (k,) int array
        Nodes that are drawn.
    size : float, mm
        Of the part.

    Returns
    -------
    dict
        ``moved`` and ``stress`` of the nodes that are drawn, their ends of scale ``most`` and
        ``most_stress``, and the ``scale`` at which displacements are seen.
    """
    high = float(np.quantile(mises, _HIGH))
    return {
        "moved": Rounded(moved[kept], max(most, 1e-300) / 2000.0),
        "moved_size": as_bytes(np.linalg.norm(moved[kept], axis=1), most),
        "most": most,
        "scale": _round_scale(_SHOWN * size / most) if most > 0.0 else 1.0,
        "stress": as_bytes(mises[kept], high),
        "most_stress": high,
    }


def _round_scale(scale: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is at most `scale`."""
    power = 10.0 ** np.floor(np.log10(scale))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= scale * 1.0001))
