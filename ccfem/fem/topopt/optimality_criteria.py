"""The optimality criteria update of densities under one constraint on the volume."""

import numpy as np

from ccfem.base.arrays import FloatArray


def optimality_criteria(
    density: FloatArray,
    gradient: FloatArray,
    volume: FloatArray,
    target: float,
    move: float,
) -> FloatArray:
    """Densities in [0, 1] that balance gain and volume (Bendsoe, Struct. Optim. 1 (1989) 193).

    Parameters
    ----------
    density : (m,) array
    gradient : (m,) array
        Of the objective by each density; positive entries count as zero.
    volume : (m,) array
        Of the total volume by each density, positive.
    target : float
        Wanted ``volume @ density``.
    move : float
        Largest change of a density.

    Returns
    -------
    (m,) array
        ``clip(density * sqrt(-gradient / (multiplier * volume)))`` with the multiplier found by
        bisection; on the nearest bound where the target is out of reach.
    """
    low = np.maximum(0.0, density - move)
    high = np.minimum(1.0, density + move)
    gain = np.maximum(0.0, -gradient) / volume
    root = density * np.sqrt(gain)
    largest = float(np.sqrt(gain.max()))
    if not largest > 0.0:
        return np.clip(density, low, high)
    # Bisection of the logarithm of the root of the multiplier, over 16 decades.
    least, most = np.log(largest) - 18.5, np.log(largest) + 18.5
    for _ in range(60):
        middle = 0.5 * (least + most)
        found = np.minimum(high, np.maximum(low, root * np.exp(-middle)))
        excess = float(volume @ found) - target
        if abs(excess) <= 1e-9 * target:
            break
        least, most = (middle, most) if excess > 0.0 else (least, middle)
    return found
