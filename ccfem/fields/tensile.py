"""The direction and size of tension at every point [Chen et al. 2021, section 4.1]."""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.tensor import largest_in_plane, principal, strongest

__all__ = ["Tension", "plane_tension", "spatial_tension"]


@dataclass(frozen=True)
class Tension:
    """Tension at k places.

    Attributes
    ----------
    direction : (k, 2) or (k, 3) array
        Unit vectors; lines, so the sign means nothing.
    stress : (k,) array, MPa
        Tensile stress along the direction, 0 where there is none: 1e-5 MPa in the paper, which
        would weigh more, the smaller the load.
    defined : (k,) bool array
        Whether there is a tensile direction.
    """

    direction: FloatArray
    stress: FloatArray
    defined: BoolArray


def spatial_tension(stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of stress tensors in space, by the paper's rule.

    Principal stresses are sorted by size, largest magnitude first. A tensile first one is taken;
    else a tensile second one, unless the first is more than `compression_limit` times as large;
    else there is no tensile direction, and the first direction stands in for it.

    Parameters
    ----------
    stress : (k, 3, 3) array, MPa
    compression_limit : float, default 3.0
        The paper's mu.

    Returns
    -------
    Tension
        With directions in space.
    """
    values, directions = principal(stress)
    order = np.argsort(-np.abs(values), axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    directions = np.take_along_axis(directions, order[:, None, :], axis=2)
    first = values[:, 0] > 0.0
    second = ~first & (values[:, 1] > 0.0) & (-values[:, 0] < compression_limit * values[:, 1])
    taken = np.where(second, 1, 0)
    rows = np.arange(len(values))
    defined = first | second
    size = np.where(defined, values[rows, taken], 0.0)
    return Tension(directions[rows, :, taken], size, defined)


def plane_tension(plane_stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of plane stress, by the paper's rule applied in the plane of the layer.

    A fibre that lies in a flat layer carries the stress in that plane only, so this is what the
    planning uses by default; for stress in the plane it equals the projection of
    `spatial_tension`.

    Parameters
    ----------
    plane_stress : (k, 3) array, MPa
        s11, s22, s12 in the plane.
    compression_limit : float, default 3.0
        The paper's mu.

    Returns
    -------
    Tension
        With directions in the plane.
    """
    largest, smallest, angle = largest_in_plane(plane_stress)
    defined = (largest > 0.0) & (-smallest < compression_limit * largest)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    compressed, _ = strongest(largest, smallest)
    direction = np.where((compressed & ~defined)[:, None], across, direction)
    return Tension(direction, np.where(defined, largest, 0.0), defined)
