"""Force in the fibre paths of a layer, as pieces with a value each to colour pictures by."""

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.layers.layer import Layer
from ccfem.plot.paths import Coloured

__all__ = ["force_on_paths"]


def force_on_paths(
    middle: FloatArray, tangent: FloatArray, length: FloatArray, force: FloatArray, layer: Layer
) -> Coloured:
    """Axial force in pieces of fibre that carry tension only, N.

    Parameters
    ----------
    middle : (s, 3) array, mm
        Middle of each piece, of all layers; those of other layers are left out.
    tangent : (s, 3) array
        Unit vectors along the fibre.
    length : (s,) array, mm
    force : (s,) array, N
    layer : Layer
        A flat layer.

    Returns
    -------
    Coloured
        The scale ends at the force that 99 % of the pieces stay below.
    """
    plane = layer.plane
    here = np.abs(middle @ plane.frame[2] - plane.height) < 1e-6 * (1.0 + abs(plane.height))
    along = 0.5 * length[here, None] * plane.project(tangent[here])
    centre = plane.project(middle[here])
    most = float(np.quantile(force[here], 0.99)) if here.any() else 1.0
    pieces = np.stack([centre - along, centre + along], axis=1)
    return Coloured(pieces, force[here], "N in the fibre", (0.0, max(most, 1e-12)))
